"""Dimensions of the robot and of its sensors. Robot frame: x forward, y to the left, z up from the floor."""

from dataclasses import dataclass
from math import radians

#: Time step of commands and odometry.
STEP_S = 0.02

RADIUS_M, HEIGHT_M = 0.20, 0.30
#: Wheels, nominal: the encoders' counts are converted with these.
WHEEL_RADIUS_M, TRACK_M = 0.08, 0.34
TICKS_PER_REVOLUTION = 2000

#: Directions of the sonars on the rim of the hull (left, ahead, right), opening angle and height of each.
SONARS_RAD = tuple(radians(degree) for degree in (35.0, 0.0, -35.0))
SONAR_CONE_RAD = radians(22.0)
SONAR_Z_M = 0.22
SONAR_MIN_M, SONAR_MAX_M = 0.15, 4.0


@dataclass(frozen=True)
class Mount:
    """Size, field of view and mount of a camera with square pixels."""

    width_px: int = 256
    height_px: int = 240
    #: Horizontal field of view.
    fov_rad: float = radians(60.0)
    x_m: float = 0.10
    z_m: float = 0.55
    #: Pitch of the optical axis, downward.
    tilt_rad: float = radians(12.0)
