"""Bags for tests, written by rosbags."""

import sqlite3

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from ros_messages import sens_stream, store


class BagWriter:
    """Writer of a bag, message by message.

    Args:
        path: path of the bag; the suffix of one of ROS 1 is added.
        storage: "mcap" or "sqlite3" of ROS 2, or "ros1".
        package: package of the message types that are added.
        texts: their definitions by name.
    """

    def __init__(self, path, storage="mcap", package="", texts=()):
        self.ros2, self.package = storage != "ros1", package
        self.path = path if self.ros2 else path.with_suffix(".bag")
        self.types = store(package, dict(texts), ros2=self.ros2)
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        self._writer = (
            Writer2(path, version=9, storage_plugin=plugin) if self.ros2 else Writer1(self.path)
        )
        self._connections = {}

    def __enter__(self):
        self._writer.open()
        return self

    def __exit__(self, *_):
        self._writer.close()

    def make(self, kind, **fields):
        return self.types.types[kind](**fields)

    def header(self, time, frame=""):
        whole = int(time)
        stamp = self.make(
            "builtin_interfaces/msg/Time", sec=whole, nanosec=round((time - whole) * 1e9)
        )
        first = {} if self.ros2 else {"seq": 0}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **first)

    def write(self, topic, message, time):
        """Write a message at a time [s]."""
        name = message.__msgtype__
        if topic not in self._connections:
            connection = self._writer.add_connection(topic, name, typestore=self.types)
            self._connections[topic] = connection
        pack = self.types.serialize_cdr if self.ros2 else self.types.serialize_ros1
        self._writer.write(self._connections[topic], round(time * 1e9), pack(message, name))

    def xela(self, time, *sensors, topic="/xServTopic"):
        self.write(topic, sens_stream(self.types, self.package, *sensors), time)


def forget_definitions(path):
    """Remove the definitions of messages from a bag; ROS 2 before Iron stores names of types."""
    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as base:
        base.execute("DELETE FROM message_definitions")
    base.close()
