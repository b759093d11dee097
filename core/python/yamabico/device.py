"""A driver: sensors, a drive, or a whole simulator."""

import math

from .behavior import summary_of, words_of
from .messages import TRUTH_TOPIC, Axes, Odometry
from .parameters import Number, schema_of


class Sensor:
    """A kind of sensor: derive from this class, name its parameters as attributes.

    `kind` is its name in robot files, `message` the class of what it publishes. `period_ms` and `latency_ms` are keys of every
    sensor here.
    """

    kind = ""
    message = Odometry

    period_ms = Number("From one measurement to the next.", 1, 10000, default=50)
    latency_ms = Number("From a measurement to its delivery.", 0, 10000, default=0)

    def __init__(self, name, parameters):
        self.name, self.parameters = name, parameters

    def describe(self):
        """What depends on the kind: "Other", {"Range": {"min_m", "max_m"}}, or what `pinhole` returns."""
        return "Other"

    def most_bytes(self):
        """The longest list of items in one of its messages, bytes."""
        return 0

    def info(self):
        """What behaviors are told about it."""
        times = {"period_s": self.period_ms * 1e-3, "latency_s": self.latency_ms * 1e-3}
        return {"name": self.name, "message": self.message.NAME, **times, "kind": self.describe()}

    def is_due(self, now_ns):
        """Whether it measures at `now_ns`: once each period, from zero on. Ask once an instant."""
        turn = now_ns // int(self.period_ms * 1e6)
        due = turn != getattr(self, "_turn", None)
        self._turn = turn
        return due


class Drive:
    """A kind of drive: derive from this class, name its parameters as attributes."""

    kind = "differential"
    axes = Axes.LINEAR | Axes.ANGULAR

    def __init__(self, parameters):
        self.parameters = parameters


class Driver:
    """Derive from this class, list the kinds of `sensors` and `drives`, name parameters as attributes, override `poll`, `apply`.

    With `clock = "driver"` in the robot file time advances by this driver's steps of `step_ns`, and as fast as `pace` says: 1 is
    real time, None as fast as everybody follows.
    """

    name = ""
    sensors = ()
    drives = ()
    pace = None

    def __init__(self, setup):
        self.setup = setup
        self.parameters = setup.parameters

    def poll(self, now_ns):
        """Publishes everything that is due up to `now_ns`; returns when to come back, nanoseconds."""
        raise NotImplementedError

    def apply(self, command, now_ns):
        """Obeys the newest command; None where none has come since the last call. Without commands it brakes by itself."""

    def publish(self, sensor, header, items=b""):
        """Publishes what `sensor` measured."""
        self.setup.publish(sensor.name, header, items)

    def tell_truth(self, truth):
        """What a simulator knows and no robot can: for judging a run only."""
        self.setup.publish(TRUTH_TOPIC, truth, b"")

    @classmethod
    def description(cls, protocol):
        """What it is, for whoever composes it."""
        sensor = lambda kind: {
            "kind": kind.kind,
            "summary": summary_of(kind),
            "message": kind.message.NAME,
            "parameters": schema_of(kind),
        }
        drive = lambda kind: {
            "kind": kind.kind,
            "summary": summary_of(kind),
            "axes": words_of(kind.axes),
            "parameters": schema_of(kind),
        }
        return {
            "protocol": protocol,
            "name": cls.name,
            "summary": summary_of(cls),
            "parameters": schema_of(cls),
            "sensors": [sensor(kind) for kind in cls.sensors],
            "drives": [drive(kind) for kind in cls.drives],
        }

    @classmethod
    def sensor(cls, name, kind, parameters):
        """The sensor of this name."""
        return next(known for known in cls.sensors if known.kind == kind)(name, parameters)

    @classmethod
    def answer(cls, question):
        """What behaviors are told about a sensor of the robot file, or why it cannot be."""
        try:
            sensor = cls.sensor(question["name"], question["kind"], question["table"])
            return {"sensor": {"info": sensor.info(), "most_bytes": sensor.most_bytes()}}
        except ValueError as error:
            return {"refused": {"key": getattr(error, "key", ""), "problem": str(error)}}


class DeviceSetup:
    """What a driver is told when it is opened."""

    def __init__(self, name="device", parameters=None, sensors=(), drive=None, robot=None, folder=".", seed=1, step_ns=0, publish=None):
        #: Its name in the robot file.
        self.name = name
        #: The keys of its table that the file says.
        self.parameters = parameters or {}
        #: Its sensors, instances of the driver's kinds.
        self.sensors = list(sensors)
        #: Its drive; None where another device has it.
        self.drive = drive
        #: Name, radius and limits of the robot.
        self.robot = robot or {}
        #: Relative paths start here.
        self.folder = folder
        #: Of everything that is drawn by chance.
        self.seed = seed
        #: One step of its clock, where that counts.
        self.step_ns = step_ns
        self.publish = publish or (lambda name, header, items: None)


def pinhole(width, height, fov_deg, z_m, tilt_deg=0.0, pan_deg=0.0, x_m=0.0, y_m=0.0):
    """A camera with square pixels: size (px), horizontal field of view across the whole width, place and attitude on the robot."""
    focal = width / 2 / math.tan(math.radians(fov_deg) / 2)
    intrinsics = {"fx": focal, "fy": focal, "cx": (width - 1) / 2, "cy": (height - 1) / 2, "width": width, "height": height}
    mount = {"x": x_m, "y": y_m, "z": z_m, "pan": math.radians(pan_deg), "tilt": math.radians(tilt_deg), "roll": 0.0}
    distortion = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "k3": 0.0}
    return {"Camera": {"intrinsics": intrinsics, "distortion": distortion, "mount": mount, "calibrated": "measured"}}
