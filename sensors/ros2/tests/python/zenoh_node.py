"""Nodes over Zenoh with the wire of rmw_zenoh, written after its public design document, with the little of rclpy's interface that the
scenarios use.

Messages are encoded by rclpy, and the hashes of their definitions are those in its packages. Nothing of the program that is tested is used.
"""

import itertools
import json
import os
import struct
import sys
import threading
import time

import xxhash
import zenoh
from rclpy.clock import Clock, ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

# Hash of an endpoint of Humble.
WITHOUT_HASH = "TypeHashNotSupported"
ROUTER = "tcp/127.0.0.1:7447"


class Session:
    """The session of this process, opened at its first use."""

    it = None

    def __init__(self):
        config = {
            "mode": "peer",
            "connect": {"endpoints": ["tcp/localhost:7447"], "timeout_ms": -1, "exit_on_failure": False},
            "listen": {"endpoints": ["tcp/localhost:0"]},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": True, "target": {"peer": ["router"]},
                         "autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": "greater-zid"}}}},
            "timestamping": {"enabled": True},
        }
        self.zenoh = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self.domain = os.environ.get("ROS_DOMAIN_ID", "0")
        self.id = str(self.zenoh.zid())
        self.numbers = itertools.count()
        # Publishers of others by identity.
        self.publishers = {}
        key = f"@ros2_lv/{self.domain}/**"
        self.graph = self.zenoh.liveliness().declare_subscriber(key, self.follow, history=True)

    def follow(self, sample):
        key = str(sample.key_expr)
        if "/MP/" in key and sample.kind == zenoh.SampleKind.PUT:
            self.publishers[identity(key)] = key


def session():
    if Session.it is None:
        Session.it = Session()
    return Session.it


def identity(token):
    """Identity of an endpoint: a hash of its token, its lower half first, both little-endian."""
    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def name_of(message_type):
    """Package and name of a type."""
    package = getattr(message_type, "PACKAGE", None) or message_type.__module__.split(".")[0]
    return package, message_type.__name__


def hash_of(message_type):
    package, name = name_of(message_type)
    try:
        with open(f"{sys.prefix}/share/{package}/msg/{name}.json") as file:
            hashes = json.load(file)["type_hashes"]
        return next(entry["hash_string"] for entry in hashes if entry["type_name"] == f"{package}/msg/{name}")
    except FileNotFoundError:
        return WITHOUT_HASH


def foreign_type(package, name):
    """A type without a wheel; its publishers take bytes."""
    return type(name, (), {"PACKAGE": package})


class Node:
    def __init__(self, name):
        self.name, self.number = name, next(session().numbers)
        zenoh_session = session().zenoh
        token = f"@ros2_lv/{session().domain}/{session().id}/{self.number}/{self.number}/NN/%/%/{name}"
        self.kept = [zenoh_session.liveliness().declare_token(token)]
        self.timers = []

    def announce(self, kind, topic, type_name, hash, qos):
        reliability = "2" if qos.reliability == ReliabilityPolicy.BEST_EFFORT else ""
        durability = "1" if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL else ""
        depth = "" if qos.depth == 10 else qos.depth
        token = (f"@ros2_lv/{session().domain}/{session().id}/{self.number}/{next(session().numbers)}/{kind}/%/%/{self.name}/"
                 f"{topic.replace('/', '%')}/{type_name}/{hash}/{reliability}:{durability}:,{depth}:,:,:,,")
        self.kept.append(session().zenoh.liveliness().declare_token(token))
        return token

    def key(self, message_type, topic, hash):
        package, name = name_of(message_type)
        type_name = f"{package}::msg::dds_::{name}_"
        return f"{session().domain}/{topic.strip('/')}/{type_name}/{hash}", type_name

    def create_publisher(self, message_type, topic, qos, hash=None):
        qos, hash = profile(qos), hash or hash_of(message_type)
        key, type_name = self.key(message_type, topic, hash)
        reliability = zenoh.Reliability.BEST_EFFORT if qos.reliability == ReliabilityPolicy.BEST_EFFORT else zenoh.Reliability.RELIABLE
        if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            publisher = zenoh.ext.declare_advanced_publisher(session().zenoh, key, reliability=reliability,
                                                             cache=zenoh.ext.CacheConfig(qos.depth), publisher_detection=True)
        else:
            publisher = session().zenoh.declare_publisher(key, reliability=reliability,
                                                          congestion_control=zenoh.CongestionControl.DROP)
        self.kept.append(publisher)
        return Publisher(publisher, identity(self.announce("MP", topic, type_name, hash, qos)))

    def create_subscription(self, message_type, topic, receive, qos, hash=None):
        qos, hash = profile(qos), hash or hash_of(message_type)
        key, type_name = self.key(message_type, topic, hash)

        def take(sample):
            try:
                check(sample, topic)
            except (AssertionError, AttributeError, struct.error) as error:
                print(f"{topic}: {error!r}", file=sys.stderr, flush=True)
                return
            receive(deserialize_message(bytes(sample.payload), message_type))

        self.kept.append(session().zenoh.declare_subscriber(key, take))
        self.announce("MS", topic, type_name, hash, qos)

    def create_timer(self, period_s, call):
        self.timers.append((period_s, call))

    def get_clock(self):
        return Clock(clock_type=ClockType.ROS_TIME)

    def spin(self):
        for period_s, call in self.timers:
            threading.Thread(target=repeat, args=(period_s, call), daemon=True).start()


def check(sample, topic):
    """A message without a right attachment is left out, as rmw_zenoh does."""
    attachment = bytes(sample.attachment)
    assert len(attachment) == 33, "an attachment has 33 bytes"
    sequence, sent_ns, length = struct.unpack_from("<qqB", attachment)
    assert length == 16 and sequence > 0, (sequence, length)
    assert abs(sent_ns - time.time_ns()) < 60e9, sent_ns
    # The token may come after the first message.
    for _ in range(50):
        token = session().publishers.get(attachment[17:])
        if token:
            break
        time.sleep(0.01)
    assert token and f"/{topic.replace('/', '%')}/" in token, f"no token of this publisher: {token}"


class Publisher:
    def __init__(self, publisher, id):
        self.publisher, self.id, self.sent = publisher, id, 0

    def publish(self, message):
        self.sent += 1
        payload = message if isinstance(message, bytes) else serialize_message(message)
        attachment = struct.pack("<qqB", self.sent, time.time_ns(), 16) + self.id
        self.publisher.put(payload, attachment=attachment)


def profile(qos):
    return QoSProfile(depth=qos) if isinstance(qos, int) else qos


def repeat(period_s, call):
    due = time.monotonic()
    while True:
        call()
        due = max(due + period_s, time.monotonic())
        time.sleep(max(due - time.monotonic(), 0.0))


def init():
    """Nothing: the session is opened at its first use."""


def create_node(name):
    return Node(name)


def spin(node):
    node.spin()


def route():
    """A router, until the process ends."""
    config = {"mode": "router", "listen": {"endpoints": [ROUTER, "tcp/[::1]:7447"]}, "scouting": {"multicast": {"enabled": False}}}
    router = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    print("routes", flush=True)
    sys.stdin.read()
    router.close()


if __name__ == "__main__":
    route()
