"""A two-dimensional world: walls that are line segments, and one robot. A template for simulators that own the clock.

    [devices.world]
    exec = ["python3", "-m", "yamabico.examples.flat_world"]
"""

import math

import numpy as np

from yamabico import Axes, Drive, Driver, Integer, Number, Numbers, Sensor, main, pinhole
from yamabico.messages import NO_ECHO, Beam, Encoding, FrameHeader, Odometry, RangeScanHeader, Truth

WALL_HEIGHT_M = 2.2
FLOOR, CEILING = 70.0, 225.0


def corridor(length_m, width_m):
    """Returns walls as line segments (n, 4), x and y of both ends in m, and their gray levels. Doors have another gray level."""
    lines, grays = [], []
    for side in (-0.5 * width_m, 0.5 * width_m):
        for begin in np.arange(-2.0, length_m + 2.0, 2.0):
            lines += [(begin, side, begin + 1.1, side), (begin + 1.1, side, begin + 2.0, side)]
            grays += [170.0, 120.0]
    end = length_m + 2.0
    lines += [(-2.0, -0.5 * width_m, -2.0, 0.5 * width_m), (end, -0.5 * width_m, end, 0.5 * width_m)]
    return np.array(lines), np.array(grays + [150.0, 150.0])


class Camera(Sensor):
    """A level pinhole camera that renders walls, floor and ceiling in flat gray levels."""

    kind, message = "camera", FrameHeader
    width_px = Integer("Image width.", 16, 1024, default=160)
    height_px = Integer("Image height.", 16, 1024, default=120)
    fov_deg = Number("Horizontal field of view.", 10, 150, default=70)
    z_m = Number("Height above the floor.", 0.05, 2.0, default=0.6)

    def describe(self):
        return pinhole(self.width_px, self.height_px, self.fov_deg, self.z_m)

    def max_item_bytes(self):
        return self.width_px * self.height_px


class Sonar(Sensor):
    """A ring of sonars."""

    kind, message = "sonar", RangeScanHeader
    azimuths_deg = Numbers("Directions of the beams, positive to the left.", -180, 180, default=[20, 0, -20])
    cone_deg = Number("Opening angle of each beam.", 1, 90, default=25)
    max_m = Number("Maximum range.", 0.1, 20, default=3)

    def describe(self):
        return {"Range": {"min_m": 0.02, "max_m": self.max_m}}

    def max_item_bytes(self):
        return len(self.azimuths_deg) * 48


class Encoders(Sensor):
    """Wheel encoders without slip."""

    kind, message = "encoders", Odometry


class Wheels(Drive):
    """A differential drive that brakes when commands stop."""

    kind, axes = "differential", Axes.LINEAR | Axes.ANGULAR
    watchdog_ms = Number("Time without commands after which the drive brakes.", 20, 5000, default=100)


