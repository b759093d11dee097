"""The interface of a behavior: sensor messages in, one motion proposal out."""

import math

from .messages import MESSAGES, Axes, Kind, Proposal, Reason
from .parameters import schema_of

PLANAR = Axes.LINEAR | Axes.ANGULAR


class Slot:
    """An input of messages of the class `message`; a class attribute of a `Behavior`."""

    def __init__(self, message, summary, required=True):
        self.message, self.summary, self.required = message, summary, required

    def __set_name__(self, owner, name):
        self.name = name.replace("_", "-")


class Output:
    """An output besides proposals; a class attribute of a `Behavior`."""

    def __init__(self, message, summary):
        self.message, self.summary, self.required = message, summary, False

    def __set_name__(self, owner, name):
        self.name = name.replace("_", "-")


class Behavior:
    """Base class of behaviors: declare slots, outputs and parameters as class attributes, and override `propose`.

    The first line of the docstring is the summary. `name` is the name in task files; `claims` are the axes that the behavior may
    ever claim with a drive proposal. `self.setup` describes the robot and the connected sensors.
    """

    name = ""
    claims = Axes(0)

    def __init__(self, setup):
        self.setup = setup
        self.parameters = setup.parameters

    def propose(self, inputs):
        """Returns a proposal for the current inputs: `drive`, `limit`, `halt` or `abstain`.

        Must not sleep or read a clock: `inputs.now_ns` is the current time. `inputs[self.camera]` is the `Input` of a slot.
        """
        raise NotImplementedError

    def save_state(self):
        """Returns the state that a restarted or reconfigured instance needs to continue, as at most 16 KiB of JSON-compatible data,
        or None. Called after each `propose`.
        """
        return None

    def restore_state(self, state):
        """Continues from the state that an earlier instance saved. Called at most once, before the first `propose`."""

    def publish(self, output, header, items=b""):
        """Publishes a message on `output`."""
        self.setup.publish(output, header, items)

    def draw(self, slot, header, function):
        """Draws what the behavior saw in the message `header` of `slot`: `function` receives an `Overlay`.

        It is called only while it has a viewer, and must not change what the behavior proposes.
        """
        self.setup.draw(slot, header, function)

    @classmethod
    def slots(cls):
        """Returns the slots in the order of their declaration."""
        return _attributes(cls, Slot)

    @classmethod
    def outputs(cls):
        """Returns the outputs in the order of their declaration."""
        return _attributes(cls, Output)

    @classmethod
    def description(cls, protocol):
        """Returns the description of the behavior for `yamabico check` and `yamabico describe`."""
        ports = lambda ports: [
            {"name": port.name, "summary": port.summary, "required": port.required, "message": port.message.NAME, **declared(port.message)}
            for port in ports
        ]
        return {
            "protocol": protocol,
            "name": cls.name,
            "summary": summary_of(cls),
            "claims": axes_text(cls.claims),
            "inputs": ports(cls.slots()),
            "outputs": ports(cls.outputs()),
            "parameters": schema_of(cls),
        }


class Setup:
    """Context in which a behavior is built."""

    def __init__(self, name="behavior", parameters=None, robot=None, sensors=None, folder=".", publish=None, draw=None):
        #: Name of this instance in the task file.
        self.name = name
        #: Parameters set in the task file.
        self.parameters = parameters or {}
        #: Name, radius and limits of the robot, from the robot file.
        self.robot = robot or {}
        #: Description of the sensor connected to each slot, by slot name.
        self.sensors = sensors or {}
        #: Folder against which relative paths are resolved.
        self.folder = folder
        self.publish = publish or (lambda output, header, items: None)
        self.draw = draw or (lambda slot, header, function: None)

    def with_parameters(self, parameters):
        """Returns a copy with other parameters."""
        return Setup(self.name, parameters, self.robot, self.sensors, self.folder, self.publish, self.draw)

    def camera(self, slot):
        """Returns intrinsics and mount of the pinhole camera in `slot`, as dictionaries in pixels, m and rad.

        Raises `SetupError` if another kind of sensor is connected.
        """
        kind = self.sensors.get(slot.name, {}).get("kind", {})
        if not isinstance(kind, dict) or "Camera" not in kind:
            raise SetupError(f"inputs.{slot.name}", "must be a pinhole camera of the robot")
        return kind["Camera"]["intrinsics"], kind["Camera"]["mount"]


