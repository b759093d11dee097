"""Behaviours, drivers and simulators for Yamabico in Python: derive from `Behavior`, end in `main(MyBehavior)`."""

from .behavior import PLANAR, Behavior, Output, Setup, SetupError, Slot, abstain, drive, halt, limit
from .messages import Axes, Kind, Reason
from .parameters import Group, Integer, Number, Numbers, Switch, Word
from .plugin import main

__all__ = [
    "PLANAR",
    "Axes",
    "Behavior",
    "Group",
    "Integer",
    "Kind",
    "Number",
    "Numbers",
    "Output",
    "Reason",
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
]
