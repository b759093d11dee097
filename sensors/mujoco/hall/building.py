"""The building as MJCF: walls with doors, a window, notice boards, floor, ceiling and lamps.

Frame and units are those of `plan`.
"""

from typing import NamedTuple

import numpy as np

from . import texture
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
    distance,
)

#: Groups of geometries. Sonars see solid ones only.
SOLID, ROBOT, DECORATION, SHADE = 0, 1, 2, 3
#: Attributes of a geometry that nothing collides with.
INTANGIBLE = 'contype="0" conaffinity="0"'
STEEL, HANDLE = "0.28 0.31 0.34 1", "0.75 0.75 0.72 1"
BASEBOARD, BASEBOARD_LIP = "0.2 0.17 0.15 1", "0.42 0.38 0.34 1"
#: Gap between a wall and its corner, so that no two faces coincide there.
CORNER_GAP_M = 0.002
BOX_COLORS = {"white": (232, 230, 224), "brown": (134, 94, 58)}
#: Notice boards: begin along x, and side: 1 left, -1 right.
NOTICE_BOARDS = ((1.4, 1), (6.3, 1), (8.6, -1))


class Slab(NamedTuple):
    """Heights and depths of a panel in front of or behind the line of a wall, m."""

    bottom_m: float
    top_m: float
    #: Distance of the front face behind the line of the wall; negative in front of it.
    inset_m: float = 0.0
    depth_m: float = 0.06