class SetupError(ValueError):
    """A parameter or a connected sensor is invalid; `key` is the parameter to change."""

    def __init__(self, key, problem):
        super().__init__(problem)
        self.key = key


class LaunchError(Exception):
    """A plugin cannot start; `key` is the parameter to change, if any."""

    def __init__(self, problem, key=""):
        super().__init__(problem)
        self.key = key


class View:
    """A received message: `header` and `items`, or the `pixels` of a frame."""

    def __init__(self, header, items=(), pixels=None):
        self.header, self.items = header, items
        self._pixels = pixels

    @property
    def pixels(self):
        """Image of a frame as an array of shape (height, width) or (height, width, 3).

        Valid during this call of `propose` only: later use raises `ReleasedError`.
        """
        if self._pixels is None:
            raise TypeError(f"{type(self.header).__name__} is not a frame: it has no pixels")
        return self._pixels()


class Input:
    """Messages of one slot."""

    def __init__(self, views=(), fresh=0, lost=0):
        self._views = views
        self._fresh = fresh
        #: Number of messages lost to buffer overflow since the last call.
        self.lost = lost

    @property
    def latest(self):
        """Newest message regardless of its age; None if none has arrived."""
        return self._views[-1] if self._views else None

    @property
    def fresh(self):
        """Messages that arrived since the last call, oldest first."""
        return self._views[len(self._views) - self._fresh :]


class Inputs:
    """Input messages of one call of `propose`."""

    def __init__(self, now_ns, slots):
        #: Current time, ns.
        self.now_ns = now_ns
        self._slots = slots

    def __getitem__(self, slot):
        return self._slots.get(slot.name) or Input()


def drive(linear_mps=0.0, turn_radps=0.0, lateral_mps=None, reason=Reason.NOMINAL, confidence=1.0, evidence_ns=0, note=""):
    """Proposes to drive: forward, with a turn rate positive to the left, and to the left if `lateral_mps` is given."""
    proposal = _proposal(Kind.DRIVE, PLANAR if lateral_mps is None else PLANAR | Axes.LATERAL, reason, evidence_ns, note)
    proposal.twist.linear, proposal.twist.lateral, proposal.twist.angular = linear_mps, lateral_mps or 0.0, turn_radps
    proposal.confidence = confidence
    return proposal


def limit(linear_mps=None, turn_radps=None, reason=Reason.NONE, sector=None, evidence_ns=0, note=""):
    """Limits the speeds of all behaviors. With `sector` (center, half width; rad) only translation into the sector is limited."""
    axes = (Axes.LINEAR if linear_mps is not None else 0) | (Axes.ANGULAR if turn_radps is not None else 0)
    proposal = _proposal(Kind.LIMIT, axes, reason, evidence_ns, note)
    proposal.limits.linear, proposal.limits.angular = linear_mps or 0.0, turn_radps or 0.0
    if sector:
        proposal.sector.center_rad, proposal.sector.half_width_rad = sector
    return proposal


def halt(axes=Axes.LINEAR | Axes.LATERAL | Axes.ANGULAR, reason=Reason.NONE, evidence_ns=0, note=""):
    """Stops the robot on `axes`."""
    return _proposal(Kind.HALT, axes, reason, evidence_ns, note)


def abstain(reason=Reason.NONE, note=""):
    """Proposes no motion, with a reason."""
    return _proposal(Kind.ABSTAIN, 0, reason, 0, note)


def summary_of(cls):
    """Returns the first line of a class's docstring."""
    return (cls.__doc__ or cls.__name__).strip().splitlines()[0]


def axes_text(axes):
    """Returns the text of a set of axes, such as `linear+angular` or `none`."""
    return "+".join(axis.name.lower() for axis in Axes if axis & axes) or "none"


def _proposal(kind, axes, reason, evidence_ns, note):
    proposal = Proposal(kind=kind, axes=int(axes), coupled=1, confidence=1.0, reason=reason, evidence_ns=evidence_ns)
    proposal.sector.half_width_rad = math.pi
    proposal.note = note
    return proposal


def declared(message):
    """Returns the entry with which a description declares a message type of the program's own; empty for one of this package."""
    return {} if message.NAME in MESSAGES else {"declares": message.declaration()}


def _attributes(cls, kind):
    found = {}
    for base in reversed(cls.__mro__):
        found.update((name, value) for name, value in vars(base).items() if isinstance(value, kind))
    return list(found.values())