class FlatWorld(Driver):
    """A corridor of lines, with a camera, sonars, wheel encoders and a drive."""

    name = "flat-world"
    sensors, drives = (Camera, Sonar, Encoders), (Wheels,)
    length_m = Number("Length of the corridor.", 1, 1000, default=16)
    width_m = Number("Width of the corridor.", 0.5, 10, default=2)
    start_y_m = Number("Start position left of the corridor's middle.", -5, 5, default=0.2)
    start_deg = Number("Heading at the start, positive to the left.", -180, 180, default=8)
    pace = Number("Ratio of simulated to real time.", 0.01, 1000, default=1)

    def __init__(self, setup):
        super().__init__(setup)
        self.walls, self.grays = corridor(self.length_m, self.width_m)
        self.start = self.pose = np.array([0.0, self.start_y_m, math.radians(self.start_deg)])
        self.speed, self.target = np.zeros(2), np.zeros(2)
        self.now_ns = self.commanded_ns = None
        self.braking, self.distance_m, self.contacts = False, 0.0, 0

    def poll(self, now_ns):
        if self.now_ns is not None:
            self.move((now_ns - self.now_ns) * 1e-9)
        self.now_ns = now_ns
        measure = {Camera: self.render, Sonar: self.range, Encoders: self.read}
        for sensor in self.setup.sensors:
            if sensor.is_due(now_ns):
                measure[type(sensor)](sensor)
        self.publish_ground_truth()
        return now_ns + self.setup.step_ns

    def apply(self, command, now_ns):
        if command is not None:
            self.target[:] = command.twist.linear, command.twist.angular
            self.commanded_ns, self.braking = now_ns, bool(command.emergency)
        elif self.commanded_ns is None or now_ns - self.commanded_ns > self.setup.drive.watchdog_ms * 1e6:
            self.target[:], self.braking = 0.0, True

    def move(self, step_s):
        limits = self.setup.robot["limits"]
        kinds = [limits["emergency" if self.braking else "acceleration"][axis] for axis in (0, 2)]
        max_change = np.array(kinds) * step_s
        self.speed = self.speed + np.clip(self.target - self.speed, -max_change, max_change)
        ahead, turn = self.speed * step_s
        heading = self.pose[2] + 0.5 * turn
        self.pose = self.pose + np.array([ahead * math.cos(heading), ahead * math.sin(heading), turn])
        self.distance_m += abs(ahead)

    def cast(self, bearings):
        """Returns the distance (m) and gray level of the nearest wall along each bearing (robot frame)."""
        angles = self.pose[2] + np.asarray(bearings)
        ray = np.stack([np.cos(angles), np.sin(angles)], axis=1)[:, None]
        begin, along = self.walls[:, :2] - self.pose[:2], self.walls[:, 2:] - self.walls[:, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            across = ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0]
            distance = (begin[:, 0] * along[:, 1] - begin[:, 1] * along[:, 0]) / across
            share = (begin[:, 0] * ray[..., 1] - begin[:, 1] * ray[..., 0]) / across
        distance = np.where((share >= 0) & (share <= 1) & (distance > 0), distance, np.inf)
        nearest = distance.argmin(axis=1)
        return distance[np.arange(len(nearest)), nearest], self.grays[nearest]

    def render(self, camera):
        k = camera.describe()["Camera"]["intrinsics"]
        tangents = (np.arange(k["width"]) - k["cx"]) / k["fx"]
        distance, gray = self.cast(-np.arctan(tangents))
        depth = np.maximum(distance / np.hypot(1.0, tangents), 0.05)
        foot = k["cy"] + k["fy"] * camera.z_m / depth
        head = k["cy"] - k["fy"] * (WALL_HEIGHT_M - camera.z_m) / depth
        rows = np.arange(k["height"])[:, None]
        # Fraction of each pixel above the foot and above the top of the wall.
        wall, sky = np.clip(foot - rows + 0.5, 0, 1), np.clip(head - rows + 0.5, 0, 1)
        image = (FLOOR + wall * (gray - FLOOR) + sky * (CEILING - gray)).astype(np.uint8)
        size = {"width": k["width"], "height": k["height"], "stride": k["width"]}
        self.publish(camera, FrameHeader(stamp_ns=self.now_ns, encoding=Encoding.GRAY8, exposure=1.0, **size), image)

    def range(self, sonar):
        beams, cone = [], math.radians(sonar.cone_deg)
        for azimuth in np.radians(sonar.azimuths_deg):
            nearest = self.cast(azimuth + np.linspace(-0.5, 0.5, 9) * cone)[0].min()
            silent = NO_ECHO if nearest > sonar.max_m else 0
            beams.append(Beam(azimuth_rad=azimuth, cone_rad=cone, range_m=min(nearest, sonar.max_m), flags=silent))
        header = RangeScanHeader(stamp_ns=self.now_ns, min_m=0.02, max_m=sonar.max_m)
        self.publish(sonar, header, (Beam * len(beams))(*beams))

    def read(self, encoders):
        turned, away = -self.start[2], self.pose - self.start
        x, y = away[0] * math.cos(turned) - away[1] * math.sin(turned), away[0] * math.sin(turned) + away[1] * math.cos(turned)
        speeds = {"vx": self.speed[0], "omega": self.speed[1]}
        self.publish(encoders, Odometry(stamp_ns=self.now_ns, x=x, y=y, theta=wrap(away[2]), **speeds))

    def publish_ground_truth(self):
        clearance = self.cast(np.linspace(-math.pi, math.pi, 37))[0].min() - self.setup.robot["radius_m"]
        self.contacts += clearance < 0 and self.speed[0] != 0
        x, y, theta = self.pose
        truth = Truth(stamp_ns=self.now_ns, x=x, y=y, theta=wrap(theta), vx=self.speed[0], omega=self.speed[1])
        truth.distance_m, truth.clearance_m, truth.person_m = self.distance_m, clearance, math.inf
        truth.contacts = self.contacts
        self.publish_truth(truth)


def wrap(angle):
    """Wraps an angle to (-pi, pi]."""
    return math.pi - (math.pi - angle) % (2 * math.pi)


if __name__ == "__main__":
    main(FlatWorld)
