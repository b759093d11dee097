"""A robot on ROS 2: publishes what it reads from its standard input, writes the commands that it gets to its standard output, and runs
a program beside it until the input ends.

    python ros2_robot.py PROGRAM ARGUMENT...
"""

import json
import math
import os
import signal
import subprocess
import sys
import time

import rclpy
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Imu, LaserScan

sys.path.append(os.path.join(os.path.dirname(__file__), "../../../../sensors/ros2/tests/python"))
from foreign_types import Cdr, foreign_type  # noqa: E402
from live_run import spin, with_me  # noqa: E402


def main():
    rclpy.init()
    node = rclpy.create_node("robot")
    picture = node.create_publisher(CompressedImage, "/oakd/rgb/preview/image_raw/compressed", 5)
    info = node.create_publisher(CameraInfo, "/oakd/rgb/preview/camera_info", 5)
    scan = node.create_publisher(LaserScan, "/scan", 5)
    odometry = node.create_publisher(Odometry, "/odom", 5)
    imu = node.create_publisher(Imu, "/imu", 5)
    hazards = node.create_publisher(foreign_type("irobot_create_msgs", "HazardDetectionVector"), "/hazard_detection", 5)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    frames = node.create_publisher(foreign_type("tf2_msgs", "TFMessage"), "/tf_static", latched)
    frames.publish(lidar_frame())
    node.create_subscription(TwistStamped, "/cmd_vel", command, 10)
    spin(node)
    run = subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=sys.stderr, preexec_fn=with_me)
    for line in sys.stdin.buffer:
        sensed = json.loads(line)
        data = sys.stdin.buffer.read(sensed["picture"])
        stamp = node.get_clock().now().to_msg()
        odometry.publish(measured_motion(sensed, stamp))
        turn = Imu()
        turn.header.stamp = stamp
        turn.angular_velocity.z = sensed["twist"][1]
        imu.publish(turn)
        hazards.publish(Cdr().header(stamp, "base_link").number("I", 0).bytes())
        if data:
            image = CompressedImage(format="jpeg", data=data)
            image.header.stamp = stamp
            picture.publish(image)
            camera = CameraInfo(width=320, height=240, distortion_model="plumb_bob", d=[0.0] * 5)
            focal = 160.0 / math.tan(math.radians(69.0 / 2.0))
            camera.k = [focal, 0.0, 159.5, 0.0, focal, 119.5, 0.0, 0.0, 1.0]
            info.publish(camera)
            scan.publish(ranges(sensed, stamp))
        if run.poll() is not None:
            os._exit(1)
    run.send_signal(signal.SIGINT)
    run.wait(timeout=30)
    time.sleep(0.3)
    sys.stdout.flush()
    # Threads of rclpy may hang at the end.
    os._exit(0)


def command(message):
    print(message.twist.linear.x, message.twist.angular.z, flush=True)


def lidar_frame():
    """The lidar in the center of the robot, without a turn."""
    message = Cdr().number("I", 1).header(rclpy.time.Time(nanoseconds=0).to_msg(), "base_link").text("laser")
    for number in [0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0]:
        message.number("d", number)
    return message.bytes()


def measured_motion(sensed, stamp):
    message = Odometry()
    message.header.stamp = stamp
    x, y, heading = sensed["pose"]
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
    message.twist.twist.linear.x, message.twist.twist.angular.z = sensed["twist"]
    return message


def ranges(sensed, stamp):
    count = len(sensed["ranges"])
    step = 2.0 * math.pi / max(count, 1)
    message = LaserScan(angle_min=sensed["first_rad"], angle_increment=step, range_min=0.1, range_max=8.0)
    message.header.stamp = stamp
    message.header.frame_id = "laser"
    message.ranges = [r if r >= 0.0 else math.inf for r in sensed["ranges"]]
    return message


main()
