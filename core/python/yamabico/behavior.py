"""A behavior: sensors in, one proposal out."""

import math

from .messages import Axes, Kind, Proposal, Reason
from .parameters import schema_of

PLANAR = Axes.LINEAR | Axes.ANGULAR


class Slot:
    """A place that messages of the class `message` can be plugged into; an attribute of a `Behavior`."""

    def __init__(self, message, summary, required=True):
        self.message, self.summary, self.required = message, summary, required

    def __set_name__(self, owner, name):
        self.name = name.replace("_", "-")


class Output:
    """What a behavior publishes besides proposals; an attribute of a `Behavior`."""

    def __init__(self, message, summary):
        self.message, self.summary, self.required = message, summary, False

    def __set_name__(self, owner, name):
        self.name = name.replace("_", "-")


class Behavior:
    """Derive from this class, name its slots, outputs and parameters as attributes, and override `propose`.

    The first line of the class's docstring is its summary. `name` is its name in task files, `claims` every axis that it may ever
    drive. An instance knows `self.setup`: the robot, the sensors in its slots, the folder that relative paths start from.
    """

    name = ""
    claims = Axes(0)

    def __init__(self, setup):
        self.setup = setup
        self.parameters = setup.parameters

    def propose(self, inputs):
        """Looks at the inputs once and returns `drive`, `limit`, `halt` or `abstain`.

        It sleeps never and reads no clock: `inputs.now_ns` is the time. `inputs[self.camera]` is what is in a slot.
        """
        raise NotImplementedError

    def remember(self):
        """What its successor must know, where this process dies or its parameters change: what JSON can hold, at most 16 KiB of it;
        None for nothing. Asked after each call of `propose`.
        """
        return None

    def recall(self, memory):
        """Goes on where a predecessor stopped that remembered this. Called at most once, before the first `propose`."""

    def publish(self, output, header, items=b""):
        """Publishes a message on one of its outputs."""
        self.setup.publish(output, header, items)

    @classmethod
    def slots(cls):
        """Its slots, in the order in which they are written."""
        return _attributes(cls, Slot)

    @classmethod
    def outputs(cls):
        """Its outputs, in the order in which they are written."""
        return _attributes(cls, Output)

    @classmethod
    def description(cls, protocol):
        """What it is, for whoever composes it."""
        ports = lambda ports: [
            {"name": port.name, "summary": port.summary, "required": port.required, "message": port.message.NAME}
            for port in ports
        ]
        return {
            "protocol": protocol,
            "name": cls.name,
            "summary": summary_of(cls),
            "claims": words_of(cls.claims),
            "inputs": ports(cls.slots()),
            "outputs": ports(cls.outputs()),
            "parameters": schema_of(cls),
        }


class Setup:
    """What a behavior is told when it is built."""

    def __init__(self, name="behavior", parameters=None, robot=None, sensors=None, folder=".", publish=None):
        #: Its name in the task file.
        self.name = name
        #: The keys of its table that the file says.
        self.parameters = parameters or {}
        #: Name, radius and limits of the robot, as the robot file has them.
        self.robot = robot or {}
        #: What is known of the sensor in each slot that one is plugged into, by the slot's name.
        self.sensors = sensors or {}
        #: Relative paths start here.
        self.folder = folder
        self.publish = publish or (lambda output, header, items: None)

    def with_parameters(self, parameters):
        """The same with other parameters."""
        return Setup(self.name, parameters, self.robot, self.sensors, self.folder, self.publish)

    def camera(self, slot):
        """Intrinsics and mount of the pinhole camera in `slot`, as dictionaries: pixels, meters, radians."""
        kind = self.sensors.get(slot.name, {}).get("kind", {})
        if not isinstance(kind, dict) or "Camera" not in kind:
            raise SetupError(f"inputs.{slot.name}", "needs a pinhole camera of the robot")
        return kind["Camera"]["intrinsics"], kind["Camera"]["mount"]


