"""The upper boundary of the floor and the lines of a hallway in an image."""

from dataclasses import dataclass, field
from math import atan, cos

import cv2
import numpy as np
from hallway_view import FloorView, HallPose

#: Differences from the floor's color, lightness and both chroma channels, above which a pixel is not floor.
TOLERANCE = np.array([8.0, 5.0, 5.0], np.float32)
#: Share of the difference by which the color follows the floor up a column.
FOLLOW = 0.2
#: Height of a thing on the floor, and share of the pixels over this height that differ from the floor.
MIN_HEIGHT_M, MIN_SHARE = 0.14, 0.7
#: Height of an upright line.
MIN_UPRIGHT_M = 0.20
#: First frames, after which headings change less.
WARM_UP_FRAMES = 8


class FloorBoundary:
    """The lowest row that is not floor in each column, by a color that follows slow changes."""

    def __init__(self, view: FloorView):
        self.view, self.color = view, None
        tall = np.nan_to_num(MIN_HEIGHT_M * view.focal_px / view.depth, nan=3.0)
        self._tall = np.clip(tall, 4 * view.scale, 90 * view.scale).astype(int)

    def rows(self, image: np.ndarray, learns: bool) -> np.ndarray:
        """Returns the boundary (row) in each column of the view; the color is only updated if the floor ahead is bare."""
        view, (height, width) = self.view, image.shape[:2]
        lab = cv2.medianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), 7 if view.scale < 1.5 else 13)
        lab = cv2.blur(lab, (3, 3)).astype(np.float32)
        patch = lab[int(height * 0.86) : height - 2, int(width * 0.36) : int(width * 0.64)].reshape(-1, 3)
        self._learn(np.median(patch, 0), learns)
        differs = self._differs(lab[:, view.columns])
        below = np.vstack([np.zeros((1, len(view.columns)), int), np.cumsum(differs, 0)])
        rows = np.arange(height)
        low = np.maximum(rows - self._tall, 0)
        share = (below[rows + 1] - below[low]) / np.maximum(rows + 1 - low, 1)[:, None]
        found = differs & (share > MIN_SHARE)
        found[: view.top + 1] = True
        found[height - 3 :] = False
        return height - 1 - np.argmax(found[::-1], 0)

    def _learn(self, median: np.ndarray, learns: bool) -> None:
        if self.color is None:
            self.color = median
        elif learns:
            rate = 0.3 if np.abs(median - self.color)[1:].max() < 8 else 0.02
            self.color = self.color + rate * (median - self.color)

    def _differs(self, lab: np.ndarray) -> np.ndarray:
        """Marks pixels that are not floor, up each column."""
        height, columns = lab.shape[:2]
        color = np.repeat(self.color[None], columns, 0)
        differs = np.zeros((height, columns), bool)
        for row in range(height - 3, self.view.top, -1):
            bad = (np.abs(lab[row] - color) > TOLERANCE).any(1)
            # Lamps and vignetting change the floor gradually.
            color += np.where(bad, 0.0, FOLLOW)[:, None] * (lab[row] - color)
            differs[row] = bad
        return differs


@dataclass
class FloorLines:
    """Lines on the floor along the hallway: how far to the left of the robot they lie (m), and their weights."""

    across_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
    weight: np.ndarray = field(default_factory=lambda: np.zeros(0))


