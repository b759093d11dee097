"""Scenarios: boxes and a person in the hallway, drawn from a seed, and the surfaces of the building."""

from dataclasses import dataclass

import numpy as np

TASKS = ("empty", "boxes", "person", "full")
FLOORS = ("linoleum", "glossy", "tile", "carpet")
#: Share of light that a glossy floor mirrors; other floors mirror none.
GLOSS = 0.25
#: Speed at which robots are expected to drive, and time after which a run ends without a result.
CRUISE_MPS, DURATION_S = 0.4, 120.0

#: A box on the floor: center along x and to the left (m), and a color of `building.BOX_COLORS`.
Box = tuple[float, float, str]


@dataclass(frozen=True)
class Crossing:
    """A walk across the hallway at `x_m`, from `far_m` on one side to as far on the other."""

    x_m: float
    #: Side of the start: 1 left, -1 right.
    side: int
    speed_mps: float
    #: Distance ahead of the robot at which both would meet.
    lead_m: float
    #: Place and duration of a pause on the way; zero is none.
    pause_y_m: float
    pause_s: float
    far_m: float = 2.4

    @property
    def route(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Begin and end of the walk."""
        return (self.x_m, self.side * self.far_m), (self.x_m, -self.side * self.far_m)


@dataclass(frozen=True)
class Scenario:
    """Boxes and a person, the same for every robot and floor."""

    task: str
    boxes: tuple[Box, ...]
    crossing: Crossing | None
    #: Speed of the robot that the person meets.
    robot_mps: float = CRUISE_MPS


@dataclass(frozen=True)
class Surface:
    """The floor, one of `FLOORS`, and the seed of all textures."""

    floor: str
    style: int

    @property
    def covering(self) -> tuple[str, float]:
        """Kind of the floor's texture, and the share of light that it mirrors."""
        return ("linoleum", GLOSS) if self.floor == "glossy" else (self.floor, 0.0)


def draw(task: str, seed: int, robot_mps: float = CRUISE_MPS) -> Scenario:
    """Draws a scenario: `empty`; one or two `boxes`; a `person` who crosses; or all of it, `full`."""
    rng = np.random.default_rng([seed, 77])
    colors = [str(color) for color in rng.permutation(["white", "brown"])]
    count = int(rng.integers(1, 3))
    y1, y2 = rng.uniform(-0.6, 0.6, 2).tolist()
    x1, x2, x2_full = rng.uniform(3.0, 5.0), rng.uniform(6.6, 9.6), rng.uniform(9.4, 10.0)
    crossing = Crossing(
        x_m=rng.uniform(7.6, 8.4),
        side=int(rng.choice([-1, 1])),
        speed_mps=rng.uniform(0.5, 1.0),
        lead_m=rng.uniform(0.25, 0.75),
        pause_y_m=rng.uniform(-0.25, 0.25),
        pause_s=float(4.0 * (rng.random() < 0.5)),
    )
    # In a full hallway the second box stands behind the place where the person crosses.
    boxes = [(x1, y1, colors[0]), (x2 if task == "boxes" else x2_full, y2, colors[1])][:count]
    return Scenario(
        task=task,
        boxes=tuple(boxes) if task in ("boxes", "full") else (),
        crossing=crossing if task in ("person", "full") else None,
        robot_mps=robot_mps,
    )
