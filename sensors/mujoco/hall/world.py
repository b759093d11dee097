"""The hallway, the robot and its sensors in MuJoCo, from a scenario and a seed.

Frames: world and robot have x forward (along the hallway), y to the left; angles in rad, counterclockwise, in (-pi, pi].
"""

import atexit
from math import atan2, cos, pi, radians, sin
from typing import NamedTuple

import cv2
import mujoco
import numpy as np

from . import sonar
from .bodies import PHYSICS_STEP_S, model
from .building import SOLID, Building
from .camera import Camera
from .person import Person
from .plan import Plan
from .robot import TICKS_PER_REVOLUTION, TRACK_M, WHEEL_RADIUS_M, Mount
from .scenario import Scenario, Surface

#: Start of the robot (m, m, rad) and the bounds of its random part.
START, START_JITTER = (0.8, 0.0, 0.0), (0.05, 0.10, radians(4))
#: Time constant of the motors, and time steps for the robot to settle on its wheels.
MOTOR_LAG_S, SETTLING_STEPS = 0.06, 50
#: Standard deviation of each wheel's gain; of its slow change per root of a second, and the time constant of that.
GAIN_SIGMA, WOBBLE_SIGMA, WOBBLE_S = 0.01, 0.02, 0.5
#: Bound of the clearance.
MAX_CLEARANCE_M = 3.0


class Pose(NamedTuple):
    """A pose on the floor: m, m, rad."""

    x: float
    y: float
    theta: float


