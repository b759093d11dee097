"""Prints the messages of a recording as the packages `rosbags` and `mcap` read them, one JSON line a message."""

import json
import math
import struct
import sys
from pathlib import Path

from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_HUMBLE)


def stored(path):
    """Topic, type, encoding, time and bytes of each message."""
    if path.is_dir():
        with Reader(path) as reader:
            for connection, time, data in reader.messages():
                yield connection.topic, connection.msgtype, "cdr", time, bytes(data)
    else:
        from mcap.reader import make_reader

        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                name = schema.name if schema else ""
                yield channel.topic, name, channel.message_encoding, message.log_time, message.data


def stamp_of(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def scan(message):
    low, high = float(message.range_min), float(message.range_max)

    def echo(value):
        if value == -math.inf:
            return low
        return value if low <= value <= high else None

    angles = [float(message.angle_min) + i * float(message.angle_increment) for i in range(len(message.ranges))]
    return [low, high, [echo(float(value)) for value in message.ranges], angles]


def odometry(message):
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    theta = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    covariance = [float(message.pose.covariance[6 * i + j]) for i in (0, 1, 5) for j in (0, 1, 5)]
    numbers = [pose.position.x, pose.position.y, theta, twist.linear.x, twist.linear.y, twist.angular.z]
    return [float(number) for number in numbers] + covariance


def image(message):
    try:
        import cv2
        import numpy
    except ImportError:
        return None
    gray = cv2.imdecode(numpy.frombuffer(message.data, numpy.uint8), cv2.IMREAD_GRAYSCALE)
    return [gray.shape[1], gray.shape[0], float(gray.mean())]


def values(kind, data):
    """Stamp and values of a message that is a measurement."""
    if kind == "neato2_interfaces/msg/Bump":
        states = struct.unpack("<4B", data[4:8])
        return 0, [sum(state << i for i, state in enumerate(states))]
    read = {
        "sensor_msgs/msg/LaserScan": scan,
        "nav_msgs/msg/Odometry": odometry,
        "sensor_msgs/msg/CompressedImage": image,
    }.get(kind)
    if read is None:
        return None, None
    message = TYPES.deserialize_cdr(data, kind)
    return stamp_of(message), read(message)


for topic, kind, encoding, time, data in stored(Path(sys.argv[1])):
    stamp, numbers = values(kind, data) if encoding == "cdr" else (None, None)
    print(json.dumps({"topic": topic, "type": kind, "time": time, "stamp": stamp, "values": numbers, "bytes": len(data)}))
