"""The messages of Yamabico as they lie in shared memory, and the words that their codes stand for.

Written by `cargo run -p yamabico-core --example python_messages`; not to be edited.
"""

import ctypes
from enum import IntEnum, IntFlag

from .structure import Item, Message, text

PROTOCOL = 1
NO_ECHO = 1
COMMAND_TOPIC = "command"
TRUTH_TOPIC = "truth"
CLOCK_TOPIC = "clock"
TURNS_TOPIC = "clock/turns"
TAKEN_TOPIC = "clock/taken"
HEARTBEATS_TOPIC = "plugins/heartbeats"
CALLS_TOPIC = "plugins/calls"
FAILURES_TOPIC = "plugins/failures"
MEMORIES_TOPIC = "plugins/memories"
DECISION_TOPIC = "decision"
RETUNE_TOPIC = "plugins/retune"
RETUNED_TOPIC = "plugins/retuned"


class Axes(IntFlag):
    """Axes of motion in the robot frame."""

    LINEAR = 1
    LATERAL = 2
    ANGULAR = 4


class Encoding(IntEnum):
    """How the bytes of a frame are to be read."""

    GRAY8 = 1
    RGB8 = 2


class Kind(IntEnum):
    """What a proposal asks for."""

    ABSTAIN = 0
    DRIVE = 1
    LIMIT = 2
    HALT = 3


class Reason(IntEnum):
    """Why a behavior proposes what it does."""

    NONE = 0
    NOMINAL = 1
    CLEAR = 2
    ECHO = 3
    NO_INPUT = 4
    STALE_INPUT = 5
    MALFORMED_INPUT = 6
    SONAR_STALE = 7
    OVERFLOW = 8
    PANICKED = 9
    COASTING = 10
    SEARCHING = 11
    TOO_FEW_SEGMENTS = 20
    NO_VANISHING_POINT = 21
    DEGENERATE = 22
    AMBIGUOUS = 23
    HEADING_LOST = 24
    ONE_WALL_LEFT = 25
    ONE_WALL_RIGHT = 26
    NO_WALL = 27
    EDGE_ON = 28
    NO_HEIGHT_CALIBRATION = 29
    NO_PARALLAX = 30
    NEGATIVE_HEIGHT = 31
    ONE_SIDED = 32
    FLAT_TEMPLATE = 33
    LOW_CORRELATION = 34
    INTERSECTION_LOST = 35
    TOO_FEW_MATCHES = 36
    GATED = 37
    OVER_CONFIDENT = 38
    INCONSISTENT = 39
    LOST = 40
    TOO_OLD = 41
    OUT_OF_ORDER = 42
    NO_THRESHOLD = 43
    LOW_RECALL = 44
    NO_MODEL = 45
    MIS_REGISTERED = 46
    PASSAGE_BLOCKED = 47
    LOW_CONTRAST = 48
    FLOOR_MODEL_BROKEN = 49
    WALL_NEAR = 50


class PoseStatus(IntEnum):
    """How far a pose can be trusted."""

    UNKNOWN = 0
    TRACKING = 1
    COASTING = 2
    INCONSISTENT = 3
    LOST = 4


class PluginState(IntEnum):
    """How a plugin fares."""

    STARTING = 0
    RUNNING = 1
    SLEEPING = 2
    DISABLED = 3
    FAILED = 4
    ENDED = 5


class TurnPhase(IntEnum):
    """What a turn of a step is for."""

    COLLECT = 0
    PROPOSE = 1
    DONE = 2


class Mode(IntEnum):
    """The arbiter's state at a decision."""

    DRIVING = 0
    IDLE = 1
    HALTED = 2
    CRITICAL_SILENT = 3
    EMERGENCY_STOP = 4
    SHUTTING_DOWN = 5


class Outcome(IntEnum):
    """What became of a proposal."""

    SILENT = 0
    ABSTAINED = 1
    WON = 2
    WON_PART = 3
    BLENDED = 4
    LIMITING = 5
    LIMIT_ELSEWHERE = 6
    HALTING = 7
    HELD = 8
    DISABLED = 20
    STALE = 21
    STALE_EVIDENCE = 22
    FROM_THE_FUTURE = 23
    MALFORMED = 24
    INHIBITED = 25
    SUPPRESSED = 26
    OUT_RANKED = 27
    GAVE_UP = 28
    WAITING = 29
    STOPPED = 30


