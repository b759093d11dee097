"""Writes the pictures of a folder into a rosbag2, one a second, as `sensor_msgs/msg/CompressedImage`, with the package `rosbags`."""

import sys
from pathlib import Path

import numpy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_HUMBLE)
IMAGE = "sensor_msgs/msg/CompressedImage"
Header, Time = TYPES.types["std_msgs/msg/Header"], TYPES.types["builtin_interfaces/msg/Time"]
BEGIN_S = 1_700_000_000

pictures, folder, storage = sorted(Path(sys.argv[1]).iterdir()), Path(sys.argv[2]), StoragePlugin[sys.argv[3]]
with Writer(folder, version=9, storage_plugin=storage) as writer:
    connection = writer.add_connection("/camera/image/compressed", IMAGE, typestore=TYPES)
    for index, picture in enumerate(pictures):
        data = numpy.frombuffer(picture.read_bytes(), numpy.uint8)
        message = TYPES.types[IMAGE](Header(Time(BEGIN_S + index, 0), "camera"), "jpeg", data)
        writer.write(connection, (BEGIN_S + index) * 10**9, bytes(TYPES.serialize_cdr(message, IMAGE)))
