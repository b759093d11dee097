"""The interface of a driver: sensors, a drive, or a whole simulator."""

import math

from .behavior import axes_text, declared, summary_of
from .messages import TRUTH_TOPIC, Axes, Odometry
from .parameters import Number, schema_of


class Sensor:
    """Base class of a kind of sensor: declare its parameters as class attributes.

    `kind` is the name in robot files, `message` the class of its messages. Every sensor has the parameters `period_ms` and
    `latency_ms`.
    """

    kind = ""
    message = Odometry

    period_ms = Number("Time between measurements.", 1, 10000, default=50)
    latency_ms = Number("Time from a measurement to its delivery.", 0, 10000, default=0)

    def __init__(self, name, parameters):
        self.name, self.parameters = name, parameters

    def describe(self):
        """Returns the properties of the sensor: "Other", {"Range": {"min_m": ..., "max_m": ...}}, or the result of `pinhole`."""
        return "Other"

    def max_item_bytes(self):
        """Returns the maximum size of the item list of one message, bytes."""
        return self.most_bytes()

    def most_bytes(self):
        """Former name of `max_item_bytes`, which drivers may still override."""
        return 0

    def info(self):
        """Returns the description that behaviors receive."""
        times = {"period_s": self.period_ms * 1e-3, "latency_s": self.latency_ms * 1e-3}
        return {"name": self.name, "message": self.message.NAME, **times, "kind": self.describe()}

    def is_due(self, now_ns):
        """Returns true if a measurement is due at `now_ns`: once per period, beginning at zero. Call it once per time step."""
        period = now_ns // int(self.period_ms * 1e6)
        due = period != getattr(self, "_last_period", None)
        self._last_period = period
        return due


class Drive:
    """Base class of a kind of drive: declare its parameters as class attributes."""

    kind = "differential"
    axes = Axes.LINEAR | Axes.ANGULAR

    def __init__(self, parameters):
        self.parameters = parameters


class Driver:
    """Base class of drivers: list the kinds of `sensors` and `drives`, declare parameters as class attributes, and override `poll`

    and `apply`.

    With `clock = "driver"` in the robot file, time advances in this driver's steps of `setup.step_ns`. `pace` is the ratio of its
    clock to real time; None is as fast as possible.
    """

    name = ""
    sensors = ()
    drives = ()
    pace = None

    def __init__(self, setup):
        self.setup = setup
        self.parameters = setup.parameters

    def poll(self, now_ns):
        """Publishes all measurements due up to `now_ns`, and returns the time at which to poll again, ns."""
        raise NotImplementedError

    def apply(self, command, now_ns):
        """Applies the newest command, or None if none has arrived since the last call. Must brake by itself without commands."""

    def publish(self, sensor, header, items=b""):
        """Publishes a measurement of `sensor`."""
        self.setup.publish(sensor.name, header, items)

    def publish_truth(self, truth):
        """Publishes the ground truth of a simulator, which is used to score a run only."""
        self.setup.publish(TRUTH_TOPIC, truth, b"")

    #: Former name of `publish_truth`.
    tell_truth = publish_truth

    @classmethod
    def description(cls, protocol):
        """Returns the description of the driver for `yamabico check` and `yamabico describe`."""
        sensor = lambda kind: {
            "kind": kind.kind,
            "summary": summary_of(kind),
            "message": kind.message.NAME,
            **declared(kind.message),
            "parameters": schema_of(kind),
        }
        drive = lambda kind: {
            "kind": kind.kind,
            "summary": summary_of(kind),
            "axes": axes_text(kind.axes),
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
        """Creates the sensor `name`."""
        return next(known for known in cls.sensors if known.kind == kind)(name, parameters)

    @classmethod
    def answer(cls, question):
        """Answers a query about a sensor in the robot file: its description, or the reason why it is invalid."""
        try:
            sensor = cls.sensor(question["name"], question["kind"], question["table"])
            return {"sensor": {"info": sensor.info(), "max_item_bytes": sensor.max_item_bytes()}}
        except ValueError as error:
            return {"refused": {"key": getattr(error, "key", ""), "problem": str(error)}}


class DeviceSetup:
    """Context in which a driver is opened."""

    def __init__(self, name="device", parameters=None, sensors=(), drive=None, robot=None, folder=".", seed=1, step_ns=0, publish=None):
        #: Name of the device in the robot file.
        self.name = name
        #: Parameters set in the robot file.
        self.parameters = parameters or {}
        #: Sensors: instances of the driver's kinds.
        self.sensors = list(sensors)
        #: Drive; None if another device has it.
        self.drive = drive
        #: Name, radius and limits of the robot, from the robot file.
        self.robot = robot or {}
        #: Folder against which relative paths are resolved.
        self.folder = folder
        #: Seed of all random numbers.
        self.seed = seed
        #: Step of the driver's clock, ns.
        self.step_ns = step_ns
        self.publish = publish or (lambda name, header, items: None)


def pinhole(width, height, fov_deg, z_m, tilt_deg=0.0, pan_deg=0.0, x_m=0.0, y_m=0.0):
    """Describes a camera with square pixels: size (px), horizontal field of view across the whole width, and mount on the robot."""
    focal = width / 2 / math.tan(math.radians(fov_deg) / 2)
    intrinsics = {"fx": focal, "fy": focal, "cx": (width - 1) / 2, "cy": (height - 1) / 2, "width": width, "height": height}
    mount = {"x": x_m, "y": y_m, "z": z_m, "pan": math.radians(pan_deg), "tilt": math.radians(tilt_deg), "roll": 0.0}
    distortion = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0, "k3": 0.0}
    return {"Camera": {"intrinsics": intrinsics, "distortion": distortion, "mount": mount, "calibrated": "measured"}}
