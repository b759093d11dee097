"""A robot and its operators on ROS 2, played with rclpy around a live run. Prints what was measured as JSON; fails by assertion.

    python scenarios.py SCENARIO YAMABICO FOLDER    # the program `yamabico`, and a folder for files
"""

import ctypes
import json
import os
import signal
import subprocess
import sys
import threading
import time
import traceback

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String

ROBOT = """
name = "{name}"
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
        self.node = rclpy.create_node("base")
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
        executor = rclpy.executors.SingleThreadedExecutor()
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()

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

    def wait_for(self, speed, timeout=8.0):
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

    def __init__(self, program, folder, lock_timeout_ms=0.0, sonar="", task=TASK):
        os.makedirs(folder, exist_ok=True)
        name = f"ros2-{os.getpid()}-{Program.count}"
        Program.count += 1
        with open(f"{folder}/robot.toml", "w") as file:
            file.write(ROBOT.format(name=name, sonar=sonar))
        with open(f"{folder}/task.toml", "w") as file:
            file.write(task.format(lock_timeout_ms=lock_timeout_ms))
        self.log = f"{folder}/log"
        arguments = [program, "run", f"{folder}/task.toml", "--live", "--no-overlays", "--overwrite", "--out", f"{folder}/out"]
        self.process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=open(self.log, "w"),
                                        preexec_fn=with_me)

    def text(self):
        with open(self.log) as file:
            return file.read()

    def wait_for_text(self, *words, timeout=12.0):
        begin = time.monotonic()
        while time.monotonic() - begin < timeout:
            lines = [line for line in self.text().splitlines() if all(word in line for word in words)]
            if lines:
                return lines[0]
            time.sleep(0.05)
        raise AssertionError(f"nothing with {words} on the log:\n{self.text()}")

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
    return subprocess.Popen([sys.executable, __file__, "play", topic, str(value)], preexec_fn=with_me)


def played(topic, value):
    rclpy.init()
    node = rclpy.create_node("player")
    if value in ("True", "False"):
        publisher, message = node.create_publisher(Bool, topic, 10), Bool(data=value == "True")
    else:
        publisher, message = node.create_publisher(Twist, topic, 10), Twist()
        message.linear.x = float(value)
    while True:
        publisher.publish(message)
        time.sleep(0.05)


def robot(program, folder):
    """Sensors arrive, commands follow, and the last one is zero."""
    base, run = Base(), Program(program, folder)
    nav = play("/cmd_vel_nav", 0.2)
    first = base.wait_for(0.2, 20.0)
    time.sleep(2.0)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    assert len(base.decisions) > 5 and base.decisions[-1]["behaviors"], "decisions"
    return {"first_command_s": first, "commands": len(base.commands), "decisions": len(base.decisions)}


def stamped(program, folder):
    """The drive sends the type that the base subscribes."""
    base, run = Base(stamped=True), Program(program, folder)
    nav = play("/cmd_vel_nav", 0.2)
    base.wait_for(0.2, 20.0)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    return {"logged": run.wait_for_text("/cmd_vel", "TwistStamped")}


def qos(program, folder):
    """Mismatches are logged with the topic, in both directions."""
    base = Base(durability=DurabilityPolicy.TRANSIENT_LOCAL)
    run = Program(program, folder, sonar='reliability = "reliable"')
    logged = [
        run.wait_for_text("`/scan`", "reliability"),
        run.wait_for_text("`/cmd_vel`", "durability"),
    ]
    run.end()
    assert not base.commands
    return {"logged": logged}


def domains(program, folder):
    """A run in another domain says so; in the same one it drives."""
    base, result = Base(), {}
    own = os.environ["ROS_DOMAIN_ID"]
    os.environ["ROS_DOMAIN_ID"] = "7"
    run = Program(program, folder)
    result["other"] = run.wait_for_text("`/scan`", "domain 7", timeout=20.0)
    run.end()
    assert not base.commands
    os.environ["ROS_DOMAIN_ID"] = own
    run, nav = Program(program, folder), play("/cmd_vel_nav", 0.2)
    result[f"first_command_in_{own}_s"] = base.wait_for(0.2, 20.0)
    run.end()
    nav.kill()
    return result


def mux(program, folder):
    """Three velocities and a lock; every publisher is killed."""
    base, run = Base(), Program(program, folder, lock_timeout_ms=500.0)
    joy, web, nav = play("/cmd_vel_joy", 0.1), play("/cmd_vel_web", 0.15), play("/cmd_vel_nav", 0.3)
    time.sleep(1.0)
    steps = []

    def step(what, speed, timeout=8.0):
        begin = time.monotonic()
        seconds = base.wait_for(speed, timeout)
        time.sleep(1.0)
        rate, gap = base.gaps(begin)
        steps.append({"step": what, "speed": speed, "after_s": seconds, "rate_hz": rate, "gap_s": gap})
        held = [linear for at, linear, _ in base.commands if at > begin + seconds]
        assert all(abs(linear - speed) < 0.005 for linear in held), (what, held)

    lock = play("/pause", False)
    step("all publish", 0.1, 20.0)
    begin = time.monotonic()
    joy.kill()
    step("joystick killed: web is below the lock, which is open", 0.15)
    web.kill()
    step("web killed", 0.3)
    lock.kill()
    step("lock killed: silence locks", 0.0)
    lock = play("/pause", True)
    step("lock says true", 0.0)
    joy = play("/cmd_vel_joy", 0.1)
    step("joystick back: it is above the lock", 0.1)
    joy.kill()
    step("joystick killed: locked", 0.0)
    lock.kill()
    lock = play("/pause", False)
    step("lock says false", 0.3)
    nav.kill()
    step("navigation killed: none is left", 0.0)
    _, gap = base.gaps(begin)
    notes = {b["name"]: b["reason"] for b in base.decisions[-1]["behaviors"]}
    run.end()
    lock.kill()
    assert gap < 0.5, f"no command for {gap} s"
    return {"steps": steps, "longest_gap_s": gap, "reasons_at_the_end": notes}


def restarts(program, folder, count=10):
    """Both sides are killed and come back, ten times each."""
    base_of = lambda: subprocess.Popen([sys.executable, __file__, "base"], stdout=subprocess.PIPE, text=True,
                                       preexec_fn=with_me)
    run, nav = Program(program, folder), play("/cmd_vel_nav", 0.2)
    seconds = {"base": [], "driver": []}
    for _ in range(count):
        begin = time.monotonic()
        base = base_of()
        line = base.stdout.readline()
        assert line.startswith("command"), line
        seconds["base"].append(time.monotonic() - begin)
        base.kill()
        base.wait()
    base = Base()
    base.wait_for(0.2, 20.0)
    for _ in range(count):
        os.kill(run.plugin("driver"), signal.SIGKILL)
        begin = time.monotonic()
        time.sleep(0.05)
        base.wait_for(0.2, 20.0)
        after = [at for at, linear, _ in base.commands if at > begin + 0.05 and abs(linear - 0.2) < 0.005]
        seconds["driver"].append(after[0] - begin)
        time.sleep(0.5)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    return {side: {"times": len(all), "median_s": sorted(all)[len(all) // 2], "max_s": max(all)}
            for side, all in seconds.items()}


def restarted_base():
    """A base that says when it gets a command to drive."""
    rclpy.init()
    base = Base()
    base.wait_for(0.2, 20.0)
    print("command", flush=True)
    time.sleep(60.0)


def main():
    match sys.argv[1:]:
        case ["play", topic, value]:
            played(topic, value)
        case ["base"]:
            restarted_base()
        case [name, program, folder]:
            rclpy.init()
            try:
                print(json.dumps(globals()[name](program, folder)), flush=True)
            except BaseException:
                traceback.print_exc()
                # Threads of rclpy may hang at the end.
                os._exit(1)
            os._exit(0)


main()
