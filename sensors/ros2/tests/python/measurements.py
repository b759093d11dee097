"""Every kind of measurement in both directions: what a robot on ROS 2 publishes, and what the run publishes for others."""

import math
import os
import threading
import time

import rclpy.time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, Imu, LaserScan, Range
from std_msgs.msg import Bool, String

from foreign_types import Cdr
from live_run import Program
from middleware import create_node, foreign_type, spin

ROBOT = """
name = "robot"
[footprint]
radius_m = 0.2
[devices.base]
driver = "ros2"
deadline_ms = 20000
[sensors.color]
device = "base"
kind = "camera"
topic = "/color"
camera_info = "/color_info"
intrinsics = {{ width = 160, height = 120, fov_deg = 60 }}
mount = {{ z_m = 0.3 }}
max_age_ms = 5000
[sensors.gray]
device = "base"
kind = "camera"
topic = "/gray"
camera_info = "/gray_info"
intrinsics = {{ width = 640, height = 480, fx = 500, cx = 319.5, cy = 239.5 }}
mount = {{ z_m = 0.3 }}
max_age_ms = 5000
[sensors.single]
device = "base"
kind = "range"
topic = "/sonar"
x_m = 0.1
yaw_deg = 90
max_age_ms = 5000
[sensors.laser]
device = "base"
kind = "range"
topic = "/scan"
max_age_ms = 5000
[sensors.turn]
device = "base"
kind = "imu"
topic = "/imu"
max_age_ms = 5000
[sensors.switch]
device = "base"
kind = "bumper"
topic = "/bumper"
max_age_ms = 5000
[sensors.hazards]
device = "base"
kind = "bumper"
topic = "/hazard_detection"
max_age_ms = 5000
[sensors.bump]
device = "base"
kind = "bumper"
topic = "/bump"
max_age_ms = 5000
[drive]
device = "base"
kind = "twist"
"""

TASK = """
robot = "robot.toml"
[behaviors.joy]
ros2_twist = "/cmd_vel_joy"
priority = 100
"""


CONFIGS = os.path.realpath(os.path.join(os.path.dirname(__file__), "../../../../configs"))


class Measuring:
    """A robot that publishes every kind of measurement at 15 Hz. `now` gives its time, ns."""

    def __init__(self, now=None):
        self.node = create_node("robot")
        self.now = now or (lambda: self.node.get_clock().now().nanoseconds)
        self.delay_ns = 0
        publisher = self.node.create_publisher
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.color = publisher(Image, "/color", best_effort)
        self.color_info = publisher(CameraInfo, "/color_info", 5)
        self.gray = publisher(Image, "/gray", best_effort)
        self.gray_info = publisher(CameraInfo, "/gray_info", 5)
        self.single = publisher(Range, "/sonar", 5)
        self.scan = publisher(LaserScan, "/scan", best_effort)
        self.imu = publisher(Imu, "/imu", best_effort)
        self.switch = publisher(Bool, "/bumper", 5)
        self.hazards = publisher(foreign_type("irobot_create_msgs", "HazardDetectionVector"), "/hazard_detection", best_effort)
        self.bump = publisher(foreign_type("neato2_interfaces", "Bump"), "/bump", 5)
        # Published once, before the run starts.
        publisher(foreign_type("tf2_msgs", "TFMessage"), "/tf_static", latched).publish(frames())
        self.published = 0
        self.is_paused = False
        self.node.create_timer(1.0 / 15.0, self.measure)
        spin(self.node)

    def stamp(self):
        return rclpy.time.Time(nanoseconds=self.now() - self.delay_ns).to_msg()

    def measure(self):
        if self.is_paused:
            return
        stamp = self.stamp()
        self.published += 1
        # Red, and a ramp whose rows have a margin.
        color = Image(height=120, width=160, encoding="rgb8", step=480, data=bytes([200, 0, 0]) * (160 * 120))
        gray = Image(height=480, width=640, encoding="mono8", step=704, data=(bytes(range(256)) * 3)[:704] * 480)
        single = Range(field_of_view=0.4, min_range=0.05, max_range=3.0, range=1.25)
        scan = LaserScan(angle_min=-1.0, angle_increment=0.01, range_min=0.1, range_max=8.0)
        scan.ranges = [2.0] * 100 + [math.inf] + [4.0] * 100
        scan.header.frame_id = "laser"
        imu = Imu()
        imu.angular_velocity.z, imu.linear_acceleration.z = 0.25, 9.81
        for publisher, message in [(self.color, color), (self.gray, gray), (self.single, single), (self.scan, scan),
                                   (self.imu, imu)]:
            message.header.stamp = stamp
            publisher.publish(message)
        self.switch.publish(Bool(data=True))
        vector = Cdr().header(stamp, "base_link").number("I", 2)
        vector.header(stamp, "bump_front_left").number("B", 1).header(stamp, "cliff_side_left").number("B", 2)
        self.hazards.publish(vector.bytes())
        self.bump.publish(Cdr().number("B", 0).number("B", 1).number("B", 0).number("B", 0).bytes())
        self.color_info.publish(calibrated(160, 120, 138.56))
        self.gray_info.publish(calibrated(640, 480, 610.0))


