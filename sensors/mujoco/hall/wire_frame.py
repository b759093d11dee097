"""The maps of the hallway in the format of `configs/maps`: corners, doors, baseboards, ceiling lines and the window.

As a program, in `sensors/mujoco`: `python -m hall.wire_frame ../../configs/maps`
"""

import sys
from pathlib import Path
from typing import NamedTuple

from .plan import (
    BASEBOARD_M,
    BASEBOARD_STANDS_OUT_M,
    CEILING_M,
    DOOR_HEIGHT_M,
    DOOR_WIDTH_M,
    FRAME_M,
    FRAME_STANDS_OUT_M,
    LEAF_M,
    WINDOW_CENTER_Z_M,
    WINDOW_HALF_M,
    Plan,
    Point,
    Wall,
)

#: Map files, and whether the side corridor continues on the right.
MAPS = {"mujoco-hall": False, "mujoco-crossing": True}
#: Distance between a door's posts and the ends of its leaf.
POST_M = FRAME_M - 0.01
#: Distance of the window's pane from the wall, and half the width of its bars.
PANE_M, BAR_M = 0.022, 0.0375

HEADER = """#:schema ../schemas/map.json
# Edges and walls of the {building} in MuJoCo; see sensors/mujoco/README.md. Written in sensors/mujoco:
#
#     python -m hall.wire_frame ../../configs/maps
#
# Meters; map frame: that of the hallway, x along it, z up from the floor. A detail runs beside an outline and cannot be
# distinguished from it at a distance.

name = "{name}"
"""


class Edge(NamedTuple):
    """A straight edge between two points (m), or a detail beside one."""

    begin: tuple[float, float, float]
    end: tuple[float, float, float]
    is_detail: bool = False


def edges(plan: Plan) -> list[Edge]:
    """Returns the edges of a building."""
    return [edge for wall in plan.walls() for edge in _edges_of(wall)] + _window(plan)


def outlines(plan: Plan) -> list[tuple[Point, Point]]:
    """Returns the walls as line segments on the floor, with the leaves of the doors behind them."""
    return [outline for wall in plan.walls() for outline in _outlines_of(wall)]


def text(name: str, plan: Plan) -> str:
    """Returns the map file of a building."""
    building = "crossing" if plan.crosses else "hallway with a side corridor"
    role = {True: ', role = "detail"', False: ""}
    point = lambda values: "[" + ", ".join(f"{value:.3f}" for value in values) + "]"  # noqa: E731
    segment = lambda begin, end, more="": f"  {{ from_m = {point(begin)}, to_m = {point(end)}{more} }},"  # noqa: E731
    lines = ["edge = [", *(segment(edge.begin, edge.end, role[edge.is_detail]) for edge in edges(plan)), "]"]
    lines += ["wall = [", *(segment(*outline) for outline in outlines(plan)), "]"]
    return HEADER.format(building=building, name=name) + "\n".join(lines) + "\n"


def _at(wall: Wall, along_m: float, out_m: float) -> Point:
    """Returns the point `along_m` along a wall and `out_m` before it."""
    (x0, y0), (x1, y1), length = wall.begin, wall.end, wall.length_m
    dx, dy = (x1 - x0) / length, (y1 - y0) / length
    return x0 + dx * along_m + dy * out_m, y0 + dy * along_m - dx * out_m


def _edges_of(wall: Wall) -> list[Edge]:
    length = wall.length_m
    at = lambda along_m, out_m, z_m: (*_at(wall, along_m, out_m), z_m)  # noqa: E731
    level = lambda a, b, out_m, z_m, detail=False: Edge(at(a, out_m, z_m), at(b, out_m, z_m), detail)  # noqa: E731
    upright = lambda a, out_m, top_m, detail=False: Edge(at(a, out_m, 0), at(a, out_m, top_m), detail)  # noqa: E731
    foot = lambda a, b: [  # noqa: E731
        level(a, b, BASEBOARD_STANDS_OUT_M, BASEBOARD_M),
        level(a, b, BASEBOARD_STANDS_OUT_M, 0, True),
    ]
    found = [level(0, length, 0, CEILING_M), upright(0, 0, CEILING_M)]
    done = 0.0
    for door in sorted(wall.doors):
        lo, hi = door - DOOR_WIDTH_M / 2, door + DOOR_WIDTH_M / 2
        found += foot(done, lo - 0.01)
        for outer, inner in ((lo - 0.01, lo + POST_M), (hi + 0.01, hi - POST_M)):
            found.append(upright(outer, FRAME_STANDS_OUT_M, DOOR_HEIGHT_M + FRAME_M))
            found.append(upright(inner, FRAME_STANDS_OUT_M, DOOR_HEIGHT_M, True))
            found.append(upright(inner, -LEAF_M, DOOR_HEIGHT_M, True))
        found.append(level(lo - 0.01, hi + 0.01, FRAME_STANDS_OUT_M, DOOR_HEIGHT_M + FRAME_M))
        found.append(level(lo + POST_M, hi - POST_M, FRAME_STANDS_OUT_M, DOOR_HEIGHT_M, True))
        done = hi + 0.01
    return found + foot(done, length)


def _outlines_of(wall: Wall) -> list[tuple[Point, Point]]:
    found, done = [], 0.0
    for door in sorted(wall.doors):
        a, b = door - DOOR_WIDTH_M / 2 + POST_M, door + DOOR_WIDTH_M / 2 - POST_M
        corners = [_at(wall, *place) for place in ((done, 0), (a, 0), (a, -LEAF_M), (b, -LEAF_M), (b, 0))]
        found += zip(corners, corners[1:], strict=False)
        done = b
    return [*found, (_at(wall, done, 0), _at(wall, wall.length_m, 0))]


def _window(plan: Plan) -> list[Edge]:
    x, half, center = plan.length_m - PANE_M, WINDOW_HALF_M, WINDOW_CENTER_Z_M
    lo, hi = center - half, center + half
    corners = [(-half, lo), (half, lo), (half, hi), (-half, hi), (-half, lo)]
    frame = [Edge((x, *a), (x, *b)) for a, b in zip(corners, corners[1:], strict=False)]
    bars = [((y, lo), (y, hi)) for y in (-BAR_M, BAR_M)]
    bars += [((-half, z), (half, z)) for z in (center - BAR_M, center + BAR_M)]
    return frame + [Edge((x, *a), (x, *b), True) for a, b in bars]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("name the folder of the maps: python -m hall.wire_frame ../../configs/maps")
    for name, crosses in MAPS.items():
        path = Path(sys.argv[1], f"{name}.toml")
        path.write_text(text(name, Plan(crosses=crosses)))
        print(path)
