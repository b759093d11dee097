"""A person who walks straight across the hallway when the robot comes near. Positions in m, speeds in m/s, world frame."""

from enum import Enum
from math import atan2, cos, hypot, pi, sin

import mujoco
import numpy as np

from .bodies import PERSON
from .scenario import Crossing

#: Distance between the legs' centers and the middle, amplitude of their swing, and length of a double step.
LEG_M, SWING_M, STRIDE_M = 0.1, 0.18, 1.3
#: Route of a person who is not in the building.
AWAY = ((40.0, 40.0), (41.0, 40.0))


class Walk(Enum):
    """State of a crossing."""

    WAITING, WALKING, PAUSING, DONE = range(4)


class Person:
    """A person in a world, who has walked `walked_m` of the route at `speed_mps`."""

    def __init__(self, model: mujoco.MjModel, crossing: Crossing | None, robot_mps: float):
        """Takes the crossing, if there is one; it begins so that a robot at `robot_mps` meets the person."""
        self.crossing, self.state = crossing, Walk.WAITING
        self.speed_mps = self.walked_m = 0.0
        self._mocap = {part: model.body(part).mocapid[0] for part in PERSON}
        begin, end = (np.array(point, float) for point in (crossing.route if crossing else AWAY))
        self._begin, self._along = begin, end - begin
        self._length_m = float(np.hypot(*self._along))
        heading = atan2(*self._along[::-1])
        self._ahead, self._side = np.array([cos(heading), sin(heading)]), np.array([-sin(heading), cos(heading)])
        self._rotation = [cos(heading / 2), 0, 0, sin(heading / 2)]
        self._placed_m: float | None = None
        if crossing:
            self._pause_left_s = crossing.pause_s
            self._begin_at_m = crossing.x_m - crossing.lead_m - robot_mps * crossing.far_m / crossing.speed_mps
            self._pause_at_m = crossing.far_m - crossing.side * crossing.pause_y_m

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the bodies."""
        return PERSON

    def react(self, robot_x_m: float, step_s: float) -> None:
        """Begins, interrupts or ends the walk, one time step at a time."""
        crossing = self.crossing
        if crossing is None:
            return
        if self.state is Walk.WAITING and robot_x_m >= self._begin_at_m:
            self.state, self.speed_mps = Walk.WALKING, crossing.speed_mps
        elif self.state is Walk.WALKING and self._pause_left_s > 0 and self.walked_m >= self._pause_at_m:
            self.state, self.speed_mps = Walk.PAUSING, 0.0
        elif self.state is Walk.PAUSING:
            self._pause_left_s -= step_s
            if self._pause_left_s <= 0:
                self.state, self.speed_mps = Walk.WALKING, crossing.speed_mps
        elif self.state is Walk.WALKING and self.walked_m >= 2 * crossing.far_m - 0.02:
            self.state, self.speed_mps = Walk.DONE, 0.0

    def move(self, data: mujoco.MjData, step_s: float) -> None:
        """Walks on for a time step: two legs swing opposite to each other."""
        self.walked_m += self.speed_mps * step_s
        if self.walked_m == self._placed_m:
            return
        self._placed_m = self.walked_m
        position = np.array(self.position)
        swing = SWING_M * sin(self.walked_m * 2 * pi / STRIDE_M)
        step = LEG_M * self._side + swing * self._ahead
        for part, offset in zip(PERSON, (0 * self._side, step, -LEG_M * self._side - swing * self._ahead), strict=True):
            mocap = self._mocap[part]
            data.mocap_pos[mocap] = [*(position + offset), 0]
            data.mocap_quat[mocap] = self._rotation

    @property
    def position(self) -> tuple[float, float]:
        """Position of the person's middle."""
        x, y = (self._begin + self._along * min(self.walked_m / self._length_m, 1.0)).tolist()
        return x, y

    def is_near(self, x_m: float) -> bool:
        """Returns true if the person is in or beside the hallway, within 1.5 m of `x_m` along it."""
        x, y = self.position
        return self.crossing is not None and abs(y) < 1.4 and abs(x - x_m) < 1.5

    def distance_m(self, x_m: float, y_m: float) -> float:
        """Returns the distance from a point to the person's middle; infinite if there is none."""
        x, y = self.position
        return hypot(x - x_m, y - y_m) if self.crossing else float("inf")
