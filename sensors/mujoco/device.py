"""Program of the driver `mujoco-hall`; a robot file starts it with `exec`."""

import sys

REMEDY = "pip install ./core/python -r sensors/mujoco/requirements.txt    # in the Python environment whose python3 comes first in PATH"

if __name__ == "__main__":
    try:
        from hall.device import MujocoHall
        from yamabico import main
    except ModuleNotFoundError as error:
        sys.exit(f"the Python package `{error.name}` is missing: {REMEDY}")
    except (ImportError, AttributeError) as error:
        # Without a library for rendering, PyOpenGL fails with either.
        sys.exit(f"MuJoCo cannot render in software: {error}; apt-get install libosmesa6")
    main(MujocoHall)