def calibrated(width, height, focal):
    info = CameraInfo(width=width, height=height, distortion_model="plumb_bob", d=[0.0] * 5)
    info.k = [focal, 0.0, (width - 1) / 2, 0.0, focal, (height - 1) / 2, 0.0, 0.0, 1.0]
    return info


def frames():
    """The lidar 0.2 m ahead of the plate and turned by 90 degrees to the left; the plate 0.1 m behind the center."""
    stamp = rclpy.time.Time(nanoseconds=0).to_msg()
    message = Cdr().number("I", 2)
    half = math.sqrt(0.5)
    for parent, child, x, turn in [("plate", "laser", 0.2, (half, half)), ("base_link", "plate", -0.1, (0.0, 1.0))]:
        message.header(stamp, parent).text(child)
        for number in [x, 0.0, 0.05, 0.0, 0.0, *turn]:
            message.number("d", number)
    return message.bytes()


def near(value, expected, tolerance=1e-3):
    assert abs(value - expected) <= tolerance, (value, expected)


def sensors(program, folder):
    """Each kind of measurement arrives with its values."""
    robot, run = Measuring(), Program(program, folder, task=TASK, robot=ROBOT)
    run.wait_for_text("subscribed", "/bump`", timeout=60.0)
    echo = lambda name: run.topic("echo", f"sensors/{name}", "--once", "--full")
    color = echo("color")
    assert (color["width"], color["height"], color["encoding_text"]) == (160, 120, "gray8"), color
    single, laser = echo("single"), echo("laser")
    [beam] = single["items"]
    near(beam["range_m"], 1.25), near(beam["azimuth_rad"], math.pi / 2), near(beam["x_m"], 0.1), near(beam["cone_rad"], 0.4)
    # Through both frames, without an echo where the range is infinite.
    beams = laser["items"]
    assert len(beams) == 201, len(beams)
    near(beams[0]["azimuth_rad"], math.pi / 2 - 1.0), near(beams[0]["x_m"], 0.1), near(beams[0]["range_m"], 2.0)
    near(beams[200]["azimuth_rad"], math.pi / 2 + 1.0), near(beams[200]["range_m"], 4.0)
    assert beams[100]["flags"] == 1 and beams[0]["flags"] == 0, beams[100]
    turn = echo("turn")
    near(turn["angular_velocity"][2], 0.25), near(turn["linear_acceleration"][2], 9.81)
    pressed = {name: echo(name)["pressed"] for name in ["switch", "hazards", "bump"]}
    assert pressed == {"switch": 1, "hazards": 0b100_0010, "bump": 0b10}, pressed
    logged = run.wait_for_text("the intrinsics of `gray` differ", "fx = 610.00")
    assert "intrinsics of `color`" not in run.text(), run.text()
    rates = {name: run.topic("hz", f"sensors/{name}", "--for", "4")["rate_hz"] for name in ["color", "gray", "laser"]}
    ages = {name: run.topic("latency", f"sensors/{name}", "--for", "2")["age_s"]["p50"] for name in ["color", "gray", "laser"]}
    run.end()
    assert rates["color"] > 5.0 and rates["laser"] > 5.0, rates
    return {"pressed": pressed, "logged": logged, "published_hz": 15, "arrived_hz": rates, "age_s": ages}