class HallLines:
    """Line segments of an image: they give the heading, the walls' feet and upright edges of obstacles."""

    def __init__(self, view: FloorView):
        self.view, self.frames = view, 0
        self._detector = cv2.ximgproc.createFastLineDetector(int(14 * view.scale), 1.414, 40, 90, 3, True)

    def update(self, image: np.ndarray, pose: HallPose, boundary: np.ndarray) -> tuple[FloorLines, np.ndarray]:
        """Corrects the heading of `pose`; returns the lines on the floor, and the boundary with the feet of upright edges."""
        self.frames += 1
        found = self._detector.detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        lines = np.zeros((0, 4), np.float32) if found is None else found.reshape(-1, 4)
        if len(lines) == 0:
            return FloorLines(), boundary
        right, down = lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]
        length, slope = np.hypot(right, down), np.degrees(np.arctan2(np.abs(down), np.abs(right)))
        boundary = self._stand(lines, length, slope, pose, boundary)
        oblique = (slope > 8) & (slope < 74) & (np.abs(down) > 2)
        return self._follow(lines[oblique], length[oblique], pose), boundary

    def _follow(self, lines: np.ndarray, length: np.ndarray, pose: HallPose) -> FloorLines:
        """Votes for the vanishing point on the known horizon."""
        view, scale = self.view, self.view.scale
        if len(lines) == 0:
            return FloorLines()
        meets = lines[:, 0] + (lines[:, 2] - lines[:, 0]) * (view.horizon - lines[:, 1]) / (lines[:, 3] - lines[:, 1])
        window = (45 if self.frames < WARM_UP_FRAMES else 25) * scale
        near = np.abs(meets - view.vanishing_column(pose.heading)) < window
        if near.sum() < 2:
            return FloorLines()
        candidates, sigma = meets[near], 3.5 * scale
        closeness = np.exp(-(((candidates[:, None] - candidates[None]) / sigma) ** 2))
        score = (np.minimum(length[near], 80 * scale)[None] * closeness).sum(1)
        weight = length[near] * np.exp(-(((candidates - candidates[np.argmax(score)]) / sigma) ** 2))
        column = (weight * candidates).sum() / weight.sum()
        if score.max() > 60 * scale:
            measured = atan((column - view.cx) * cos(view.tilt) / view.focal_px)
            pose.heading += (0.5 if self.frames < WARM_UP_FRAMES else 0.2) * (measured - pose.heading)
        low = near & (np.abs(meets - column) < 2 * sigma)
        low &= np.minimum(lines[:, 1], lines[:, 3]) > view.horizon + 12 * scale
        x, y = view.floor_at((lines[low, 0] + lines[low, 2]) / 2, (lines[low, 1] + lines[low, 3]) / 2)
        return FloorLines(pose.across(x, y), np.minimum(length[low], 80 * scale) / (40 * scale))

    def _stand(self, lines, length, slope, pose: HallPose, boundary: np.ndarray) -> np.ndarray:
        """Lowers the boundary between pairs of upright lines that stand on the floor: edges of boxes, legs."""
        view, scale = self.view, self.view.scale
        foot = np.where((lines[:, 1] > lines[:, 3])[:, None], lines[:, :2], lines[:, 2:])
        x, y = view.floor_at(foot[:, 0], foot[:, 1])
        down = lines[:, 3] - lines[:, 1]
        lean = (lines[:, 2] - lines[:, 0]) / np.where(np.abs(down) < 1e-3, 1e-3, down)
        meets = lines[:, 0] + lean * (view.horizon - lines[:, 1])
        away = np.abs(meets - view.vanishing_column(pose.heading)) > 10 * scale
        stands = (slope > 80) & np.isfinite(x) & (x < 2.6) & (foot[:, 1] < view.height - 6) & away
        stands &= np.abs(pose.offset_m + pose.across(x, y)) < pose.half_m - 0.2
        stands &= length > MIN_UPRIGHT_M * view.focal_px / np.maximum(x, 0.3)
        # Its top is not on the floor close by.
        stands &= foot[:, 1] - length < view.horizon + 0.25 * view.focal_px
        u, v, x = foot[stands, 0], foot[stands, 1], x[stands]
        feet = np.zeros(len(view.columns))
        for i in range(len(u)):
            for j in range(i):
                width_m = abs(u[i] - u[j]) * x[i] / view.focal_px
                if 0.08 < width_m < 0.42 and abs(v[i] - v[j]) < 0.12 * abs(v[i] - view.horizon):
                    between = (view.columns >= min(u[i], u[j])) & (view.columns <= max(u[i], u[j]))
                    feet[between] = np.maximum(feet[between], max(v[i], v[j]))
        return np.where(feet > boundary, feet, boundary).astype(int)
