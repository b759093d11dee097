"""Behaviors, drivers and simulators for Yamabico in Python.

Derive a class from `Behavior` or `Driver` and pass it to `main`.
"""

from .behavior import PLANAR, Behavior, Output, Setup, SetupError, Slot, abstain, drive, halt, limit
from .device import Drive, Driver, Sensor, pinhole
from .messages import Axes, Kind, Reason
from .overlay import Overlay
from .parameters import Group, Integer, Number, Numbers, Switch, Word
from .plugin import main

__all__ = [
    "PLANAR",
    "Axes",
    "Behavior",
    "Drive",
    "Driver",
    "Group",
    "Integer",
    "Kind",
    "Number",
    "Numbers",
    "Output",
    "Overlay",
    "Reason",
    "Sensor",
    "Setup",
    "SetupError",
    "Slot",
    "Switch",
    "Word",
    "abstain",
    "drive",
    "halt",
    "limit",
    "main",
    "pinhole",
]
