"""One run of a script in the hallway, in lockstep: each time step waits for its command.

As a program, it takes a job as JSON and the path of the script, and prints the result. A script has a class `Controller` with
`__init__(setup)`, where `setup` is that of `setup_of`, and `step(time_s, image, ranges, odometry)`, which returns a speed (m/s) and
a turn rate (rad/s). `image` (RGB) and `ranges` (m: left, ahead, right) are `None` while there is no new one; `odometry` is the pose
since the start.
"""

import importlib.util
import json
import math
import sys
import time
from pathlib import Path
from types import ModuleType

from .episode import Episode
from .job import Job
from .robot import RADIUS_M, SONARS_RAD, STEP_S, Mount
from .scenario import CRUISE_MPS, Surface, draw
from .world import World

CAMERA_PERIOD_S, SONAR_PERIOD_S = 0.1, 0.05
#: Tolerance of a sensor's due time.
EPSILON_S = 1e-9


def setup_of(episode: Episode) -> dict:
    """Returns what a script may know: robot, camera (size in px, mount in m and rad), sonars and the width of the hallway."""
    mount = Mount()
    focal_px = mount.width_px / 2 / math.tan(mount.fov_rad / 2)
    return {
        "speed_mps": CRUISE_MPS,
        "hall_width_m": 2.0,
        "radius_m": RADIUS_M,
        "sonars_rad": SONARS_RAD,
        "camera": {
            "width_px": mount.width_px,
            "height_px": mount.height_px,
            "focal_px": focal_px,
            "x_m": mount.x_m,
            "z_m": mount.z_m,
            "tilt_rad": mount.tilt_rad,
        },
        #: The run itself, for scripts that see the truth.
        "episode": episode,
    }


def load(path: Path) -> ModuleType:
    """Imports a script; its folder is on the module path, for its parts."""
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"{path} is not a Python script")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def run(job: Job, script: ModuleType) -> dict:
    """Runs a job to its end and returns its result."""
    scenario, surface = draw(job.task, job.seed), Surface(job.floor, job.style)
    episode = Episode(scenario, surface, job.seed, World(scenario, surface, job.seed))
    world, controller = episode.world, script.Controller(setup_of(episode))
    next_image_s = next_ranges_s = 0.0
    thinking_s, images = 0.0, 0
    while episode.outcome is None:
        image = ranges = None
        if episode.time_s >= next_image_s - EPSILON_S:
            image, next_image_s, images = world.image(), next_image_s + CAMERA_PERIOD_S, images + 1
        if episode.time_s >= next_ranges_s - EPSILON_S:
            ranges, next_ranges_s = world.ranges(), next_ranges_s + SONAR_PERIOD_S
        begun = time.perf_counter()
        speed_mps, turn_radps = controller.step(episode.time_s, image, ranges, world.odometry())
        thinking_s += time.perf_counter() - begun
        episode.step(float(speed_mps), float(turn_radps))
    world.close()
    return {"controller": job.controller, **episode.result(), "ms_per_image": round(1000 * thinking_s / max(images, 1), 2)}


if __name__ == "__main__":
    print(json.dumps(run(Job(**json.loads(sys.argv[1])), load(Path(sys.argv[2])))))
