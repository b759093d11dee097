"""A hallway in MuJoCo: the world, scenarios with their score, and a driver for Yamabico.

Importing it chooses the renderer of MuJoCo, which must happen before MuJoCo is imported: OSMesa, in software, or EGL.
"""

import ctypes.util
import os

os.environ.setdefault("MUJOCO_GL", "osmesa" if ctypes.util.find_library("OSMesa") else "egl")
# A robot has other processes for the other cores.
os.environ.setdefault("LP_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