def clock(program, folder):
    """Stamps of a simulated time give the age, while it ticks; then the arrival counts."""
    begun, state = time.monotonic(), {"ticks": True}
    # Half of real time, from 1000 s on.
    now = lambda: int(1e9 * (1000.0 + 0.5 * (time.monotonic() - begun)))
    robot = Measuring(now)
    robot.delay_ns = 300_000_000
    ticker = robot.node.create_publisher(Clock, "/clock", QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))

    def tick():
        while True:
            if state["ticks"]:
                ticker.publish(Clock(clock=rclpy.time.Time(nanoseconds=now()).to_msg()))
            time.sleep(0.02)

    threading.Thread(target=tick, daemon=True).start()
    run = Program(program, folder, task=TASK, robot=ROBOT)
    logged = [run.wait_for_text("simulated time on /clock; this run stays in real time", timeout=60.0),
              run.wait_for_text("`/scan`", "simulated time on /clock")]
    age_s = run.topic("latency", "sensors/turn", "--for", "3")["age_s"]["p50"]
    assert 0.28 < age_s < 0.6, age_s
    state["ticks"] = False
    time.sleep(6.0)
    without_s = run.topic("latency", "sensors/turn", "--for", "3")["age_s"]["p50"]
    assert without_s < 0.2, without_s
    run.end()
    return {"logged": logged, "delay_s": 0.3, "age_s": age_s, "age_without_ticks_s": without_s}


def observer(program, folder):
    """Odometry, pose, path, decisions and diagnostics of a simulated robot on a map reach others."""
    node = create_node("observer")
    heard = {}
    for message_type, topic in [(Odometry, "odometry"), (PoseWithCovarianceStamped, "pose"), (Path, "path"), (String, "decision")]:
        node.create_subscription(message_type, f"/yamabico/{topic}", lambda message, topic=topic: heard.update({topic: message}), 5)
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: heard.update(diagnostics=message), 5)
    spin(node)
    with open(f"{CONFIGS}/hallway.toml") as file:
        task = file.read().replace('"robots/', f'"{CONFIGS}/robots/').replace('"maps/', f'"{CONFIGS}/maps/')
    task += '\n[behaviors.report]\nros2_publish = "/yamabico"\npriority = 1\n'
    run = Program(program, folder, robot=None, task=task)
    begun = time.monotonic()
    while len(heard) < 5:
        assert time.monotonic() - begun < 90.0, f"only {sorted(heard)}\n{run.text()}"
        time.sleep(0.1)
    run.end()
    pose, path = heard["pose"], heard["path"]
    age_s = (node.get_clock().now() - rclpy.time.Time.from_msg(pose.header.stamp)).nanoseconds * 1e-9
    assert pose.header.frame_id == path.header.frame_id == "map" and -0.1 < age_s < 15.0, age_s
    covariance = [pose.pose.covariance[i] for i in (0, 7, 35)]
    assert all(0.0 < variance < 1.0 for variance in covariance), covariance
    last = path.poses[-1].pose.position
    near(last.x, 12.5), near(last.y, 0.0)
    names = sorted(status.name for status in heard["diagnostics"].status)
    return {"pose_x_m": pose.pose.pose.position.x, "corners_of_the_path": len(path.poses), "diagnostics": len(names)}
