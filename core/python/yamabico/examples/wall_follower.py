"""Follows a corridor by the lines between walls and floor, with numpy alone.

    exec = ["python3", "-m", "yamabico.examples.wall_follower"]
"""

import math

import numpy as np

from yamabico import PLANAR, Behavior, Number, Reason, Slot, abstain, drive, main
from yamabico.messages import Encoding, FrameHeader
from yamabico.overlay import BLUE, MAGENTA

#: Bins of the histogram of intersections of edges with the horizon: tangent of the azimuth.
AZIMUTHS = np.arange(-0.8, 0.8, 0.01)
#: Bins of the histogram of edges along the corridor: lateral offset in units of the camera's height.
OFFSETS = np.arange(-5.0, 5.0, 0.05)
#: Minimum number of edges through the vanishing point.
MIN_EDGES = 40


class WallFollower(Behavior):
    """Follows a corridor by the lines between walls and floor."""

    name = "numpy-wall-follower"
    claims = PLANAR

    camera = Slot(FrameHeader, "frames of the forward camera")

    speed_mps = Number("Speed along the corridor.", 0.02, 2.0, default=0.4)
    min_contrast = Number("Minimum gradient of an edge, gray levels per pixel.", 1.0, 100.0, default=10.0)
    side_gain = Number("Turn rate per meter of lateral offset, rad/s/m.", 0.0, 5.0, default=0.5)
    heading_gain = Number("Turn rate per radian of heading error, 1/s.", 0.0, 5.0, default=1.2)
    max_turn_radps = Number("Maximum turn rate.", 0.01, 5.0, default=0.6)

    def __init__(self, setup):
        super().__init__(setup)
        self.intrinsics, self.mount = setup.camera(type(self).camera)
        self.side_m = 0.0

    def save_state(self):
        return {"side_m": self.side_m}

    def restore_state(self, state):
        self.side_m = state["side_m"]

    def propose(self, inputs):
        frame = inputs[self.camera].latest
        if frame is None:
            return abstain(Reason.NO_INPUT)
        if frame.header.encoding != Encoding.GRAY8:
            return abstain(Reason.MALFORMED_INPUT)
        points, normals = self.edges(frame.pixels)
        tangent, along = vanishing_point(points, normals)
        if tangent is None:
            return abstain(Reason.NO_VANISHING_POINT)
        self.draw(self.camera, frame.header, lambda overlay: self.overlay(overlay, points[along], tangent))
        # The vanishing point lies right of the image center if the robot is turned to the left.
        heading = math.atan(tangent) + self.mount["pan"]
        sides = wall_offsets(points[along], tangent, self.mount["z"])
        if sides is not None:
            # Low-pass filter: a single frame may mistake a door for a wall.
            self.side_m += (0.5 * sum(sides) - self.side_m) / 3
        turn = -self.heading_gain * heading - self.side_gain * self.side_m
        turn = max(-self.max_turn_radps, min(self.max_turn_radps, turn))
        note = f"heading {math.degrees(heading):+.1f} deg, {self.side_m:+.2f} m left"
        return drive(self.speed_mps * max(0.3, math.cos(2 * heading)), turn, note=note)

    def overlay(self, overlay, edges, tangent):
        """Draws edges along the corridor and their vanishing point."""
        k = self.intrinsics
        in_camera = level(np.vstack([[[tangent, 0.0]], edges[:500]]), -self.mount["tilt"])
        (vanishing_point, *others) = in_camera * [k["fx"], k["fy"]] + [k["cx"], k["cy"]]
        layer = overlay.image("edges along the corridor", BLUE)
        for pixel in others:
            layer.point(pixel)
        overlay.image("vanishing point", MAGENTA).circle(vanishing_point, 8.0)

    def edges(self, pixels):
        """Finds edge points: points (n, 2), right and down on the plane z = 1 of a level camera, and their normals."""
        k = self.intrinsics
        gray = pixels.astype(np.float32)
        # Sobel operator: smoothing across the gradient suppresses single bright pixels.
        right = (gray[:, 2:] - gray[:, :-2])[:-2] + 2 * (gray[:, 2:] - gray[:, :-2])[1:-1] + (gray[:, 2:] - gray[:, :-2])[2:]
        down = (gray[2:] - gray[:-2])[:, :-2] + 2 * (gray[2:] - gray[:-2])[:, 1:-1] + (gray[2:] - gray[:-2])[:, 2:]
        rows, columns = np.nonzero(np.hypot(right, down) > 8 * self.min_contrast)
        gradient = np.stack([right[rows, columns] * k["fx"], down[rows, columns] * k["fy"]], axis=1)
        points = np.stack([(columns + 1 - k["cx"]) / k["fx"], (rows + 1 - k["cy"]) / k["fy"]], axis=1)
        along = np.stack([-gradient[:, 1], gradient[:, 0]], axis=1)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        leveled = level(points, self.mount["tilt"])
        along = level(points + 1e-3 * along, self.mount["tilt"]) - leveled
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return leveled, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def level(points, tilt):
    """Transforms points on the plane z = 1 of a camera that looks down by `tilt` to those of a level camera."""
    ahead = math.cos(tilt) - points[:, 1] * math.sin(tilt)
    down = points[:, 1] * math.cos(tilt) + math.sin(tilt)
    return np.stack([points[:, 0], down], axis=1) / ahead[:, None]


def vanishing_point(points, normals):
    """Returns the vanishing point on the horizon, as a tangent to the right, and a mask of its edges; None with too few edges."""
    x, y = points.T
    slanted = (np.abs(normals[:, 0]) > 0.15) & (np.abs(normals[:, 1]) > 0.15) & (np.abs(y) > 0.03)
    # Intersection of the edge through (x, y) with the horizon, y = 0.
    meets = np.full(len(x), np.inf)
    meets[slanted] = x[slanted] + y[slanted] * normals[slanted, 1] / normals[slanted, 0]
    votes, _ = np.histogram(meets, bins=AZIMUTHS)
    smooth = np.convolve(votes, [1, 2, 3, 2, 1], mode="same")
    best = int(np.argmax(smooth))
    tangent = 0.5 * (AZIMUTHS[best] + AZIMUTHS[best + 1])
    for _ in range(3):
        along = np.abs(meets - tangent) < 0.03
        if np.count_nonzero(along) < MIN_EDGES:
            return None, along
        tangent = float(np.mean(meets[along]))
    return tangent, along


def wall_offsets(points, tangent, height_m):
    """Returns the offsets of left and right wall to the right of the robot, m; None if a wall is not found."""
    below = points[points[:, 1] > 0.05]
    # Slope of an edge from the vanishing point: its lateral offset on the floor in units of the camera's height.
    offsets = (below[:, 0] - tangent) / below[:, 1]
    # Far edges are dense in the image: weight each point by the floor length that it covers.
    votes, _ = np.histogram(offsets, bins=OFFSETS, weights=below[:, 1])
    smooth = np.convolve(votes, [1, 2, 1], mode="same")
    middles = 0.5 * (OFFSETS[:-1] + OFFSETS[1:])
    found = []
    for side in (middles < -0.4, middles > 0.4):
        if smooth[side].max() < 1.0:
            return None
        near = np.abs(offsets - middles[side][np.argmax(smooth[side])]) < 0.1
        found.append(float(np.average(offsets[near], weights=below[near, 1])) * height_m)
    return found


if __name__ == "__main__":
    main(WallFollower)
