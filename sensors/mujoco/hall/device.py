"""The hallway as a driver of Yamabico that owns the clock: camera, sonars, wheel encoders and a differential drive."""

import ctypes
import json
import math
from collections import deque
from pathlib import Path

import numpy as np
from yamabico import Axes, Drive, Driver, Integer, Number, Sensor, SetupError, Switch, Word, pinhole
from yamabico.messages import NO_ECHO, Beam, Encoding, FrameHeader, Odometry, RangeScanHeader, Truth

from .robot import (
    RADIUS_M,
    SONAR_CONE_RAD,
    SONAR_MAX_M,
    SONAR_MIN_M,
    SONARS_RAD,
    STEP_S,
    TICKS_PER_REVOLUTION,
    TRACK_M,
    WHEEL_RADIUS_M,
    Mount,
)
from .scenario import CRUISE_MPS, DURATION_S, FLOORS, TASKS, Surface, draw

#: Readings of the encoders between which speeds are measured: one tick is 0.25 mm.
SPEED_READINGS = 4
#: Indices of the linear and the angular axis in the robot's limits.
PLANAR = (0, 2)


class Camera(Sensor):
    """A forward camera with automatic exposure."""

    kind, message = "camera", FrameHeader
    width_px = Integer("Image width.", 16, 1024, default=256)
    height_px = Integer("Image height.", 16, 1024, default=240)
    fov_deg = Number("Horizontal field of view.", 10, 150, default=60)
    x_m = Number("Position ahead of the axle.", -1, 1, default=0.10)
    z_m = Number("Height above the floor.", 0.05, 2.0, default=0.55)
    tilt_deg = Number("Pitch, positive downward.", -45, 90, default=12)
    color = Switch("RGB images instead of gray ones.", default=False)

    def describe(self):
        return pinhole(self.width_px, self.height_px, self.fov_deg, self.z_m, tilt_deg=self.tilt_deg, x_m=self.x_m)

    def max_item_bytes(self):
        return self.width_px * self.height_px * (3 if self.color else 1)

    def mount(self) -> Mount:
        """Returns the mount in the world."""
        fov_rad, tilt_rad = math.radians(self.fov_deg), math.radians(self.tilt_deg)
        return Mount(self.width_px, self.height_px, fov_rad, self.x_m, self.z_m, tilt_rad)


class Sonar(Sensor):
    """Three sonars on the rim of the hull: 35 degrees to the left, ahead, 35 degrees to the right."""

    kind, message = "sonar", RangeScanHeader

    def describe(self):
        return {"Range": {"min_m": SONAR_MIN_M, "max_m": SONAR_MAX_M}}

    def max_item_bytes(self):
        return len(SONARS_RAD) * ctypes.sizeof(Beam)


class Encoders(Sensor):
    """Wheel encoders, read with the nominal sizes of wheels that slip and differ."""

    kind, message = "encoders", Odometry


class Wheels(Drive):
    """Two driven wheels that brake when commands stop."""

    kind, axes = "differential", Axes.LINEAR | Axes.ANGULAR
    watchdog_ms = Number("Time without commands after which the drive brakes.", 20, 5000, default=100)


