"""Keeps to the middle of a corridor by the lines where its walls meet the floor, with numpy alone.

    exec = ["python3", "-m", "yamabico.examples.wall_follower"]
"""

import math

import numpy as np

from yamabico import PLANAR, Behavior, Number, Reason, Slot, abstain, drive, main
from yamabico.messages import Encoding, FrameHeader

#: Histogram of where edges meet the horizon: tangents of the azimuth, and their step.
AZIMUTHS = np.arange(-0.8, 0.8, 0.01)
#: Histogram of edges along the corridor: offsets to the side in heights of the camera, and their step.
OFFSETS = np.arange(-5.0, 5.0, 0.05)
#: Fewer edges than this that meet in one point are no corridor.
FEWEST_EDGES = 40


class WallFollower(Behavior):
    """Keeps to the middle of a corridor by the lines where its walls meet the floor."""

    name = "numpy-wall-follower"
    claims = PLANAR

    camera = Slot(FrameHeader, "picture ahead")

    speed_mps = Number("Speed along the corridor.", 0.02, 2.0, default=0.4)
    min_contrast = Number("An edge is at least so steep, gray levels a pixel.", 1.0, 100.0, default=10.0)
    side_gain = Number("Turn rate for each meter beside the middle, rad/s/m.", 0.0, 5.0, default=0.5)
    heading_gain = Number("Turn rate for each radian away from the corridor, 1/s.", 0.0, 5.0, default=1.2)
    max_turn_radps = Number("Largest turn rate.", 0.01, 5.0, default=0.6)

    def __init__(self, setup):
        super().__init__(setup)
        self.intrinsics, self.mount = setup.camera(type(self).camera)
        self.side_m = 0.0

    def remember(self):
        return {"side_m": self.side_m}

    def recall(self, memory):
        self.side_m = memory["side_m"]

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
        # The vanishing point is right of the picture's middle where the robot is turned to the left of the corridor.
        heading = math.atan(tangent) + self.mount["pan"]
        sides = foot_lines(points[along], tangent, self.mount["z"])
        if sides is not None:
            # Of pictures in a row the newest counts a third: one of them may have taken a door for a wall.
            self.side_m += (0.5 * sum(sides) - self.side_m) / 3
        turn = -self.heading_gain * heading - self.side_gain * self.side_m
        turn = max(-self.max_turn_radps, min(self.max_turn_radps, turn))
        note = f"heading {math.degrees(heading):+.1f} deg, {self.side_m:+.2f} m left"
        return drive(self.speed_mps * max(0.3, math.cos(2 * heading)), turn, note=note)

    def edges(self, pixels):
        """Steep places of the picture: points (n, 2) on the plane one ahead of a level camera, right and down, and normals."""
        k = self.intrinsics
        gray = pixels.astype(np.float32)
        # Smoothed across, so that one bright pixel is no edge.
        right = (gray[:, 2:] - gray[:, :-2])[:-2] + 2 * (gray[:, 2:] - gray[:, :-2])[1:-1] + (gray[:, 2:] - gray[:, :-2])[2:]
        down = (gray[2:] - gray[:-2])[:, :-2] + 2 * (gray[2:] - gray[:-2])[:, 1:-1] + (gray[2:] - gray[:-2])[:, 2:]
        rows, columns = np.nonzero(np.hypot(right, down) > 8 * self.min_contrast)
        gradient = np.stack([right[rows, columns] * k["fx"], down[rows, columns] * k["fy"]], axis=1)
        seen = np.stack([(columns + 1 - k["cx"]) / k["fx"], (rows + 1 - k["cy"]) / k["fy"]], axis=1)
        along = np.stack([-gradient[:, 1], gradient[:, 0]], axis=1)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        points = leveled(seen, self.mount["tilt"])
        along = leveled(seen + 1e-3 * along, self.mount["tilt"]) - points
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def leveled(seen, tilt):
    """Points on the plane one ahead of a camera that looks down by `tilt`, as a level one would see them."""
    ahead = math.cos(tilt) - seen[:, 1] * math.sin(tilt)
    down = seen[:, 1] * math.cos(tilt) + math.sin(tilt)
    return np.stack([seen[:, 0], down], axis=1) / ahead[:, None]


def vanishing_point(points, normals):
    """Where on the horizon most edges meet, as a tangent to the right, and which edges do; None where too few do."""
    x, y = points.T
    slanted = (np.abs(normals[:, 0]) > 0.15) & (np.abs(normals[:, 1]) > 0.15) & (np.abs(y) > 0.03)
    # The edge through (x, y) meets the horizon, y = 0.
    meets = np.full(len(x), np.inf)
    meets[slanted] = x[slanted] + y[slanted] * normals[slanted, 1] / normals[slanted, 0]
    votes, _ = np.histogram(meets, bins=AZIMUTHS)
    smooth = np.convolve(votes, [1, 2, 3, 2, 1], mode="same")
    best = int(np.argmax(smooth))
    tangent = 0.5 * (AZIMUTHS[best] + AZIMUTHS[best + 1])
    for _ in range(3):
        along = np.abs(meets - tangent) < 0.03
        if np.count_nonzero(along) < FEWEST_EDGES:
            return None, along
        tangent = float(np.mean(meets[along]))
    return tangent, along


def foot_lines(points, tangent, height_m):
    """How far right of the robot the left wall (negative) and the right one are, meters; None where one is not seen."""
    below = points[points[:, 1] > 0.05]
    # A line on the floor beside the robot by so many heights leaves the vanishing point with this slope.
    offsets = (below[:, 0] - tangent) / below[:, 1]
    # Far edges are dense in the picture: each counts by what it spans on the way.
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
