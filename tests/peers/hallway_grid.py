"""Obstacles and the offset in a hallway: an occupancy grid in the frame of the odometry, and a histogram of the offset."""

from math import cos, sin

import cv2
import numpy as np
from hallway_image import FloorLines
from hallway_view import FloorView, HallPose

#: Side of a cell, and number of cells: x from -1 to 16 m, y from -6 to 6 m.
CELL_M, CELLS_X, CELLS_Y = 0.05, 340, 240
BEGIN_X_M, BEGIN_Y_M = -1.0, -6.0
#: Bounds of a cell's evidence, and evidence from which it is occupied.
MIN_EVIDENCE, MAX_EVIDENCE, OCCUPIED = -2, 6, 2.0
#: Hypotheses of the offset, to the left of the hallway's middle.
OFFSETS_M = np.linspace(-0.9, 0.9, 181)
#: Distance of a sonar from the robot's center.
RIM_M = 0.2


class Grid:
    """Evidence of obstacles from the camera and the sonars."""

    def __init__(self, view: FloorView, pose: HallPose):
        self.view, self.pose = view, pose
        self.evidence = np.zeros((CELLS_X, CELLS_Y), np.float32)
        #: Pose of the robot by odometry.
        self.odometry = (0.0, 0.0, 0.0)

    def fade(self) -> None:
        """Moves all evidence toward zero."""
        self.evidence -= np.sign(self.evidence) * 0.35

    def see(self, boundary: np.ndarray, ahead_m: float) -> None:
        """Adds an image: free floor below the boundary, obstacles at it, unless the sonar sees farther ahead."""
        view, pose, columns = self.view, self.pose, self.view.columns
        rows = np.arange(view.height - 4, view.top, -3)
        free = rows[:, None] > boundary[None] + 2
        x, y = view.x[np.ix_(rows, columns)][free], view.y[np.ix_(rows, columns)][free]
        near = np.isfinite(x) & (x < 2.6)
        self._add(x[near], y[near], -0.7)
        x, y = view.x[boundary, columns], view.y[boundary, columns]
        stands = np.isfinite(x) & (x < 2.4) & (boundary < view.height - 4)
        stands &= np.abs(pose.offset_m + pose.across(x, y)) < pose.half_m - 0.17
        # Reflections on a shiny floor.
        azimuth, distance = np.degrees(np.arctan2(y, x)), np.hypot(x, y)
        stands &= ~((np.abs(azimuth) < 8) & (distance + 0.35 < ahead_m + 0.2) & (distance < 3.0))
        self._add(x[stands], y[stands], 1.3)
        self._add(x[stands] + 0.05, y[stands], 1.3)

    def listen(self, left_m: float, ahead_m: float, right_m: float) -> None:
        """Adds a scan of the sonars."""
        if ahead_m < 1.6:
            azimuths = np.radians(np.linspace(-5, 5, 5))
            self._add((ahead_m + RIM_M) * np.cos(azimuths), (ahead_m + RIM_M) * np.sin(azimuths), 1.0)
        if ahead_m > 0.4:
            steps = np.arange(0.25, min(ahead_m, 2.6) + 0.02, 0.05)
            distance, azimuths = np.meshgrid(steps, np.radians(np.linspace(-7, 7, 7)))
            self._add((distance * np.cos(azimuths)).ravel(), (distance * np.sin(azimuths)).ravel(), -0.3)
        for range_m, bearing in ((left_m, 35), (right_m, -35)):
            if range_m < 0.6:
                azimuths = np.radians(bearing + np.linspace(-4, 4, 3))
                x, y = (range_m + RIM_M) * np.cos(azimuths), (range_m + RIM_M) * np.sin(azimuths)
                inside = np.abs(self.pose.offset_m + self.pose.across(x, y)) < self.pose.half_m - 0.2
                self._add(x[inside], y[inside], 0.8)

    def obstacles(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns the occupied cells ahead: along the hallway from the robot, and to the left of the hallway's middle."""
        i, j = np.nonzero(self.evidence >= OCCUPIED)
        x = (i + 0.5) * CELL_M + BEGIN_X_M - self.odometry[0]
        y = (j + 0.5) * CELL_M + BEGIN_Y_M - self.odometry[1]
        c, s = cos(self.odometry[2]), sin(self.odometry[2])
        x, y = c * x + s * y, -s * x + c * y
        along, left = self.pose.along(x, y), self.pose.offset_m + self.pose.across(x, y)
        ahead = (along > -0.5) & (along < 2.6) & (np.abs(left) < self.pose.half_m - 0.14)
        return along[ahead], left[ahead]

    def is_occupied_near(self) -> bool:
        """Returns true if something stands closely ahead."""
        along, left = self.obstacles()
        return bool(((along > 0.3) & (along < 1.2) & (np.abs(left - self.pose.offset_m) < 0.4)).any())

    def _add(self, x: np.ndarray, y: np.ndarray, evidence: float) -> None:
        x0, y0, heading = self.odometry
        x, y = np.asarray(x, float), np.asarray(y, float)
        i = ((x0 + cos(heading) * x - sin(heading) * y - BEGIN_X_M) / CELL_M).astype(int)
        j = ((y0 + sin(heading) * x + cos(heading) * y - BEGIN_Y_M) / CELL_M).astype(int)
        inside = (i >= 0) & (i < CELLS_X) & (j >= 0) & (j < CELLS_Y)
        if inside.any():
            cells = np.unique(i[inside] * CELLS_Y + j[inside])
            flat = self.evidence.ravel()
            flat[cells] = np.clip(flat[cells] + evidence, MIN_EVIDENCE, MAX_EVIDENCE)


class OffsetFilter:
    """Histogram filter of the offset from the hallway's middle."""

    def __init__(self) -> None:
        self._histogram = np.exp(-((OFFSETS_M / 0.15) ** 2))

    def update(self, moved_m: float, view: FloorView, pose: HallPose, boundary: np.ndarray, lines: FloorLines) -> None:
        """Moves the histogram by `moved_m` to the left, and measures the offset of `pose` by the feet of the walls."""
        moved = np.interp(OFFSETS_M - moved_m, OFFSETS_M, self._histogram, left=0, right=0)
        prior = cv2.GaussianBlur(moved.reshape(1, -1).astype(np.float32), (0, 0), 1.2).ravel() + 1e-6
        x, y = view.x[boundary, view.columns], view.y[boundary, view.columns]
        seen = (boundary < view.height - 4) & (x < 4.0) & np.isfinite(x)
        across, wall = pose.across(x[seen], y[seen]), pose.half_m - 0.015
        light = np.full(across.shape, 0.25)
        sets = [(wall - across, light), (-wall - across, light)]
        if len(lines.across_m):
            # The upper edge of the baseboard, 9 cm high, seems to lie farther away.
            higher = view.z_m / (view.z_m - 0.09)
            for side in (wall, -wall):
                sets.append((side - lines.across_m, lines.weight))
            for side in (wall, -wall):
                sets.append((side - lines.across_m / higher, 0.5 * lines.weight))
        vote = np.zeros_like(OFFSETS_M)
        for offset, weight in sets:
            plausible = np.abs(offset) < 0.9
            if plausible.any():
                near = np.exp(-(((OFFSETS_M[None] - offset[plausible, None]) / 0.035) ** 2))
                vote += (weight[plausible, None] * near).sum(0)
        posterior = prior * (0.35 + np.minimum(vote, 6.0))
        self._histogram = posterior / posterior.max()
        best = int(np.argmax(self._histogram))
        peak = slice(max(0, best - 6), best + 7)
        pose.offset_m = float((OFFSETS_M[peak] * self._histogram[peak]).sum() / self._histogram[peak].sum())
