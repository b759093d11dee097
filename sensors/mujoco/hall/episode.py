"""A run through the hallway: time steps, and the score."""

from dataclasses import dataclass, field
from math import cos, hypot, sin, sqrt

from .robot import STEP_S
from .scenario import DURATION_S, Scenario, Surface
from .world import World

#: End of the way, and end of a run that stays in a circle of `STUCK_M` for `STUCK_S`.
GOAL_X_M, STUCK_M, STUCK_S = 11.0, 0.10, 30.0
#: Bounds of commands.
MAX_MPS, MAX_RADPS = 1.0, 2.0
#: Speeds below which the robot stands, and above which it drives; it has stopped after `STOP_S`.
STANDING_MPS, DRIVING_MPS, STOP_S = 0.03, 0.08, 0.3
#: A contact while the robot has stood for this long is passive: something ran into it.
PASSIVE_MPS, PASSIVE_S = 0.05, 0.1
#: Time steps between two measurements of the clearance.
CLEARANCE_STEPS = 5
#: Part of the hallway in which the offset from its middle counts, away from boxes and the person.
FREE_FROM_X_M, FREE_FROM_BOX_M = 1.8, 1.5


@dataclass
class Score:
    """Measurements of a run so far. Lengths in m."""

    path_m: float = 0.0
    reverse_m: float = 0.0
    free_m: float = 0.0
    free_square_m3: float = 0.0
    min_clearance_m: float = 9.9
    stops: int = 0
    #: Time for which the robot has stood.
    standing_s: float = 0.0
    is_driving: bool = False
    #: Last place that the robot left by more than `STUCK_M`, and when.
    anchor: tuple[float, float] = (0.0, 0.0)
    anchor_s: float = 0.0

    @property
    def rms_offset_m(self) -> float | None:
        """Offset from the hallway's middle where the way is free; `None` on less than half a meter."""
        return sqrt(self.free_square_m3 / self.free_m) if self.free_m > 0.5 else None


@dataclass
class Episode:
    """A run in `world`. `outcome` is set at its end: `arrived`, `contact`, `stuck` or `timeout`; later steps do not count."""

    scenario: Scenario
    surface: Surface
    seed: int
    world: World
    duration_s: float = DURATION_S
    time_s: float = 0.0
    outcome: str | None = None
    #: Set if the contact was passive: the robot stood, and what touched it ran into it.
    is_passive: bool = False
    #: Smoothed forward speed.
    speed_mps: float = 0.0
    score: Score = field(default_factory=Score)

    def __post_init__(self) -> None:
        self.pose = self.world.pose()
        self.score.anchor = self.pose[:2]
        self._steps = 0

    def step(self, speed_mps: float, turn_radps: float) -> None:
        """Drives for one time step, with the command limited to `MAX_MPS` and `MAX_RADPS`."""
        self.world.person.react(self.pose.x, STEP_S)
        speed_mps = min(max(speed_mps, -MAX_MPS), MAX_MPS)
        turn_radps = min(max(turn_radps, -MAX_RADPS), MAX_RADPS)
        before, self.pose = self.pose, self.world.step(speed_mps, turn_radps, STEP_S)
        dx, dy = self.pose.x - before.x, self.pose.y - before.y
        ahead = dx * cos(self.pose.theta) + dy * sin(self.pose.theta)
        self.speed_mps += 0.3 * (ahead / STEP_S - self.speed_mps)
        if self.outcome is None:
            self.time_s += STEP_S
            self._steps += 1
            self._measure(hypot(dx, dy), ahead)
            self._decide()

    def result(self) -> dict:
        """Returns the result as a JSON object."""
        score, contact, rms = self.score, self.world.touched, self.score.rms_offset_m
        return {
            "task": self.scenario.task,
            "floor": self.surface.floor,
            "style": self.surface.style,
            "seed": self.seed,
            "outcome": self.outcome,
            "contact": contact,
            "passive": self.is_passive,
            "time_s": round(self.time_s, 2),
            "min_clearance_m": round(score.min_clearance_m, 3),
            "rms_offset_m": None if rms is None else round(rms, 3),
            "stops": score.stops,
            "path_m": round(score.path_m, 2),
            "reverse_m": round(score.reverse_m, 2),
            "end": [round(value, 3) for value in self.pose],
        }

    def _measure(self, length: float, ahead: float) -> None:
        score = self.score
        score.path_m += length
        score.reverse_m += max(0.0, -ahead)
        if self._is_free():
            score.free_m += length
            score.free_square_m3 += length * self.pose.y**2
        score.standing_s = score.standing_s + STEP_S if abs(self.speed_mps) < STANDING_MPS else 0.0
        if abs(self.speed_mps) > DRIVING_MPS:
            score.is_driving = True
        if score.is_driving and score.standing_s > STOP_S:
            score.stops, score.is_driving = score.stops + 1, False
        if self._steps % CLEARANCE_STEPS == 0:
            score.min_clearance_m = min(score.min_clearance_m, self.world.clearance_m())

    def _is_free(self) -> bool:
        x = self.pose.x
        boxes = all(abs(x - box[0]) > FREE_FROM_BOX_M for box in self.scenario.boxes)
        return FREE_FROM_X_M < x < GOAL_X_M and boxes and not self.world.person.is_near(x)

    def _decide(self) -> None:
        score, pose = self.score, self.pose
        if self.world.touched:
            self.outcome, score.min_clearance_m = "contact", 0.0
            self.is_passive = abs(self.speed_mps) < PASSIVE_MPS and score.standing_s > PASSIVE_S
        elif pose.x > GOAL_X_M:
            self.outcome = "arrived"
        elif hypot(pose.x - score.anchor[0], pose.y - score.anchor[1]) > STUCK_M:
            score.anchor, score.anchor_s = pose[:2], self.time_s
        elif self.time_s - score.anchor_s > STUCK_S:
            self.outcome = "stuck"
        if self.outcome is None and self.time_s >= self.duration_s:
            self.outcome = "timeout"
