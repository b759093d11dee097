"""Program of the driver `mujoco-hall`; a robot file starts it with `exec`."""

import importlib.util
import sys

#: Modules that the driver needs, and the arguments of pip that install them.
NEEDED = ("yamabico", "mujoco", "cv2")
REMEDY = "in the Python environment of this `python3`: pip install ./core/python -r sensors/mujoco/requirements.txt"

if __name__ == "__main__":
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        sys.exit(f"Python modules are missing: {', '.join(missing)}; {REMEDY}")
    from hall.device import MujocoHall
    from yamabico import main

    main(MujocoHall)
