"""One-way delays between the nodes of a test and the example `latency`, and among these nodes, over the middleware of the test."""

import json
import os
import subprocess
import sys
import threading
import time

from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import CompressedImage, LaserScan

from live_run import with_me
from middleware import ENVIRONMENT, create_node, init, spin

# Topics with their types and rates, Hz.
TOPICS = {"/command": (TwistStamped, 50), "/scan": (LaserScan, 20), "/picture": (CompressedImage, 15)}
# Two participants of DDS need up to 8 s to find each other.
MEETING_S = 9.0
DURATION_S = 12.0


def delays(program, folder):
    """Delays of commands, scans of 720 beams and compressed pictures of 40 kB: to a node, to the example, and from the example to a node."""
    example = os.path.join(os.path.dirname(program), "examples/latency")
    arguments = lambda topic: f"{TOPICS[topic][0].__module__.split('.')[0]}/msg/{TOPICS[topic][0].__name__}"
    seconds = str(MEETING_S + DURATION_S + 1.0)
    start = lambda call: subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT, preexec_fn=with_me)
    to_example = {topic: start([example, "receive", topic, arguments(topic), seconds]) for topic in TOPICS}
    to_node = receiver(list(TOPICS), MEETING_S + DURATION_S + 1.0)
    node = create_node("sender")
    publishers = {topic: node.create_publisher(kind, topic, 10) for topic, (kind, _) in TOPICS.items()}
    spin(node)
    time.sleep(MEETING_S)
    threads = [threading.Thread(target=send, args=(node, publishers[topic], kind, rate_hz)) for topic, (kind, rate_hz) in TOPICS.items()]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    sent = {topic: int(DURATION_S * rate_hz) for topic, (_, rate_hz) in TOPICS.items()}
    result = {"sent": sent, "to_example": {topic: json.loads(process.communicate()[0]) for topic, process in to_example.items()},
              "to_node": json.loads(to_node.communicate()[0])}
    from_example = receiver(["/command"], MEETING_S + DURATION_S + 1.0)
    # The example waits for 2 s.
    time.sleep(MEETING_S - 2.0)
    count = json.loads(start([example, "send", "/command", str(DURATION_S), "50"]).communicate()[0])["sent"]
    result["from_example"] = {**json.loads(from_example.communicate()[0])["/command"], "sent": count}
    return result


def send(node, publisher, kind, rate_hz):
    message = kind()
    if kind is LaserScan:
        message.ranges = [5.0] * 720
    if kind is CompressedImage:
        message.format, message.data = "jpeg", bytes(40_000)
    due = time.monotonic()
    for _ in range(int(DURATION_S * rate_hz)):
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)
        due += 1.0 / rate_hz
        time.sleep(max(due - time.monotonic(), 0.0))


def receiver(topics, seconds):
    """A process that receives topics with a node of its own."""
    call = [sys.executable, __file__, str(seconds), *topics]
    return subprocess.Popen(call, stdout=subprocess.PIPE, text=True, preexec_fn=with_me)


def received(seconds, topics):
    init()
    node = create_node("receiver")
    found = {topic: [] for topic in topics}

    def receive(topic):
        def take(message):
            stamp = message.header.stamp
            found[topic].append(1e3 * (time.time() - stamp.sec - 1e-9 * stamp.nanosec))
        return take

    for topic in topics:
        node.create_subscription(TOPICS[topic][0], topic, receive(topic), 10)
    spin(node)
    time.sleep(seconds)
    print(json.dumps({topic: summary(sorted(delays)) for topic, delays in found.items()}), flush=True)
    os._exit(0)


def summary(delays):
    at = lambda share: round(delays[int(share * len(delays))], 2) if delays else None
    return {"count": len(delays), "p50_ms": at(0.5), "p99_ms": at(0.99)}


if __name__ == "__main__":
    received(float(sys.argv[1]), sys.argv[2:])
