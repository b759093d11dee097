"""Three forward sonars with cones of rays that lose echoes at steep incidence."""

from math import cos, radians, sin

import mujoco
import numpy as np

from .building import SOLID
from .robot import RADIUS_M, SONAR_MAX_M, SONAR_MIN_M, SONAR_Z_M, SONARS_RAD

#: Incidence, from the surface's normal, above which an echo is lost.
MAX_INCIDENCE_RAD = radians(50.0)
RAYS = 9
#: Standard deviation of a range: at zero, and per meter.
SIGMA_M, SIGMA_PER_M = 0.01, 0.005
#: Probability that an echo is lost.
LOSS = 0.01

#: Directions of the rays of a beam, over its cone.
_OFFSETS_RAD = np.radians(np.linspace(-11, 11, RAYS))
_SOLID_ONLY = np.array([group == SOLID for group in range(6)], np.uint8)


def ranges(
    model: mujoco.MjModel, data: mujoco.MjData, pose: tuple[float, float, float], noise: np.random.Generator
) -> tuple[float, ...]:
    """Returns the range of each beam from the rim of the robot's hull at `pose` (m, m, rad), m; `SONAR_MAX_M` without an echo."""
    robot = model.body("robot").id
    return tuple(_blur(_nearest(model, data, robot, pose, bearing), noise) for bearing in SONARS_RAD)


def _nearest(
    model: mujoco.MjModel, data: mujoco.MjData, robot: int, pose: tuple[float, float, float], bearing: float
) -> float:
    x, y, heading = pose
    nearest = SONAR_MAX_M
    normal, geom = np.zeros(3), np.zeros(1, np.int32)
    for offset in _OFFSETS_RAD:
        angle = heading + bearing + offset
        ray = np.array([cos(angle), sin(angle), 0.0])
        origin = np.array([x, y, SONAR_Z_M]) + ray * RADIUS_M
        normal[:] = 0
        range_m = mujoco.mj_ray(model, data, origin, ray, _SOLID_ONLY, 1, robot, geom, normal)
        if range_m >= 0 and abs(normal @ ray) > cos(MAX_INCIDENCE_RAD):
            nearest = min(nearest, range_m)
    return nearest


def _blur(range_m: float, noise: np.random.Generator) -> float:
    if range_m < SONAR_MAX_M:
        range_m += noise.normal(0, SIGMA_M + SIGMA_PER_M * range_m)
        if noise.random() < LOSS:
            range_m = SONAR_MAX_M
    return float(np.clip(range_m, SONAR_MIN_M, SONAR_MAX_M))
