"""A script that sees the truth: pure pursuit around the boxes that yields to the person. It shows that each task can be solved."""

from math import cos, sin

from hall.episode import Episode
from hall.robot import STEP_S

#: Distance of the point that the robot pursues.
LOOK_AHEAD_M = 0.55
#: Offset from a box's middle at which it is passed, and the largest one from the hallway's middle.
PASS_M, MAX_OFFSET_M = 0.60, 0.62
MAX_TURN_RADPS = 1.5
#: Distance along the hallway at which the robot waits for a person.
YIELD_M = 1.1


class Controller:
    """A driver with the truth. Positions in m, world frame."""

    def __init__(self, setup: dict):
        self.speed_mps: float = setup["speed_mps"]
        self.episode: Episode = setup["episode"]
        self.person_y: float | None = None

    def step(self, _time_s, _image, _ranges, _odometry) -> tuple[float, float]:
        """Returns a command: speed (m/s) and turn rate (rad/s)."""
        x, y, heading = self.episode.pose
        if self._waits(x):
            return 0.0, 0.0
        across = self._offset(x + 0.45) - y
        ahead = cos(heading) * LOOK_AHEAD_M + sin(heading) * across
        left = -sin(heading) * LOOK_AHEAD_M + cos(heading) * across
        turn = self.speed_mps * 2 * left / (ahead * ahead + left * left)
        return self.speed_mps, max(-MAX_TURN_RADPS, min(MAX_TURN_RADPS, turn))

    def _offset(self, x: float) -> float:
        """Returns where to drive beside a box: in the wider gap, near the box."""
        offset = 0.0
        for box_x, box_y, _ in self.episode.scenario.boxes:
            if -0.9 < x - box_x < 0.7 and abs(box_y) < 0.75:
                side = -1 if box_y >= 0 else 1
                offset = max(-0.55, min(0.55, box_y + side * PASS_M))
                if abs(offset - box_y) < 0.5:
                    offset = box_y + side * 0.55
                offset = max(-MAX_OFFSET_M, min(MAX_OFFSET_M, offset))
                if side * offset < 0 and abs(box_y) > 0.55:
                    offset = 0.0
        return offset

    def _waits(self, x: float) -> bool:
        person = self.episode.world.person
        if person.crossing is None:
            return False
        person_x, person_y = person.position
        speed = 0.0 if self.person_y is None else (person_y - self.person_y) / STEP_S
        self.person_y = person_y
        comes = abs(person_y) < 0.75 or (person_y * speed < 0 and abs(person_y) < 2.2)
        return 0.0 < person_x - x < YIELD_M and comes