class World:
    """A hallway with a robot in it. Everything random is drawn from the seed: drive, camera and sonars have streams of their own."""

    def __init__(self, scenario: Scenario, surface: Surface, seed: int, mount: Mount | None = None):
        floor, gloss = surface.covering
        building = Building(Plan(crosses=scenario.crossing is not None), floor, gloss, surface.style)
        self.model = mujoco.MjModel.from_xml_string(model(building, scenario.boxes), building.assets)
        self.data = mujoco.MjData(self.model)
        self.camera = Camera(self.model, mount or Mount())
        self.person = Person(self.model, scenario.crossing, scenario.robot_mps)
        #: First thing that the robot touched: "person", "wall", or a box with its color; `None` so far.
        self.touched: str | None = None
        self._robot, self._floor = self.model.body("robot").id, self.model.geom("floor").id
        self._hull, self._wheels = self.model.geom("hull").id, [self.model.joint(w).qposadr[0] for w in ("left", "right")]
        root = self.model.body_rootid[self.model.geom_bodyid]
        self._is_robot = root == self._robot
        self._solids = np.flatnonzero((self.model.geom_group == SOLID) & ~self._is_robot).tolist()
        place = self.model.joint("robot").qposadr[0]
        self._place = slice(place, place + 7)
        self._boxes = scenario.boxes
        atexit.register(self.close)
        self._reset(seed)

    def step(self, speed_mps: float, turn_radps: float, duration_s: float) -> Pose:
        """Holds a motor command for a duration, and returns the true pose.

        Raises `ValueError` if the command is not finite.
        """
        if not (np.isfinite(speed_mps) and np.isfinite(turn_radps)):
            raise ValueError(f"the motor command must be finite, but is {speed_mps} m/s, {turn_radps} rad/s")
        half = turn_radps * TRACK_M / 2
        wanted = np.array([speed_mps - half, speed_mps + half]) / WHEEL_RADIUS_M
        for _ in range(max(1, round(duration_s / PHYSICS_STEP_S))):
            self._turn_wheels(wanted)
            self.person.move(self.data, PHYSICS_STEP_S)
            mujoco.mj_step(self.model, self.data)
            if self.touched is None:
                self.touched = self._touching()
        self._count_ticks()
        return self.pose()

    def pose(self) -> Pose:
        """Returns the true pose."""
        x, y, _, w, qx, qy, qz = self.data.qpos[self._place]
        return Pose(float(x), float(y), atan2(2 * (w * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)))

    def odometry(self) -> Pose:
        """Returns the pose by the encoders and the nominal wheels, relative to the start."""
        (x, y, theta), (x0, y0, theta0) = self._odometry.tolist(), self._start
        dx, dy, c, s = x - x0, y - y0, cos(theta0), sin(theta0)
        return Pose(c * dx + s * dy, -s * dx + c * dy, (theta - theta0 + pi) % (2 * pi) - pi)

    def ticks(self) -> tuple[int, int]:
        """Returns the counts of the left and the right encoder since the start."""
        left, right = (self._ticks - self._first_ticks).tolist()
        return left, right

    def image(self) -> np.ndarray:
        """Returns an image of the camera: (height, width, 3), RGB, 8 bits."""
        return self.camera.image(self.data)

    def gray_image(self) -> np.ndarray:
        """Returns an image of the camera: (height, width), gray, 8 bits."""
        return cv2.cvtColor(self.image(), cv2.COLOR_RGB2GRAY)

    def ranges(self) -> tuple[float, ...]:
        """Returns the ranges of the sonars, m: left, ahead, right; `robot.SONAR_MAX_M` without an echo."""
        return sonar.ranges(self.model, self.data, self.pose(), self._sonar_noise)

    def clearance_m(self) -> float:
        """Returns the distance from the robot's hull to the nearest solid thing, at most `MAX_CLEARANCE_M`. For scoring only."""
        gap = lambda solid: mujoco.mj_geomDistance(self.model, self.data, self._hull, solid, MAX_CLEARANCE_M, None)  # noqa: E731
        return float(min(map(gap, self._solids)))

    def close(self) -> None:
        """Releases the renderer."""
        atexit.unregister(self.close)
        self.camera.close()

    def _reset(self, seed: int) -> None:
        self._noise = rng = np.random.default_rng(seed)
        self._sonar_noise = np.random.default_rng([seed, 2])
        x, y, heading = (value + rng.uniform(-jitter, jitter) for value, jitter in zip(START, START_JITTER, strict=True))
        self.data.qpos[self._place] = [x, y, 0.0, cos(heading / 2), 0, 0, sin(heading / 2)]
        self._gain = 1 + rng.normal(0, GAIN_SIGMA, 2)
        self._turning, self._wobble = np.zeros(2), np.zeros(2)
        light = rng.uniform(0.8, 1.15)
        self.camera.reset(1 + rng.normal(0, 0.02, 3), np.random.default_rng([seed, 1]))
        self.model.light_diffuse[:] = self.model.light_diffuse * light * rng.uniform(0.8, 1.1, (self.model.nlight, 1))
        self.person.move(self.data, 0.0)
        mujoco.mj_forward(self.model, self.data)
        for _ in range(SETTLING_STEPS):
            mujoco.mj_step(self.model, self.data)
        self._ticks = self._first_ticks = self._read_encoders()
        self._odometry, self._start = np.array(self.pose()), self.pose()

    def _turn_wheels(self, wanted_radps: np.ndarray) -> None:
        self._turning += (wanted_radps - self._turning) * (PHYSICS_STEP_S / MOTOR_LAG_S)
        kick = WOBBLE_SIGMA * PHYSICS_STEP_S**0.5 * self._noise.standard_normal(2)
        self._wobble += -self._wobble * PHYSICS_STEP_S / WOBBLE_S + kick
        self.data.ctrl[:] = self._turning * self._gain * (1 + self._wobble)

    def _read_encoders(self) -> np.ndarray:
        return np.floor(self.data.qpos[self._wheels] / (2 * pi) * TICKS_PER_REVOLUTION).astype(int)

    def _count_ticks(self) -> None:
        ticks = self._read_encoders()
        left, right = (ticks - self._ticks) / TICKS_PER_REVOLUTION * 2 * pi * WHEEL_RADIUS_M
        self._ticks = ticks
        ahead, turn = (left + right) / 2, (right - left) / TRACK_M
        heading = self._odometry[2] + turn / 2
        self._odometry += [ahead * cos(heading), ahead * sin(heading), turn]
        self._odometry[2] = atan2(sin(self._odometry[2]), cos(self._odometry[2]))

    def _touching(self) -> str | None:
        """Returns the first thing that the robot touches now, other than the floor."""
        pairs = self.data.contact.geom
        of_robot = self._is_robot[pairs]
        touches = (of_robot[:, 0] != of_robot[:, 1]) & (pairs != self._floor).all(axis=1)
        if not touches.any():
            return None
        first = int(touches.argmax())
        other = int(pairs[first, 1] if of_robot[first, 0] else pairs[first, 0])
        name = self.model.body(int(self.model.geom_bodyid[other])).name
        if name.startswith("box"):
            return f"box_{self._boxes[int(name[3:])][2]}"
        return "person" if name in self.person.parts else "wall"