class SetupError(ValueError):
    """A parameter, or what is plugged in, does not fit; `key` is the one to change."""

    def __init__(self, key, problem):
        super().__init__(problem)
        self.key = key


class Refusal(Exception):
    """Why a plugin cannot begin; `key` is that of its table to change."""

    def __init__(self, problem, key=""):
        super().__init__(problem)
        self.key = key


class View:
    """A message at hand: `header` and `items`; `pixels` of a picture, which are lent for this call."""

    def __init__(self, header, items=(), pixels=None):
        self.header, self.items = header, items
        self._pixels = pixels

    @property
    def pixels(self):
        """The picture: (height, width), or (height, width, 3). Later than in this call, using it raises `ReleasedError`."""
        if self._pixels is None:
            raise TypeError(f"{type(self.header).__name__} is no picture")
        return self._pixels()


class Input:
    """What is in a slot."""

    def __init__(self, views=(), fresh=0, lost=0):
        self._views = views
        self._fresh = fresh
        #: Messages lost since the last call.
        self.lost = lost

    @property
    def latest(self):
        """The newest message, however old; None where none ever arrived."""
        return self._views[-1] if self._views else None

    @property
    def fresh(self):
        """The messages that arrived since the last call, oldest first."""
        return self._views[len(self._views) - self._fresh :]


class Inputs:
    """What a behavior sees in one call."""

    def __init__(self, now_ns, slots):
        #: The time of this call, nanoseconds.
        self.now_ns = now_ns
        self._slots = slots

    def __getitem__(self, slot):
        return self._slots.get(slot.name) or Input()


def drive(linear_mps=0.0, turn_radps=0.0, lateral_mps=None, because=Reason.NOMINAL, confidence=1.0, evidence_ns=0, note=""):
    """Drive: forward, turning to the left, and to the left where `lateral_mps` is given."""
    proposal = _proposal(Kind.DRIVE, PLANAR if lateral_mps is None else PLANAR | Axes.LATERAL, because, evidence_ns, note)
    proposal.twist.linear, proposal.twist.lateral, proposal.twist.angular = linear_mps, lateral_mps or 0.0, turn_radps
    proposal.confidence = confidence
    return proposal


def limit(linear_mps=None, turn_radps=None, because=Reason.NONE, sector=None, evidence_ns=0, note=""):
    """Allow no more than these magnitudes; `sector` (center, half width; radians) limits translation into it only."""
    axes = (Axes.LINEAR if linear_mps is not None else 0) | (Axes.ANGULAR if turn_radps is not None else 0)
    proposal = _proposal(Kind.LIMIT, axes, because, evidence_ns, note)
    proposal.limits.linear, proposal.limits.angular = linear_mps or 0.0, turn_radps or 0.0
    if sector:
        proposal.sector.center_rad, proposal.sector.half_width_rad = sector
    return proposal


def halt(axes=Axes.LINEAR | Axes.LATERAL | Axes.ANGULAR, because=Reason.NONE, evidence_ns=0, note=""):
    """Stop on `axes`."""
    return _proposal(Kind.HALT, axes, because, evidence_ns, note)


def abstain(because=Reason.NONE, note=""):
    """Propose nothing, and say why."""
    return _proposal(Kind.ABSTAIN, 0, because, 0, note)


def summary_of(cls):
    """The first line of a class's docstring."""
    return (cls.__doc__ or cls.__name__).strip().splitlines()[0]


def words_of(axes):
    """Axes in words: `linear+angular`; `none` for none."""
    return "+".join(axis.name.lower() for axis in Axes if axis & axes) or "none"


def _proposal(kind, axes, reason, evidence_ns, note):
    proposal = Proposal(kind=kind, axes=int(axes), coupled=1, confidence=1.0, reason=reason, evidence_ns=evidence_ns)
    proposal.sector.half_width_rad = math.pi
    proposal.note = note
    return proposal


def _attributes(cls, kind):
    found = {}
    for base in reversed(cls.__mro__):
        found.update((name, value) for name, value in vars(base).items() if isinstance(value, kind))
    return list(found.values())