class Building:
    """MJCF elements of a building, collected wall by wall.

    `assets` are the textures by file name, `asset_xml` and `body_xml` the elements of MJCF's `asset` and `worldbody`.
    """

    def __init__(self, plan: Plan, floor: str, gloss: float, style: int):
        """Builds the plan with a floor of `texture.FLOORS`, mirroring by the share `gloss`, and textures of the seed `style`."""
        self.plan, self.rng = plan, np.random.default_rng(style)
        self.assets: dict[str, bytes] = {}
        self.asset_xml: list[str] = []
        self.body_xml: list[str] = []
        for name, color in BOX_COLORS.items():
            self._texture(f"box_{name}", texture.cardboard(color, self.rng), kind="cube")
        for wall in plan.walls():
            self._wall(wall)
        self._window()
        self._notice_boards()
        self._floor_and_ceiling(floor, gloss)
        self._lamps()

    def _texture(self, name: str, pixels: np.ndarray, kind: str = "2d", **material: float) -> str:
        self.assets[f"{name}.png"] = texture.png(pixels)
        extra = " ".join(f'{key}="{value}"' for key, value in material.items())
        self.asset_xml.append(
            f'<texture name="{name}" type="{kind}" file="{name}.png"/>'
            f'<material name="{name}" texture="{name}" specular="0.05" {extra}/>'
        )
        return name

    def _painted(self, pixels: np.ndarray, **material: float) -> str:
        name = self._texture(f"t{len(self.assets)}", pixels, **material)
        return f'material="{name}"'

    def _panel(self, begin: Point, end: Point, slab: Slab, look: str, group: int = SOLID) -> None:
        """Adds a slab whose front face goes from `begin` to `end`; `look` is its color or material."""
        length = distance(begin, end)
        dx, dy = (end[0] - begin[0]) / length, (end[1] - begin[1]) / length
        back = slab.inset_m + slab.depth_m / 2
        x, y = (begin[0] + end[0]) / 2 - dy * back, (begin[1] + end[1]) / 2 + dx * back
        z, half_height = (slab.bottom_m + slab.top_m) / 2, (slab.top_m - slab.bottom_m) / 2
        touch = f'group="{group}"' + ("" if group == SOLID else f" {INTANGIBLE}")
        self.body_xml.append(
            f'<geom type="box" pos="{x:.4f} {y:.4f} {z:.4f}" xyaxes="{dx:.6f} {dy:.6f} 0 0 0 1" '
            f'size="{length / 2:.4f} {half_height:.4f} {slab.depth_m / 2:.4f}" {touch} {look}/>'
        )

    def _wall(self, wall: Wall) -> None:
        done = 0.0
        for door in sorted(wall.doors):
            self._plaster(wall.at(done), wall.at(door - DOOR_WIDTH_M / 2))
            self._door(wall, door)
            done = door + DOOR_WIDTH_M / 2
        self._plaster(wall.at(done), wall.at(wall.length_m))

    def _plaster(self, begin: Point, end: Point) -> None:
        share = CORNER_GAP_M / distance(begin, end)
        dx, dy = (end[0] - begin[0]) * share, (end[1] - begin[1]) * share
        begin, end = (begin[0] + dx, begin[1] + dy), (end[0] - dx, end[1] - dy)
        self._plaster_from(begin, end, 0.0)
        out = {"inset_m": -BASEBOARD_STANDS_OUT_M, "depth_m": BASEBOARD_STANDS_OUT_M}
        self._panel(begin, end, Slab(0, BASEBOARD_M, **out), _plain(BASEBOARD))
        lip = Slab(BASEBOARD_M, BASEBOARD_M + 0.006, **out)
        self._panel(begin, end, lip, _plain(BASEBOARD_LIP), DECORATION)

    def _plaster_from(self, begin: Point, end: Point, bottom_m: float) -> None:
        pixels = texture.plaster(self.plan, begin, end, (bottom_m, CEILING_M), self.rng)
        self._panel(begin, end, Slab(bottom_m, CEILING_M), self._painted(pixels))

    def _door(self, wall: Wall, center_m: float) -> None:
        lo, hi = center_m - DOOR_WIDTH_M / 2, center_m + DOOR_WIDTH_M / 2
        leaf = self._painted(texture.door_leaf(self.rng))
        self._panel(wall.at(lo), wall.at(hi), Slab(0, DOOR_HEIGHT_M, LEAF_M), leaf)
        self._plaster_from(wall.at(lo), wall.at(hi), DOOR_HEIGHT_M)
        frame = {"inset_m": -FRAME_STANDS_OUT_M, "depth_m": FRAME_STANDS_OUT_M + LEAF_M}
        top_m = DOOR_HEIGHT_M + FRAME_M
        for post in (lo, hi - FRAME_M + 0.02):
            begin, end = wall.at(post - 0.01), wall.at(post + FRAME_M - 0.01)
            self._panel(begin, end, Slab(0, top_m, **frame), _plain(STEEL))
        self._panel(wall.at(lo), wall.at(hi), Slab(DOOR_HEIGHT_M, top_m, **frame), _plain(STEEL))
        handle = Slab(1.02, 1.05, 0.05, 0.03)
        self._panel(wall.at(hi - 0.24), wall.at(hi - 0.12), handle, _plain(HANDLE), DECORATION)

    def _window(self) -> None:
        pane = self._painted(texture.window(), emission=0.9)
        half = WINDOW_HALF_M
        self.body_xml.append(
            f'<geom type="box" pos="{self.plan.length_m - 0.01} 0 {WINDOW_CENTER_Z_M}" xyaxes="0 -1 0 0 0 1" '
            f'size="{half} {half} 0.012" {pane} group="{DECORATION}" {INTANGIBLE}/>'
        )

    def _notice_boards(self) -> None:
        for x, side in NOTICE_BOARDS:
            y = side * self.plan.half_m
            ends = ((x, y), (x + 0.7, y)) if side > 0 else ((x + 0.7, y), (x, y))
            look = self._painted(texture.notice_board(self.rng))
            self._panel(*ends, Slab(1.2, 1.7, -0.02, 0.02), look, DECORATION)

    def _floor_and_ceiling(self, floor: str, gloss: float) -> None:
        x0, x1, y1 = -0.5, self.plan.length_m + 0.5, self.plan.far_m + 0.5
        pixels = texture.floor_covering(self.plan, floor, (x0, x1), (-y1, y1), self.rng)
        self._texture("floor", pixels, reflectance=gloss)
        center, half = (x0 + x1) / 2, (x1 - x0) / 2
        self.body_xml.append(
            f'<geom name="floor" type="plane" pos="{center} 0 0" size="{half} {y1} 0.1" material="floor" '
            f'group="{DECORATION}" friction="0.8 0.005 0.0001"/>'
            f'<geom type="box" pos="{center} 0 {CEILING_M + 0.03}" size="{half} {y1} 0.03" '
            f'rgba="0.86 0.86 0.84 1" group="{DECORATION}" {INTANGIBLE}/>'
        )

    def _lamps(self) -> None:
        a, b = self.plan.mouth_m
        places = [(x, 0.0) for x in self.plan.lamps_x_m()] + [((a + b) / 2, self.plan.half_m + 2.0)]
        self.asset_xml.append('<material name="lamp" rgba="1 1 0.97 1" emission="1"/>')
        for number, (x, y) in enumerate(places):
            self.body_xml.append(
                f'<geom type="box" pos="{x} {y} {CEILING_M}" size="0.6 0.15 0.01" material="lamp" '
                f'group="{DECORATION}" {INTANGIBLE}/>'
                f'<light name="lamp{number}" pos="{x} {y} {CEILING_M - 0.05}" dir="0 0 -1" cutoff="80" exponent="0.6" '
                'attenuation="1 0 0.12" diffuse="0.42 0.42 0.40" specular="0.08 0.08 0.08" castshadow="false"/>'
            )


def _plain(rgba: str) -> str:
    return f'rgba="{rgba}"'
