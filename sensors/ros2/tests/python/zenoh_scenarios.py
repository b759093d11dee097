"""What only a run over Zenoh has to show."""

import os
import subprocess
import sys
import time

from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import Imu

from live_run import ROBOT, TASK, Base, Program, play, with_me
from middleware import create_node, spin

FOLDER = os.path.dirname(os.path.realpath(__file__))
DECISIVE = 0.2


class Router:
    """The router of this test."""

    it = None


def start_router():
    """Starts the router, in a process of its own."""
    router = subprocess.Popen([sys.executable, f"{FOLDER}/zenoh_node.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                              preexec_fn=with_me)
    assert router.stdout.readline() == "routes\n"
    Router.it = router
    return router


def kill_router():
    Router.it.kill()
    Router.it.wait()


def router(program, folder):
    """Without a router, the run says so and goes on trying; what was connected survives its loss, and new ones are found when it is back."""
    kill_router()
    run = Program(program, folder)
    result = {"missing": run.wait_for_text("no Zenoh router at", "tcp/localhost:7447", "rmw_zenohd")}
    start_router()
    begin = time.monotonic()
    base, nav = Base(), play("/cmd_vel_nav", 0.2)
    base.wait_for(0.2, 30.0)
    result["driven_after_s"] = round(time.monotonic() - begin, 2)
    kill_router()
    result["lost"] = run.wait_for_text("Zenoh router", "is lost")
    begin = time.monotonic()
    time.sleep(2.0)
    rate_hz, gap_s = base.gaps(begin)
    result["without_router"] = {"rate_hz": round(rate_hz), "gap_s": round(gap_s, 3)}
    assert gap_s < 1.0, gap_s
    start_router()
    result["back"] = run.wait_for_text("Zenoh router", "is there")
    joystick = play("/cmd_vel_joy", 0.1)
    result["new_publisher_after_s"] = round(base.wait_for(0.1, 30.0), 2)
    run.end()
    for player in [nav, joystick]:
        player.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    return result


def client(program, folder):
    """A run as a client of a router drives through it, and goes on when it comes back; without it, the run does not start."""
    robot = ROBOT.replace('driver = "ros2"', 'driver = "ros2"\nrouter = "tcp/127.0.0.1:7447"')
    task = TASK.replace("priority = 10\n", 'priority = 10\nrouter = "tcp/127.0.0.1:7447"\n')
    base, run, nav = Base(), Program(program, folder, robot=robot, task=task), play("/cmd_vel_nav", 0.2)
    result = {"first_command_s": round(base.wait_for(0.2, 20.0), 2), "how": run.wait_for_text("Zenoh as a client")}
    kill_router()
    time.sleep(2.0)
    start_router()
    result["again_after_s"] = round(base.wait_for(0.2, 30.0), 2)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    kill_router()
    run = Program(program, folder, robot=robot, task=task)
    result["refused"] = run.wait_for_text("no Zenoh router at", "tcp/127.0.0.1:7447", "rmw_zenohd")
    run.end()
    return result


def types(program, folder):
    """Other types are logged by name, in both directions, and other definitions of the right type, but not Humble's lack of one."""
    node = create_node("other")
    scan = node.create_publisher(Imu, "/scan", 5)
    node.create_timer(0.05, lambda: scan.publish(Imu()))
    node.create_subscription(Imu, "/cmd_vel", lambda _: None, 10)
    heard = []
    odd = "RIHS01_" + "0" * 64
    node.create_subscription(Twist, "/yamabico/decision", lambda _: None, 10)
    spin(node)
    run = Program(program, folder)
    result = {
        "scan": run.wait_for_text("`/scan`", "sensor_msgs/msg/Imu", "sensor_msgs/msg/LaserScan"),
        "cmd_vel": run.wait_for_text("`/cmd_vel`", "sensor_msgs/msg/Imu"),
    }
    node.create_subscription(Twist, "/cmd_vel", lambda message: heard.append(message.linear.x), 10, hash="TypeHashNotSupported")
    stamped = []
    node.create_subscription(TwistStamped, "/cmd_vel", lambda message: stamped.append(message.twist.linear.x), 10, hash=odd)
    nav = play("/cmd_vel_nav", DECISIVE)
    begin = time.monotonic()
    while not (DECISIVE in heard and DECISIVE in stamped):
        assert time.monotonic() - begin < 30.0, (heard[-3:], stamped[-3:])
        time.sleep(0.05)
    result["definition"] = run.wait_for_text("`/cmd_vel`", "another definition", odd)
    assert "TypeHashNotSupported" not in run.text(), run.text()
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert heard[-1] == stamped[-1] == 0.0, (heard[-1], stamped[-1])
    return result
