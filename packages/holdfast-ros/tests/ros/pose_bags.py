"""Bags of poses for tests."""

import pytest


class PoseBagWriter:
    """Writer of bags with poses, of ROS 1 or ROS 2, by rosbags."""

    def __init__(self, path, *, ros1):
        rosbags = pytest.importorskip("rosbags.typesys")
        store = rosbags.Stores.ROS1_NOETIC if ros1 else rosbags.Stores.ROS2_HUMBLE
        self.store, self.ros1, self.path = rosbags.get_typestore(store), ros1, path
        if ros1:  # rosbags does not have this type for ROS 1
            text, name = "geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"
            self.store.register(rosbags.get_types_from_msg(text, name))

    def header(self, time, frame):
        Time = self.store.types["builtin_interfaces/msg/Time"]
        stamp = Time(int(time), round(time % 1 * 1e9))
        first = {"seq": 0} if self.ros1 else {}
        return self.store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **first)

    def pose(self, time, x, frame="camera"):
        get = self.store.types.__getitem__
        where = get("geometry_msgs/msg/Point")(x, 0.0, 0.5)
        turn = get("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)
        inner = get("geometry_msgs/msg/Pose")(where, turn)
        return get("geometry_msgs/msg/PoseStamped")(self.header(time, frame), inner)

    def frames(self, time, x, child, frame="world"):
        get = self.store.types.__getitem__
        where = get("geometry_msgs/msg/Vector3")(x, 0.0, 0.5)
        turn = get("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)
        inner = get("geometry_msgs/msg/Transform")(where, turn)
        one = get("geometry_msgs/msg/TransformStamped")(self.header(time, frame), child, inner)
        return get("tf2_msgs/msg/TFMessage")([one])

    def write(self, messages):
        if self.ros1:
            from rosbags.rosbag1 import Writer

            writer, serialize = Writer(self.path), self.store.serialize_ros1
        else:
            from rosbags.rosbag2 import Writer

            writer, serialize = Writer(self.path, version=8), self.store.serialize_cdr
        with writer:
            topics = {}
            for number, (topic, message) in enumerate(messages):
                kind = message.__msgtype__
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=self.store)
                writer.write(topics[topic], number, bytes(serialize(message, kind)))
        return self.path
