"""Frame published to command received over three ROS 2 nodes, a process each: camera and drive, behavior, arbiter.

The behavior and the arbiter do nothing but answer. A 640x480 mono frame every 20 ms, `best effort`, depth 1 everywhere.
Runs in a network namespace of its own that has only a loopback: nothing of it reaches, or hears of, another machine.

    python frame_to_command_ros.py [FRAMES]
"""
import array
import fcntl
import os
import socket
import struct
import subprocess
import sys
import time

PERIOD_S = 0.02
COLD = 25
IN_NAMESPACE = "YAMABICO_ROS_NAMESPACE"
SIOCGIFFLAGS, SIOCSIFFLAGS, IFF_UP = 0x8913, 0x8914, 1


def enter_namespace():
    """Starts this script again where there is no other machine."""
    if os.environ.get(IN_NAMESPACE):
        return
    os.environ[IN_NAMESPACE] = "1"
    as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
    os.execvp("unshare", ["unshare", "--net", *as_root, sys.executable, *sys.argv])


def raise_loopback():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        asked = struct.pack("16sh14x", b"lo", 0)
        flags = struct.unpack("16sh14x", fcntl.ioctl(any_socket, SIOCGIFFLAGS, asked))[1]
        fcntl.ioctl(any_socket, SIOCSIFFLAGS, struct.pack("16sh14x", b"lo", flags | IFF_UP))
    names = [name for _, name in socket.if_nameindex()]
    assert names == ["lo"], f"not alone: {names}"


def quality():
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(depth=1, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT)


def relay(role):
    """Answers every message with a twist of the same stamp."""
    import rclpy
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import Image

    takes, topic, answers = {
        "behavior": (Image, "camera", "proposal"),
        "arbiter": (TwistStamped, "proposal", "command"),
    }[role]
    rclpy.init()
    node = rclpy.create_node(role)
    publisher = node.create_publisher(TwistStamped, answers, quality())
    twist = TwistStamped()

    def answer(message):
        twist.header.stamp = message.header.stamp
        publisher.publish(twist)

    node.create_subscription(takes, topic, answer, quality())
    try:
        rclpy.spin(node)
    except rclpy.executors.ExternalShutdownException:
        node.destroy_node()


def measure(frames):
    """Latencies of so many frames that came back as commands, microseconds."""
    import rclpy
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import Image

    rclpy.init()
    node = rclpy.create_node("camera")
    publisher = node.create_publisher(Image, "camera", quality())
    image = Image(height=480, width=640, encoding="mono8", step=640, data=array.array("B", bytes(640 * 480)))
    latencies = []

    def publish():
        now = time.monotonic_ns()
        image.header.stamp.sec, image.header.stamp.nanosec = divmod(now, 1_000_000_000)
        publisher.publish(image)

    def receive(command):
        now, stamp = time.monotonic_ns(), command.header.stamp
        latencies.append((now - stamp.sec * 1_000_000_000 - stamp.nanosec) * 1e-3)

    node.create_subscription(TwistStamped, "command", receive, quality())
    node.create_timer(PERIOD_S, publish)
    until = time.monotonic() + 30 + 3 * frames * PERIOD_S
    while len(latencies) < frames + COLD and time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=1.0)
    node.destroy_node()
    rclpy.shutdown()
    return latencies[COLD:]


def main():
    enter_namespace()
    if len(sys.argv) > 1 and sys.argv[1] in ("behavior", "arbiter"):
        return relay(sys.argv[1])
    raise_loopback()
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    relays = [subprocess.Popen([sys.executable, __file__, role]) for role in ("behavior", "arbiter")]
    try:
        latencies = sorted(measure(frames))
    finally:
        for process in relays:
            process.terminate()
        for process in relays:
            process.wait()
    if len(latencies) < frames:
        sys.exit(f"only {len(latencies)} of {frames} frames came back")
    p50, p90, p99, most = (latencies[int((len(latencies) - 1) * share)] for share in (0.5, 0.9, 0.99, 1.0))
    print(f"ROS 2 (rclpy, {os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')}), {frames} frames, microseconds")
    print(f"p50 {p50:.0f}, p90 {p90:.0f}, p99 {p99:.0f}, most {most:.0f}")


if __name__ == "__main__":
    main()
