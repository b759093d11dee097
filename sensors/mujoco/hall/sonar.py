"""Three forward sonars with cones of rays that lose echoes at steep incidence."""

from math import cos, radians, sin

import mujoco
import numpy as np

from .bodies import ROBOT_RADIUS_M
from .building import SOLID

#: Directions of the beams (left, ahead, right), and opening angle of each.
BEARINGS_RAD = tuple(radians(degree) for degree in (35.0, 0.0, -35.0))
CONE_RAD = radians(22.0)
MIN_M, MAX_M = 0.15, 4.0
#: Height of the sonars, which a box reaches.
HEIGHT_M = 0.22
#: Incidence, from the surface's normal, above which an echo is lost.
MAX_INCIDENCE_RAD = radians(50.0)
RAYS = 9
#: Standard deviation of a range: at zero, and per meter.
SIGMA_M, SIGMA_PER_M = 0.01, 0.005
#: Probability that an echo is lost.
LOSS = 0.01

_OFFSETS_RAD = np.radians(np.linspace(-11, 11, RAYS))
_SOLID_ONLY = np.array([group == SOLID for group in range(6)], np.uint8)


def ranges(
    model: mujoco.MjModel, data: mujoco.MjData, pose: tuple[float, float, float], noise: np.random.Generator
) -> tuple[float, ...]:
    """Returns the range of each beam from the rim of the robot's hull at `pose` (m, m, rad), m; `MAX_M` without an echo."""
    robot = model.body("robot").id
    return tuple(_blur(_nearest(model, data, robot, pose, bearing), noise) for bearing in BEARINGS_RAD)


def _nearest(
    model: mujoco.MjModel, data: mujoco.MjData, robot: int, pose: tuple[float, float, float], bearing: float
) -> float:
    x, y, heading = pose
    nearest = MAX_M
    normal, geom = np.zeros(3), np.zeros(1, np.int32)
    for offset in _OFFSETS_RAD:
        angle = heading + bearing + offset
        ray = np.array([cos(angle), sin(angle), 0.0])
        origin = np.array([x, y, HEIGHT_M]) + ray * ROBOT_RADIUS_M
        normal[:] = 0
        range_m = mujoco.mj_ray(model, data, origin, ray, _SOLID_ONLY, 1, robot, geom, normal)
        if range_m >= 0 and abs(normal @ ray) > cos(MAX_INCIDENCE_RAD):
            nearest = min(nearest, range_m)
    return nearest


def _blur(range_m: float, noise: np.random.Generator) -> float:
    if range_m < MAX_M:
        range_m += noise.normal(0, SIGMA_M + SIGMA_PER_M * range_m)
        if noise.random() < LOSS:
            range_m = MAX_M
    return float(np.clip(range_m, MIN_M, MAX_M))
