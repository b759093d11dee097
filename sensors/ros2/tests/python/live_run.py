"""A base on ROS 2, the programs of its operators, and a live run beside them, for tests."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time

from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String

from middleware import ENVIRONMENT, create_node, init, spin

ROBOT = """
name = "robot"
[footprint]
radius_m = 0.2
[limits]
max_linear_mps = 0.5
max_angular_radps = 1.2
linear_acceleration_mps2 = 1.0
linear_deceleration_mps2 = 1.0
[devices.base]
driver = "ros2"
deadline_ms = 3000
[sensors.sonar]
device = "base"
kind = "range"
topic = "/scan"
x_m = 0.0
max_age_ms = 2000
{sonar}
[sensors.wheels]
device = "base"
kind = "odometry"
topic = "/odom"
max_age_ms = 2000
[drive]
device = "base"
kind = "twist"
"""

# The deadlines suit a machine that does something else besides.
TASK = """
robot = "robot.toml"
[behaviors.joy]
ros2_twist = "/cmd_vel_joy"
priority = 100
[behaviors.pause]
ros2_lock = "/pause"
timeout_ms = {lock_timeout_ms}
priority = 60
critical = true
[behaviors.web]
ros2_twist = "/cmd_vel_web"
priority = 50
[behaviors.nav2]
ros2_twist = "/cmd_vel_nav"
priority = 10
[behaviors.report]
ros2_publish = "/yamabico"
priority = 1
"""


class Base:
    """A base: publishes a scan and odometry at 20 Hz, and keeps the commands that it gets."""

    def __init__(self, stamped=False, durability=DurabilityPolicy.VOLATILE):
        self.node = create_node("base")
        self.commands = []
        self.decisions = []
        command = TwistStamped if stamped else Twist
        qos = QoSProfile(depth=10, durability=durability)
        self.node.create_subscription(command, "/cmd_vel", self.drive, qos)
        self.node.create_subscription(String, "/yamabico/decision", self.decide, 10)
        best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.scans = self.node.create_publisher(LaserScan, "/scan", best_effort)
        self.odometry = self.node.create_publisher(Odometry, "/odom", 10)
        self.node.create_timer(0.05, self.measure)
        spin(self.node)

    def drive(self, message):
        twist = message.twist if isinstance(message, TwistStamped) else message
        self.commands.append((time.monotonic(), twist.linear.x, twist.angular.z))

    def decide(self, message):
        self.decisions.append(json.loads(message.data))

    def measure(self):
        stamp = self.node.get_clock().now().to_msg()
        scan = LaserScan(angle_min=-3.14, angle_increment=6.28 / 720, range_min=0.1, range_max=10.0)
        scan.header.stamp = stamp
        scan.header.frame_id = "laser"
        scan.ranges = [5.0] * 720
        self.scans.publish(scan)
        odometry = Odometry()
        odometry.header.stamp = stamp
        odometry.pose.pose.orientation.w = 1.0
        self.odometry.publish(odometry)

    def wait_for(self, speed, timeout=30.0):
        """Seconds until a command of this speed."""
        begin = time.monotonic()
        while time.monotonic() - begin < timeout:
            at, linear, _ = self.commands[-1] if self.commands else (0.0, -1.0, 0.0)
            if at > begin and abs(linear - speed) < 0.005:
                return time.monotonic() - begin
            time.sleep(0.005)
        last = self.commands[-1] if self.commands else None
        raise AssertionError(f"no command of {speed} m/s within {timeout} s; the last: {last}")

    def gaps(self, begin):
        """Rate of the commands since a time, and the longest gap between two."""
        times = [at for at, _, _ in list(self.commands) if at >= begin]
        gaps = [b - a for a, b in zip(times, times[1:])]
        return len(times) / max(time.monotonic() - begin, 1e-9), max(gaps, default=float("inf"))


class Program:
    """A live run."""

    def __init__(self, program, folder, lock_timeout_ms=0.0, sonar="", task=TASK, robot=ROBOT):
        os.makedirs(folder, exist_ok=True)
        self.program = program
        self.name = f"ros2-{os.getpid()}-{Program.count}"
        Program.count += 1
        if robot:
            with open(f"{folder}/robot.toml", "w") as file:
                file.write(robot.format(sonar=sonar))
        with open(f"{folder}/task.toml", "w") as file:
            file.write(task.format(lock_timeout_ms=lock_timeout_ms) if robot else task)
        self.log = f"{folder}/log"
        arguments = [program, "run", f"{folder}/task.toml", "--set", f'robot.name="{self.name}"', "--live", "--no-overlays", "--overwrite", "--out", f"{folder}/out"]
        self.process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=open(self.log, "w"),
                                        env={**ENVIRONMENT, "ROS_DOMAIN_ID": os.environ["ROS_DOMAIN_ID"]}, preexec_fn=with_me)

    def text(self):
        with open(self.log) as file:
            return file.read()

    def wait_for_text(self, *words, timeout=30.0):
        begin = time.monotonic()
        while time.monotonic() - begin < timeout:
            lines = [line for line in self.text().splitlines() if all(word in line for word in words)]
            if lines:
                return lines[0]
            time.sleep(0.05)
        raise AssertionError(f"nothing with {words} on the log:\n{self.text()}")

    def topic(self, *arguments, timeout=60.0):
        """Last line that `yamabico topic` prints of this run, as JSON."""
        call = [self.program, "topic", *arguments, "--robot", self.name, "--json"]
        printed = subprocess.run(call, capture_output=True, text=True, timeout=timeout)
        assert printed.returncode == 0 and printed.stdout, f"{arguments}: {printed.stdout}{printed.stderr}\n{self.text()}"
        return json.loads(printed.stdout.splitlines()[-1])

    def plugin(self, argument):
        """Process of a plugin of this run, by its argument."""
        children = subprocess.run(["pgrep", "-P", str(self.process.pid)], capture_output=True, text=True)
        for pid in children.stdout.split():
            with open(f"/proc/{pid}/cmdline") as file:
                if argument in file.read().split("\0"):
                    return int(pid)
        raise AssertionError(f"no process {argument}")

    def end(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=15)


Program.count = 0


def with_me():
    """Lets a process die with this one."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)


def play(topic, value):
    """Starts a process that publishes a velocity, or a lock, at 20 Hz."""
    return subprocess.Popen([sys.executable, __file__, topic, str(value)], preexec_fn=with_me)


def played(topic, value):
    init()
    node = create_node("player")
    if value in ("True", "False"):
        publisher, message = node.create_publisher(Bool, topic, 10), Bool(data=value == "True")
    else:
        publisher, message = node.create_publisher(Twist, topic, 10), Twist()
        message.linear.x = float(value)
    while True:
        publisher.publish(message)
        time.sleep(0.05)


if __name__ == "__main__":
    played(*sys.argv[1:])