class MujocoHall(Driver):
    """A hallway in MuJoCo, with a robot whose run is scored."""

    name = "mujoco-hall"
    sensors, drives = (Camera, Sonar, Encoders), (Wheels,)
    task = Word("Obstacles: none, boxes, a person who crosses, or all of them.", TASKS, default="full")
    floor = Word("Floor.", FLOORS, default="linoleum")
    style = Integer("Seed of the textures.", 0, 1000, default=1)
    cruise_mps = Number("Speed of the robot that the person meets.", 0.02, 2, default=CRUISE_MPS)
    duration_s = Number("Time after which a run ends without a result.", 1, 10000, default=DURATION_S)
    result = Word("JSON file that receives the score at the end, relative to the robot file; `none` for no file.", default="none")
    pace = Number("Maximum ratio of simulated to real time.", 0.01, 1000, default=1000)

    def __init__(self, setup):
        # Only here, so that the driver describes itself without them.
        try:
            from .episode import Episode
            from .world import World
        except (ImportError, AttributeError, RuntimeError) as error:
            raise SetupError("", f"MuJoCo cannot render without a screen: {error}; remedy: apt-get install libosmesa6") from error

        super().__init__(setup)
        if setup.step_ns != round(STEP_S * 1e9):
            raise SetupError("", f"the hallway has time steps of {STEP_S} s: set `rate_hz = {1 / STEP_S:.0f}` of the arbiter")
        cameras = [sensor for sensor in setup.sensors if isinstance(sensor, Camera)]
        if len(cameras) > 1:
            raise SetupError("task", "the robot of the hallway has one camera, and the robot file names several")
        if self.result != "none" and not self.result_path.parent.is_dir():
            raise SetupError("result", f"there is no folder `{self.result_path.parent}`")
        scenario = draw(self.task, int(setup.seed), self.cruise_mps)
        surface = Surface(self.floor, self.style)
        world = World(scenario, surface, int(setup.seed), cameras[0].mount() if cameras else None)
        self.episode = Episode(scenario, surface, int(setup.seed), world, self.duration_s)
        self.now_ns = self.commanded_ns = None
        self.speed, self.target, self.braking = np.zeros(2), np.zeros(2), False
        self.readings: deque[tuple[int, int, int]] = deque(maxlen=SPEED_READINGS)

    @property
    def result_path(self) -> Path:
        """Path of the score, relative to the robot file."""
        return Path(self.setup.folder, self.result)

    def poll(self, now_ns):
        if self.now_ns is not None:
            self.move()
        self.now_ns = now_ns
        measure = {Camera: self.see, Sonar: self.listen, Encoders: self.count}
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

    def move(self):
        """Drives for one time step: toward the command, within the accelerations of the robot file."""
        limits = self.setup.robot["limits"]
        kind = limits["emergency" if self.braking else "acceleration"]
        change = np.array([kind[axis] for axis in PLANAR])
        if not self.braking and abs(self.target[0]) < abs(self.speed[0]):
            change[0] = limits.get("deceleration", kind)[0]
        change *= STEP_S
        self.speed = self.speed + np.clip(self.target - self.speed, -change, change)
        was_over = self.episode.outcome is not None
        self.episode.step(*self.speed.tolist())
        if self.episode.outcome and not was_over and self.result != "none":
            part = self.result_path.with_name(self.result_path.name + ".part")
            part.write_text(json.dumps(self.episode.result()))
            part.rename(self.result_path)

    def see(self, camera):
        """Publishes an image with the gain of the exposure."""
        world = self.episode.world
        image = world.image() if camera.color else world.gray_image()
        header = FrameHeader(
            stamp_ns=self.now_ns,
            width=image.shape[1],
            height=image.shape[0],
            stride=image.strides[0],
            encoding=Encoding.RGB8 if camera.color else Encoding.GRAY8,
            exposure=float(world.camera.exposure),
        )
        self.publish(camera, header, image)

    def listen(self, sensor):
        """Publishes a scan: ranges (m) from the rim of the hull."""
        beams = (Beam * len(SONARS_RAD))()
        for beam, azimuth, range_m in zip(beams, SONARS_RAD, self.episode.world.ranges(), strict=True):
            beam.azimuth_rad, beam.cone_rad, beam.range_m = azimuth, SONAR_CONE_RAD, range_m
            beam.x_m, beam.y_m = RADIUS_M * math.cos(azimuth), RADIUS_M * math.sin(azimuth)
            beam.flags = NO_ECHO if range_m >= SONAR_MAX_M else 0
        self.publish(sensor, RangeScanHeader(stamp_ns=self.now_ns, min_m=SONAR_MIN_M, max_m=SONAR_MAX_M), beams)

    def count(self, encoders):
        """Publishes the odometry since the start, with speeds over the last readings."""
        world = self.episode.world
        x, y, theta = world.odometry()
        self.readings.append((self.now_ns, *world.ticks()))
        (t0, left0, right0), (t1, left1, right1) = self.readings[0], self.readings[-1]
        left, right = left1 - left0, right1 - right0
        per_s = 2 * math.pi * WHEEL_RADIUS_M / TICKS_PER_REVOLUTION / ((t1 - t0) * 1e-9) if t1 > t0 else 0.0
        speeds = {"vx": (left + right) / 2 * per_s, "omega": (right - left) / TRACK_M * per_s}
        self.publish(encoders, Odometry(stamp_ns=self.now_ns, x=x, y=y, theta=theta, **speeds))

    def publish_ground_truth(self):
        """Publishes the true pose and the score so far."""
        pose, score, person = self.episode.pose, self.episode.score, self.episode.world.person
        truth = Truth(stamp_ns=self.now_ns, x=pose.x, y=pose.y, theta=pose.theta, vx=self.episode.speed_mps)
        truth.distance_m, truth.clearance_m = score.path_m, score.min_clearance_m
        truth.person_m = person.distance_m(pose.x, pose.y) - RADIUS_M
        touched = self.episode.world.touched is not None
        truth.contacts, truth.struck = int(touched and not self.episode.is_passive), int(self.episode.is_passive)
        self.publish_truth(truth)
