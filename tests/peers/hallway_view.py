"""Geometry of a hallway as a camera on a robot sees it. Robot frame: x forward, y to the left; m and rad."""

from dataclasses import dataclass
from math import cos, sin

import numpy as np


@dataclass
class HallPose:
    """Pose of the robot in a hallway: heading against its direction, and offset to the left of its middle."""

    half_m: float
    heading: float = 0.0
    offset_m: float = 0.0

    def across(self, x, y):
        """Returns how far points of the robot frame lie to the left of the robot, across the hallway."""
        return sin(self.heading) * x + cos(self.heading) * y

    def along(self, x, y):
        """Returns how far points of the robot frame lie ahead of the robot, along the hallway."""
        return cos(self.heading) * x - sin(self.heading) * y


class FloorView:
    """Floor points of the pixels of a camera without distortion."""

    def __init__(self, camera: dict):
        """Takes the size (px), focal length (px) and mount (m, rad) of the camera."""
        self.width, self.height, self.focal_px = camera["width_px"], camera["height_px"], camera["focal_px"]
        self.tilt, self.z_m = camera["tilt_rad"], camera["z_m"]
        self.cx = (self.width - 1) / 2
        cy = (self.height - 1) / 2
        #: Ratio of the image to one of 256 columns, for which sizes in pixels were chosen.
        self.scale = self.width / 256.0
        self.horizon = cy - self.focal_px * np.tan(self.tilt)
        #: Topmost row in which the floor is looked for.
        self.top = int(self.horizon + 9 * self.scale)
        #: Columns in which the floor is looked for.
        self.columns = np.arange(2, self.width - 2, max(1, int(4 * self.scale)))
        rows, columns = np.mgrid[0 : self.height, 0 : self.width].astype(np.float32)
        right, below = (columns - self.cx) / self.focal_px, (rows - cy) / self.focal_px
        down = sin(self.tilt) + below * cos(self.tilt)
        with np.errstate(all="ignore"):
            reach = self.z_m / down
            reach[down <= 0.02] = np.nan
        #: Floor point of each pixel; not a number above the horizon.
        self.x, self.y = reach * (cos(self.tilt) - below * sin(self.tilt)) + camera["x_m"], -reach * right
        #: Depth of the floor in each row.
        self.depth = reach[:, self.width // 2]

    def vanishing_column(self, heading: float) -> float:
        """Returns the column of the hallway's vanishing point on the horizon."""
        return self.cx + self.focal_px * np.tan(heading) / cos(self.tilt)

    def floor_at(self, u, v) -> tuple[np.ndarray, np.ndarray]:
        """Returns the floor points of pixels."""
        columns = np.clip(u.astype(int), 0, self.width - 1)
        rows = np.clip(v.astype(int), 0, self.height - 1)
        return self.x[rows, columns], self.y[rows, columns]
