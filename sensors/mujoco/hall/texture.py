"""Textures of walls, floors and boards: float arrays (rows, columns, RGB), 0 to 255, drawn from a random generator."""

import cv2
import numpy as np

from .plan import CEILING_M, Plan, Point, distance

PIXELS_PER_M = 128
#: Paint of the walls.
PAINT = np.array([214, 208, 192], np.float32)
#: Color and grain of each floor.
FLOORS = {"linoleum": ((122, 116, 100), 5.0), "tile": ((150, 146, 138), 2.5), "carpet": ((78, 86, 104), 9.0)}
#: Side of a tile.
TILE_M = 0.30


def plaster(plan: Plan, begin: Point, end: Point, z_m: Point, rng: np.random.Generator) -> np.ndarray:
    """Draws a painted wall from `begin` to `end`, between two heights: mottled, scuffed, lit by the lamps."""
    length = distance(begin, end)
    z0, z1 = z_m
    columns, rows = max(8, int(length * PIXELS_PER_M)), max(8, int((z1 - z0) * PIXELS_PER_M))
    along = np.linspace(0, 1, columns)[None, :]
    z = np.linspace(z1, z0, rows)[:, None]
    x, y = begin[0] + along * (end[0] - begin[0]), begin[1] + along * (end[1] - begin[1])
    glow = sum(np.exp(-((x - lamp) ** 2 + y**2 + (z - 2.1) ** 2) / 1.4) for lamp in plan.lamps_x_m())
    shade = 0.80 + 0.16 * glow - 0.20 * np.exp(-z / 0.12) - 0.12 * np.exp(-(CEILING_M - z) / 0.08)
    texture = PAINT * shade[..., None].astype(np.float32)
    texture += (2.5 * clouds(rows, columns, 60, rng) + 1.5 * clouds(rows, columns, 8, rng))[..., None]
    texture += 2.0 * rng.standard_normal((rows, columns, 1)).astype(np.float32)
    for _ in range(int(4 * length)):
        column, row = rng.uniform(0, columns), rows - rng.exponential(0.25) * PIXELS_PER_M
        if 0 <= row < rows:
            scuffed = texture.copy()
            to = (int(column + rng.normal(0, 25)), int(row + rng.normal(0, 4)))
            cv2.line(scuffed, (int(column), int(row)), to, tuple(float(c) for c in PAINT * 0.55), 1)
            texture = 0.6 * texture + 0.4 * scuffed
    return texture


def floor_covering(plan: Plan, kind: str, x_m: Point, y_m: Point, rng: np.random.Generator) -> np.ndarray:
    """Draws the floor of a kind in `FLOORS`: pools of light below the lamps, darker along the walls."""
    columns, rows = int((x_m[1] - x_m[0]) * PIXELS_PER_M), int((y_m[1] - y_m[0]) * PIXELS_PER_M)
    x = np.linspace(*x_m, columns)[None, :]
    y = np.linspace(y_m[1], y_m[0], rows)[:, None]
    color, grain = FLOORS[kind]
    pools = sum(np.exp(-((x - lamp) ** 2 / 1.0 + y**2 / 1.4)) for lamp in plan.lamps_x_m())
    shade = 0.80 + 0.20 * pools - 0.22 * np.exp(-_to_wall(plan, x, y) / 0.10)
    texture = np.array(color, np.float32) * shade[..., None].astype(np.float32)
    texture += (4.0 * clouds(rows, columns, 90, rng) + 2.0 * clouds(rows, columns, 12, rng))[..., None]
    texture += grain * rng.standard_normal((rows, columns, 1)).astype(np.float32)
    if kind == "linoleum":
        chips = rng.random((rows, columns, 1)) < 0.02
        texture = np.where(chips, texture + rng.choice([-22, 26], (rows, columns, 1)), texture)
    if kind == "tile":
        pitch = int(TILE_M * PIXELS_PER_M)
        texture[::pitch, :] *= 0.78
        texture[:, ::pitch] *= 0.78
    return texture


def board(color: tuple[int, int, int], rows: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Draws a flat board with grain and a darker rim."""
    texture = np.full((rows, columns, 3), color, np.float32)
    texture += (3.0 * clouds(rows, columns, 24, rng) + 1.5 * rng.standard_normal((rows, columns)))[..., None]
    inside = texture[2:-2, 2:-2].copy()
    texture *= 0.8
    texture[2:-2, 2:-2] = inside
    return texture


def cardboard(color: tuple[int, int, int], rng: np.random.Generator) -> np.ndarray:
    """Draws one face of a box, with a strip of tape."""
    texture = board(color, 64, 64, rng)
    texture[:, int(64 * 0.44) : int(64 * 0.56)] *= 0.93
    return texture


def door_leaf(rng: np.random.Generator) -> np.ndarray:
    """Draws a wooden door with a metal kick plate."""
    texture = board((112, 78, 50), 256, 116, rng)
    veins = 5 * np.sin(np.linspace(0, 90, 116))[None, :, None]
    texture += veins * (1 + 0.3 * clouds(256, 116, 40, rng))[..., None]
    texture[225:250, 12:104] *= 1.25
    return texture


def notice_board(rng: np.random.Generator) -> np.ndarray:
    """Draws a board with nine sheets of paper."""
    texture = board((176, 160, 120), 100, 140, rng)
    for _ in range(9):
        row, column = rng.integers(5, 70), rng.integers(5, 110)
        texture[row : row + 24, column : column + 18] = rng.uniform(120, 245, 3)
    return texture


def window() -> np.ndarray:
    """Draws a bright pane with a cross of bars."""
    texture = np.full((128, 128, 3), 250, np.float32)
    texture[:, 60:68] = texture[60:68] = 150
    return texture


def clouds(rows: int, columns: int, cell_px: float, rng: np.random.Generator) -> np.ndarray:
    """Draws smooth noise of mean 0 and standard deviation of about 1, with features of about `cell_px`."""
    small = rng.standard_normal((max(2, int(rows / cell_px) + 2), max(2, int(columns / cell_px) + 2)))
    return cv2.resize(small.astype(np.float32), (columns, rows), interpolation=cv2.INTER_CUBIC)


def png(texture: np.ndarray) -> bytes:
    """Encodes a texture."""
    rgb = np.clip(texture, 0, 255).astype(np.uint8)
    return cv2.imencode(".png", rgb[..., ::-1])[1].tobytes()


def _to_wall(plan: Plan, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Returns the distance of floor points to the foot of the nearest wall, m."""
    half, (a, b) = plan.half_m, plan.mouth_m
    gap = np.minimum(abs(y - half), abs(y + half))
    in_mouth = (x > a) & (x < b)
    to_side = np.minimum(abs(x - a), abs(x - b)) + 0 * y
    for side in (1, -1) if plan.crosses else (1,):
        gap = np.where(in_mouth & (side * y > half), to_side, gap)
        to_corner = np.hypot(to_side, side * y - half)
        gap = np.where(in_mouth & (side * y > 0) & (side * y <= half), to_corner, gap)
    return gap
