"""Floor plan of the hallway: walls, doors, and the side corridor or crossing.

Frame: x along the hallway, y to the left, z up from the floor; lengths in m. The hallway is 0 <= x <= `length_m`.
"""

from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

CEILING_M = 2.6
BASEBOARD_M = 0.09
DOOR_WIDTH_M, DOOR_HEIGHT_M = 0.92, 2.05
#: Visible width of a door's frame.
FRAME_M = 0.08
#: Depth of a door's leaf behind the wall.
LEAF_M = 0.09
#: Distance from a frame, a baseboard and a window pane to the wall behind them.
FRAME_STANDS_OUT_M, BASEBOARD_STANDS_OUT_M = 0.025, 0.015
WINDOW_HALF_M, WINDOW_CENTER_Z_M = 0.6, 1.5

Point = tuple[float, float]


class Wall(NamedTuple):
    """A wall with the walkable side on its right, seen from `begin` toward `end`."""

    begin: Point
    end: Point
    #: Distances of the doors' centers from `begin`, m.
    doors: tuple[float, ...] = ()

    @property
    def length_m(self) -> float:
        """Length of the wall."""
        return distance(self.begin, self.end)

    def at(self, along_m: float) -> Point:
        """Returns the point `along_m` from `begin`."""
        (x0, y0), (x1, y1), length = self.begin, self.end, self.length_m
        return x0 + (x1 - x0) * along_m / length, y0 + (y1 - y0) * along_m / length


@dataclass(frozen=True)
class Plan:
    """A straight hallway with a side corridor on the left, or a crossing."""

    length_m: float = 12.5
    width_m: float = 2.0
    #: Begin and end of the side corridor's mouth along x.
    mouth_m: tuple[float, float] = (7.2, 8.8)
    side_length_m: float = 4.0
    #: If set, the side corridor continues on the right.
    crosses: bool = False
    #: Centers of the doors along x.
    doors_right_m: tuple[float, ...] = (2.2, 5.2, 10.4)
    doors_left_m: tuple[float, ...] = (3.7, 11.0)

    @property
    def half_m(self) -> float:
        """Half the width of the hallway."""
        return self.width_m / 2

    @property
    def far_m(self) -> float:
        """Distance of the side corridor's end from the hallway's middle."""
        return self.half_m + self.side_length_m

    def lamps_x_m(self) -> list[float]:
        """Returns the positions of the hallway's lamps along x."""
        return [1.25 + 2.5 * k for k in range(int(self.length_m // 2.5))]

    def walls(self) -> list[Wall]:
        """Returns the walls, around the building."""
        length, half, far, (a, b) = self.length_m, self.half_m, self.far_m, self.mouth_m
        left = self.doors_left_m
        right = [length - door for door in self.doors_right_m]
        walls = [
            Wall((0, half), (a, half), tuple(door for door in left if door < a)),
            Wall((a, half), (a, far)),
            Wall((a, far), (b, far), ((b - a) / 2,)),
            Wall((b, far), (b, half)),
            Wall((b, half), (length, half), tuple(door - b for door in left if door > b)),
            Wall((length, half), (length, -half)),
        ]
        if self.crosses:
            walls += [
                Wall((length, -half), (b, -half), tuple(door for door in right if door < length - b)),
                Wall((b, -half), (b, -far)),
                Wall((b, -far), (a, -far), ((b - a) / 2,)),
                Wall((a, -far), (a, -half)),
                Wall((a, -half), (0, -half), tuple(door - (length - a) for door in right if door > length - a)),
            ]
        else:
            walls.append(Wall((length, -half), (0, -half), tuple(right)))
        return [*walls, Wall((0, -half), (0, half), (half,))]


def distance(begin: Point, end: Point) -> float:
    """Returns the distance between two points, m."""
    return hypot(end[0] - begin[0], end[1] - begin[1])