class ControlKind(IntEnum):
    """What somebody asks of a running robot."""

    ENABLE = 1
    DISABLE = 2
    RETUNE = 3
    EMERGENCY_STOP = 4
    RESET = 5
    GOAL = 6


class RetuneStep(IntEnum):
    """How far a change of parameters is."""

    PREPARE = 1
    APPLY = 2
    DROP = 3


class Retuning(IntEnum):
    """What became of a change of parameters."""

    READY = 1
    REFUSED = 2
    APPLIED = 3


class FrameHeader(Message):
    """A picture; the pixels follow, row by row, stride bytes from one row to the next."""

    _fields_ = [
        # Middle of the exposure.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a picture.
        ("sequence", ctypes.c_uint64),
        # Pixels in a row.
        ("width", ctypes.c_uint32),
        # Rows.
        ("height", ctypes.c_uint32),
        # Bytes from one row to the next.
        ("stride", ctypes.c_uint32),
        # An Encoding code.
        ("encoding", ctypes.c_uint32),
        # Exposure time times gain, relative to the camera's nominal one.
        ("exposure", ctypes.c_double),
    ]
    NAME = "yamabico.FrameHeader.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(FrameHeader) == 40 and ctypes.alignment(FrameHeader) == 8


class Beam(Item):
    """One direction of a range scan."""

    _fields_ = [
        # Direction of the axis in the robot frame, radians, left positive.
        ("azimuth_rad", ctypes.c_double),
        # Full opening angle, radians.
        ("cone_rad", ctypes.c_double),
        # Distance from the sensor, meters; without meaning where NO_ECHO is set.
        ("range_m", ctypes.c_double),
        # Position of the sensor in the robot frame, forward, meters.
        ("x_m", ctypes.c_double),
        # Position of the sensor in the robot frame, left, meters.
        ("y_m", ctypes.c_double),
        # NO_ECHO or zero.
        ("flags", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]


assert ctypes.sizeof(Beam) == 48


class RangeScanHeader(Message):
    """Ranges taken together; the beams follow."""

    _fields_ = [
        # When the echoes were awaited.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a scan.
        ("sequence", ctypes.c_uint64),
        # Nearest range that the sensor can tell, meters.
        ("min_m", ctypes.c_double),
        # Farthest range that the sensor can tell, meters.
        ("max_m", ctypes.c_double),
    ]
    NAME = "yamabico.RangeScanHeader.v1"
    CHANNEL = "stream"
    ITEM = Beam


assert ctypes.sizeof(RangeScanHeader) == 32 and ctypes.alignment(RangeScanHeader) == 8


class Odometry(Message):
    """Where the wheels say the robot is: odom frame, never jumps."""

    _fields_ = [
        # When the encoders were read.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a reading.
        ("sequence", ctypes.c_uint64),
        # Forward from the start, meters.
        ("x", ctypes.c_double),
        # Left from the start, meters.
        ("y", ctypes.c_double),
        # Heading, radians, left positive, in (-pi, pi].
        ("theta", ctypes.c_double),
        # Speed forward, m/s, robot frame.
        ("vx", ctypes.c_double),
        # Speed to the left, m/s, robot frame.
        ("vy", ctypes.c_double),
        # Turn rate, rad/s, left positive.
        ("omega", ctypes.c_double),
        # Of (x, y, theta), row by row.
        ("covariance", (ctypes.c_double) * 9),
    ]
    NAME = "yamabico.Odometry.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Odometry) == 136 and ctypes.alignment(Odometry) == 8


class Imu(Message):
    """Turn rates and accelerations in the robot frame."""

    _fields_ = [
        # When it was read.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a reading.
        ("sequence", ctypes.c_uint64),
        # About x, y and z, rad/s.
        ("angular_velocity", (ctypes.c_double) * 3),
        # Along x, y and z, m/s^2, gravity included.
        ("linear_acceleration", (ctypes.c_double) * 3),
        # About x, radians; NaN where the device tells none.
        ("roll", ctypes.c_double),
        # About y, radians, down positive; NaN where the device tells none.
        ("pitch", ctypes.c_double),
    ]
    NAME = "yamabico.Imu.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Imu) == 80 and ctypes.alignment(Imu) == 8


class Bumper(Message):
    """Which bumpers are pressed."""

    _fields_ = [
        # When they were read.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a reading.
        ("sequence", ctypes.c_uint64),
        # A bit a bumper, lowest first.
        ("pressed", ctypes.c_uint64),
    ]
    NAME = "yamabico.Bumper.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Bumper) == 24 and ctypes.alignment(Bumper) == 8


class Clock(Message):
    """The time of a run whose clock is not the machine's."""

    _fields_ = [
        # The instant that began.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a step.
        ("step", ctypes.c_uint64),
    ]
    NAME = "yamabico.Clock.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Clock) == 16 and ctypes.alignment(Clock) == 8


class Turn(Message):
    """A turn of a step of a run whose clock is not the machine's: the arbiter calls it, and whoever has taken it says so."""

    _fields_ = [
        # The instant of the step.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a turn called or taken.
        ("sequence", ctypes.c_uint64),
        # That of the Clock.
        ("step", ctypes.c_uint64),
        # Who has taken it; empty where it is called.
        ("_plugin", ctypes.c_char * 32),
        # A TurnPhase code.
        ("phase", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    plugin = text("_plugin")
    NAME = "yamabico.Turn.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Turn) == 64 and ctypes.alignment(Turn) == 8


class Truth(Message):
    """What a simulator knows and no robot can: for judging a run only. No behavior may take it as an input."""

    _fields_ = [
        # The instant that it describes.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Map frame, meters.
        ("x", ctypes.c_double),
        # Map frame, meters.
        ("y", ctypes.c_double),
        # Map frame, radians in (-pi, pi].
        ("theta", ctypes.c_double),
        # Speed forward, m/s.
        ("vx", ctypes.c_double),
        # Speed to the left, m/s.
        ("vy", ctypes.c_double),
        # Turn rate, rad/s.
        ("omega", ctypes.c_double),
        # Path length since the start, meters.
        ("distance_m", ctypes.c_double),
        # From the footprint to the nearest thing, meters; negative inside it.
        ("clearance_m", ctypes.c_double),
        # From the footprint to the nearest person, meters; infinite without people.
        ("person_m", ctypes.c_double),
        # Times that the robot's own motion touched something.
        ("contacts", ctypes.c_uint32),
        # Times that a person walked into the standing robot.
        ("struck", ctypes.c_uint32),
    ]
    NAME = "yamabico.Truth.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Truth) == 96 and ctypes.alignment(Truth) == 8


class Goal(Message):
    """Where to go: a pose in the map frame."""

    _fields_ = [
        # When it was given.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a goal.
        ("sequence", ctypes.c_uint64),
        # Meters.
        ("x", ctypes.c_double),
        # Meters.
        ("y", ctypes.c_double),
        # Radians; NaN where any heading will do.
        ("theta", ctypes.c_double),
        # Reached within this distance, meters.
        ("tolerance_m", ctypes.c_double),
    ]
    NAME = "yamabico.Goal.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(Goal) == 48 and ctypes.alignment(Goal) == 8


class PathPoint(Item):
    """A corner of a path, map frame."""

    _fields_ = [
        # Meters.
        ("x", ctypes.c_double),
        # Meters.
        ("y", ctypes.c_double),
    ]


assert ctypes.sizeof(PathPoint) == 16


class PathHeader(Message):
    """A planned path and where the robot stands on it; the points follow."""

    _fields_ = [
        # The instant that the errors hold for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Robot left of the path, meters.
        ("lateral_error_m", ctypes.c_double),
        # Robot heading less path heading, radians.
        ("heading_error_rad", ctypes.c_double),
        # Path length behind the robot, meters.
        ("progress_m", ctypes.c_double),
    ]
    NAME = "yamabico.PathHeader.v1"
    CHANNEL = "latest"
    ITEM = PathPoint


assert ctypes.sizeof(PathHeader) == 48 and ctypes.alignment(PathHeader) == 8


class Pose(Message):
    """Where the robot is on the map."""

    _fields_ = [
        # The instant that it holds for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a pose.
        ("sequence", ctypes.c_uint64),
        # Meters.
        ("x", ctypes.c_double),
        # Meters.
        ("y", ctypes.c_double),
        # Radians in (-pi, pi].
        ("theta", ctypes.c_double),
        # Of (x, y, theta), row by row.
        ("covariance", (ctypes.c_double) * 9),
        # A PoseStatus code.
        ("status", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    NAME = "yamabico.Pose.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(Pose) == 128 and ctypes.alignment(Pose) == 8


class Obstacle(Item):
    """An obstacle in the robot frame."""

    _fields_ = [
        # Forward, meters.
        ("x", ctypes.c_double),
        # Left, meters.
        ("y", ctypes.c_double),
        # Meters.
        ("radius_m", ctypes.c_double),
        # Of (x, y), row by row.
        ("covariance", (ctypes.c_double) * 4),
        # 0 to 1.
        ("confidence", ctypes.c_double),
    ]


assert ctypes.sizeof(Obstacle) == 64


class ObstaclesHeader(Message):
    """Things that the map does not explain; the obstacles follow."""

    _fields_ = [
        # The instant that it holds for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
    ]
    NAME = "yamabico.ObstaclesHeader.v1"
    CHANNEL = "latest"
    ITEM = Obstacle


assert ctypes.sizeof(ObstaclesHeader) == 24 and ctypes.alignment(ObstaclesHeader) == 8


class FreeDirection(Item):
    """Free floor in one direction, robot frame."""

    _fields_ = [
        # Left positive, radians.
        ("azimuth_rad", ctypes.c_double),
        # Meters from the robot's center.
        ("distance_m", ctypes.c_double),
    ]


assert ctypes.sizeof(FreeDirection) == 16


class FreeSpaceHeader(Message):
    """How far the floor is free in each direction; the directions follow, from right to left."""

    _fields_ = [
        # The instant that it holds for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
    ]
    NAME = "yamabico.FreeSpaceHeader.v1"
    CHANNEL = "latest"
    ITEM = FreeDirection


assert ctypes.sizeof(FreeSpaceHeader) == 24 and ctypes.alignment(FreeSpaceHeader) == 8


class Landmark(Item):
    """A landmark seen from the robot."""

    _fields_ = [
        # Number on the map; u64::MAX where it is not known.
        ("id", ctypes.c_uint64),
        # Left positive, radians.
        ("azimuth_rad", ctypes.c_double),
        # Standard deviation, radians.
        ("sigma_rad", ctypes.c_double),
        # Meters; NaN where only the bearing is known.
        ("range_m", ctypes.c_double),
    ]


assert ctypes.sizeof(Landmark) == 32


class LandmarksHeader(Message):
    """Bearings to landmarks; they follow."""

    _fields_ = [
        # The instant that it holds for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
    ]
    NAME = "yamabico.LandmarksHeader.v1"
    CHANNEL = "latest"
    ITEM = Landmark


assert ctypes.sizeof(LandmarksHeader) == 24 and ctypes.alignment(LandmarksHeader) == 8


class Intersection(Message):
    """The intersection ahead."""

    _fields_ = [
        # The instant that it holds for.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it.
        ("evidence_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Of its middle, left positive, radians.
        ("bearing_rad", ctypes.c_double),
        # To its nearer end, meters.
        ("distance_m", ctypes.c_double),
        # Standard deviation of the distance, meters.
        ("sigma_m", ctypes.c_double),
    ]
    NAME = "yamabico.Intersection.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(Intersection) == 48 and ctypes.alignment(Intersection) == 8


class Twist(Item):
    """A planar velocity in the robot frame."""

    _fields_ = [
        # Forward, m/s.
        ("linear", ctypes.c_double),
        # To the left, m/s.
        ("lateral", ctypes.c_double),
        # Turn rate, rad/s, left positive.
        ("angular", ctypes.c_double),
    ]


assert ctypes.sizeof(Twist) == 24


class Sector(Item):
    """A sector of directions of translation, robot frame."""

    _fields_ = [
        # Middle, left positive, radians.
        ("center_rad", ctypes.c_double),
        # Half width, radians; pi or more is every direction.
        ("half_width_rad", ctypes.c_double),
    ]


assert ctypes.sizeof(Sector) == 16


class Proposal(Message):
    """What one behavior proposes at one instant.

    Made with Proposal::drive, Proposal::limit, Proposal::halt or Proposal::abstain. The shell around the behavior fills in who proposes, the sequence, the stamp and the priority."""

    _fields_ = [
        # Who proposes; filled in by the shell.
        ("_behavior", ctypes.c_char * 32),
        # Counts up by one a proposal; filled in by the shell.
        ("sequence", ctypes.c_uint64),
        # The instant of the world's state that it rests on; the shell fills in "now" where it is zero.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data in it; the shell fills in "now" where it is zero.
        ("evidence_ns", ctypes.c_uint64),
        # When the behavior was handed what it rests on; filled in by the shell.
        ("received_ns", ctypes.c_uint64),
        # When it was sent; filled in by the shell.
        ("proposed_ns", ctypes.c_uint64),
        # From the task file, higher wins; filled in by the shell.
        ("priority", ctypes.c_int32),
        # A Kind code.
        ("kind", ctypes.c_uint32),
        # Claimed by a drive, stopped by a halt, limited by a limit.
        ("axes", ctypes.c_uint32),
        # Not zero: having lost one axis it gives up all.
        ("coupled", ctypes.c_uint32),
        # What a drive asks for.
        ("twist", Twist),
        # Largest magnitude that a limit allows on each of its axes, m/s, m/s, rad/s.
        ("limits", Twist),
        # Where a limit counts: only while the commanded translation points into it.
        ("sector", Sector),
        # 0 to 1, for blending.
        ("confidence", ctypes.c_double),
        # A Reason code.
        ("reason", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
        # The reason in words with numbers.
        ("_note", ctypes.c_char * 64),
    ]
    behavior = text("_behavior")
    note = text("_note")
    NAME = "yamabico.Proposal.v2"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(Proposal) == 232 and ctypes.alignment(Proposal) == 8


class Command(Message):
    """What the motors get."""

    _fields_ = [
        # When it was decided.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data behind it; the stamp itself where nothing was claimed.
        ("evidence_ns", ctypes.c_uint64),
        # When the behavior with the oldest data was handed it; this and the next two are zero where nothing was claimed.
        ("received_ns", ctypes.c_uint64),
        # When that behavior's proposal was sent.
        ("proposed_ns", ctypes.c_uint64),
        # When the arbiter took that proposal in.
        ("heard_ns", ctypes.c_uint64),
        # When it was sent.
        ("sent_ns", ctypes.c_uint64),
        # Counts up by one a command.
        ("sequence", ctypes.c_uint64),
        # Body twist, within the robot's limits.
        ("twist", Twist),
        # Not zero: brake with the emergency deceleration.
        ("emergency", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
        # Who won the linear, lateral and angular axis; empty where nobody claimed it.
        ("_source", (ctypes.c_char * 32) * 3),
    ]
    source = text("_source")
    NAME = "yamabico.Command.v2"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Command) == 184 and ctypes.alignment(Command) == 8


class Verdict(Item):
    """What became of one behavior in one decision."""

    _fields_ = [
        # The behavior.
        ("_behavior", ctypes.c_char * 32),
        # Who beat, inhibited, suppressed or halted it; empty where nobody.
        ("_by", ctypes.c_char * 32),
        # Its priority.
        ("priority", ctypes.c_int32),
        # An Outcome code.
        ("outcome", ctypes.c_uint32),
        # Claimed, limited or halted.
        ("claimed", ctypes.c_uint32),
        # Driven by it in the end.
        ("won", ctypes.c_uint32),
        # The number behind the outcome: age in seconds, the limit, or zero.
        ("number", ctypes.c_double),
        # The behavior's own Reason code.
        ("reason", ctypes.c_uint32),
        # A Kind code.
        ("kind", ctypes.c_uint32),
        # How long the outcome still lasts if nobody says a word: of what is held, inhibited, suppressed or waits, seconds; negative where until its author is back, zero elsewhere.
        ("left_s", ctypes.c_double),
        # What is wrong with its newest word, an Outcome code, though a halt or limit of it may count all the same; zero where nothing.
        ("fault", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    behavior = text("_behavior")
    by = text("_by")


assert ctypes.sizeof(Verdict) == 112


class DecisionHeader(Message):
    """A decision and why: a verdict on each behavior follows."""

    _fields_ = [
        # When it was decided.
        ("stamp_ns", ctypes.c_uint64),
        # Oldest sensor data behind the command.
        ("evidence_ns", ctypes.c_uint64),
        # That of the command.
        ("sequence", ctypes.c_uint64),
        # What the winners asked for, before limits and ramps.
        ("wanted", Twist),
        # What the robot's largest speeds and its drive leave of it.
        ("feasible", Twist),
        # The least limit in force on each axis, where it has a limiter.
        ("limit", Twist),
        # After halts and limits, before ramps.
        ("allowed", Twist),
        # What was commanded.
        ("commanded", Twist),
        # Axes that a halt stops.
        ("halted", ctypes.c_uint32),
        # The axes that the drive has.
        ("axes", ctypes.c_uint32),
        # A Mode code.
        ("mode", ctypes.c_uint32),
        # Not zero: some axis brakes with the emergency deceleration.
        ("emergency", ctypes.c_uint32),
        # Who won the linear, lateral and angular axis; empty where nobody claimed it.
        ("_source", (ctypes.c_char * 32) * 3),
        # Whose limit binds each axis; empty where nobody's.
        ("_limiter", (ctypes.c_char * 32) * 3),
        # Who halts each axis; empty where nobody.
        ("_halter", (ctypes.c_char * 32) * 3),
        # Why the mode is what it is, in words.
        ("_note", ctypes.c_char * 64),
    ]
    source = text("_source")
    limiter = text("_limiter")
    halter = text("_halter")
    note = text("_note")
    NAME = "yamabico.DecisionHeader.v2"
    CHANNEL = "stream"
    ITEM = Verdict


assert ctypes.sizeof(DecisionHeader) == 512 and ctypes.alignment(DecisionHeader) == 8


class Heartbeat(Message):
    """A plugin is alive."""

    _fields_ = [
        # When it was sent.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a heartbeat.
        ("sequence", ctypes.c_uint64),
        # Who is alive.
        ("_plugin", ctypes.c_char * 32),
        # A PluginState code.
        ("state", ctypes.c_uint32),
        # Times that it was started again.
        ("restarts", ctypes.c_uint32),
    ]
    plugin = text("_plugin")
    NAME = "yamabico.Heartbeat.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Heartbeat) == 56 and ctypes.alignment(Heartbeat) == 8


class FailureHeader(Message):
    """A plugin cannot do what it should. Its items are the reason in words, UTF-8."""

    _fields_ = [
        # When it failed.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a failure.
        ("sequence", ctypes.c_uint64),
        # Who failed.
        ("_plugin", ctypes.c_char * 32),
        # The key of its table to change, dotted; empty where none is to blame.
        ("_key", ctypes.c_char * 64),
    ]
    plugin = text("_plugin")
    key = text("_key")
    NAME = "yamabico.FailureHeader.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(FailureHeader) == 112 and ctypes.alignment(FailureHeader) == 8


class CallBucket(Item):
    """Calls of about the same duration."""

    _fields_ = [
        # Which bucket of the scale: below 32 so many ns; above, 32 equal steps to each doubling.
        ("index", ctypes.c_uint32),
        # How many calls.
        ("calls", ctypes.c_uint32),
    ]


assert ctypes.sizeof(CallBucket) == 8


class CallsHeader(Message):
    """How the calls of a behavior went since it was started. Wall-clock figures; the calls by duration follow."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a report.
        ("sequence", ctypes.c_uint64),
        # Whose calls.
        ("_plugin", ctypes.c_char * 32),
        # The longest call, ns.
        ("longest_ns", ctypes.c_uint64),
        # Calls that were longer than the budget.
        ("overruns", ctypes.c_uint64),
        # Calls that proposed nothing.
        ("abstentions", ctypes.c_uint64),
        # Calls that panicked.
        ("panics", ctypes.c_uint32),
        # Times that it had been started again: each start counts anew.
        ("restarts", ctypes.c_uint32),
    ]
    plugin = text("_plugin")
    NAME = "yamabico.CallsHeader.v1"
    CHANNEL = "latest"
    ITEM = CallBucket


assert ctypes.sizeof(CallsHeader) == 80 and ctypes.alignment(CallsHeader) == 8


class MemoryHeader(Message):
    """What the successor of a behavior must know to go on where that stopped. Its items are JSON."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Whose memory.
        ("_plugin", ctypes.c_char * 32),
    ]
    plugin = text("_plugin")
    NAME = "yamabico.MemoryHeader.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(MemoryHeader) == 48 and ctypes.alignment(MemoryHeader) == 8


class WallPoint(Item):
    """A corner of a wall."""

    _fields_ = [
        # Map frame, meters.
        ("x", ctypes.c_double),
        # Map frame, meters.
        ("y", ctypes.c_double),
        # Corners of one line follow each other and share its number.
        ("line", ctypes.c_uint64),
    ]


assert ctypes.sizeof(WallPoint) == 24


class WallsHeader(Message):
    """Walls that a device knows, for plots: polylines on the floor."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Who knows.
        ("_device", ctypes.c_char * 32),
    ]
    device = text("_device")
    NAME = "yamabico.WallsHeader.v1"
    CHANNEL = "latest"
    ITEM = WallPoint


assert ctypes.sizeof(WallsHeader) == 48 and ctypes.alignment(WallsHeader) == 8


class Process(Item):
    """The process of one plugin."""

    _fields_ = [
        # Whose.
        ("_plugin", ctypes.c_char * 32),
        # How its last process ended, in words; empty where none has.
        ("_ended", ctypes.c_char * 64),
        # What it last said went wrong, the beginning; empty where nothing did.
        ("_said", ctypes.c_char * 64),
        # When the last process ended.
        ("ended_ns", ctypes.c_uint64),
        # When it said what went wrong.
        ("said_ns", ctypes.c_uint64),
        # When the next one is started; zero where one runs.
        ("due_ns", ctypes.c_uint64),
        # Its number; zero where there is none.
        ("pid", ctypes.c_uint32),
        # A ProcessState code.
        ("state", ctypes.c_uint32),
        # Times that it was started again.
        ("restarts", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    plugin = text("_plugin")
    ended = text("_ended")
    said = text("_said")


assert ctypes.sizeof(Process) == 200


class ProcessesHeader(Message):
    """The processes of the plugins that have one, told whenever something changed."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
    ]
    NAME = "yamabico.ProcessesHeader.v2"
    CHANNEL = "latest"
    ITEM = Process


assert ctypes.sizeof(ProcessesHeader) == 16 and ctypes.alignment(ProcessesHeader) == 8


class RosterHeader(Message):
    """Who works on the robot and what they tell each other, once for those who join it. Its items are JSON."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
    ]
    NAME = "yamabico.RosterHeader.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(RosterHeader) == 16 and ctypes.alignment(RosterHeader) == 8


class Control(Message):
    """A request to a running robot. A malformed one is refused and told. Its items are the text of a retune."""

    _fields_ = [
        # When it was asked.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a request.
        ("sequence", ctypes.c_uint64),
        # Whom it concerns; empty where the whole robot.
        ("_target", ctypes.c_char * 32),
        # Why, in words.
        ("_note", ctypes.c_char * 64),
        # x, y, theta and tolerance of a goal: m, m, rad, m.
        ("goal", (ctypes.c_double) * 4),
        # A ControlKind code.
        ("kind", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    target = text("_target")
    note = text("_note")
    NAME = "yamabico.Control.v2"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(Control) == 152 and ctypes.alignment(Control) == 8


class RetuneHeader(Message):
    """The robot asks a behavior to change its parameters. Its items are all of them, TOML."""

    _fields_ = [
        # When it was asked.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Which change: every step of one has the same number.
        ("request", ctypes.c_uint64),
        # Who is to change.
        ("_behavior", ctypes.c_char * 32),
        # A RetuneStep code.
        ("step", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    behavior = text("_behavior")
    NAME = "yamabico.RetuneHeader.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(RetuneHeader) == 64 and ctypes.alignment(RetuneHeader) == 8


class RetunedHeader(Message):
    """What became of a change of parameters. Its items are words."""

    _fields_ = [
        # When it was told.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # Which change; of the robot's own answer, the stamp of what was asked.
        ("request", ctypes.c_uint64),
        # Who answers; empty where the robot for all of them.
        ("_behavior", ctypes.c_char * 32),
        # The key to change, dotted; empty where none is to blame.
        ("_key", ctypes.c_char * 64),
        # A Retuning code.
        ("outcome", ctypes.c_uint32),
        # Zero.
        ("reserved", ctypes.c_uint32),
    ]
    behavior = text("_behavior")
    key = text("_key")
    NAME = "yamabico.RetunedHeader.v1"
    CHANNEL = "stream"
    ITEM = None


assert ctypes.sizeof(RetunedHeader) == 128 and ctypes.alignment(RetunedHeader) == 8


class Stick(Message):
    """Where somebody holds the stick that drives the robot by hand: shares of the largest speeds."""

    _fields_ = [
        # When it was held there.
        ("stamp_ns", ctypes.c_uint64),
        # Counts up by one a message.
        ("sequence", ctypes.c_uint64),
        # -1 (backwards) to 1 (forward).
        ("forward", ctypes.c_double),
        # -1 (to the right) to 1 (to the left).
        ("left", ctypes.c_double),
        # -1 (clockwise) to 1 (counterclockwise).
        ("turn", ctypes.c_double),
    ]
    NAME = "yamabico.Stick.v1"
    CHANNEL = "latest"
    ITEM = None


assert ctypes.sizeof(Stick) == 40 and ctypes.alignment(Stick) == 8


#: Every message by its versioned name.
MESSAGES = {
    "yamabico.FrameHeader.v1": FrameHeader,
    "yamabico.RangeScanHeader.v1": RangeScanHeader,
    "yamabico.Odometry.v1": Odometry,
    "yamabico.Imu.v1": Imu,
    "yamabico.Bumper.v1": Bumper,
    "yamabico.Clock.v1": Clock,
    "yamabico.Turn.v1": Turn,
    "yamabico.Truth.v1": Truth,
    "yamabico.Goal.v1": Goal,
    "yamabico.PathHeader.v1": PathHeader,
    "yamabico.Pose.v1": Pose,
    "yamabico.ObstaclesHeader.v1": ObstaclesHeader,
    "yamabico.FreeSpaceHeader.v1": FreeSpaceHeader,
    "yamabico.LandmarksHeader.v1": LandmarksHeader,
    "yamabico.Intersection.v1": Intersection,
    "yamabico.Proposal.v2": Proposal,
    "yamabico.Command.v2": Command,
    "yamabico.DecisionHeader.v2": DecisionHeader,
    "yamabico.Heartbeat.v1": Heartbeat,
    "yamabico.FailureHeader.v1": FailureHeader,
    "yamabico.CallsHeader.v1": CallsHeader,
    "yamabico.MemoryHeader.v1": MemoryHeader,
    "yamabico.WallsHeader.v1": WallsHeader,
    "yamabico.ProcessesHeader.v2": ProcessesHeader,
    "yamabico.RosterHeader.v1": RosterHeader,
    "yamabico.Control.v2": Control,
    "yamabico.RetuneHeader.v1": RetuneHeader,
    "yamabico.RetunedHeader.v1": RetunedHeader,
    "yamabico.Stick.v1": Stick,
}
