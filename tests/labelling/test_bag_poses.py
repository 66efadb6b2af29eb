import pytest

from holdfast.errors import RecordingError
from holdfast.labelling.poses import poses_from_bag


class Bags:
    """Writes bags of ROS 2 and ROS 1."""

    def __init__(self, path, ros1):
        rosbags = pytest.importorskip("rosbags.typesys")
        store = rosbags.Stores.ROS1_NOETIC if ros1 else rosbags.Stores.ROS2_HUMBLE
        self.store, self.ros1, self.path = rosbags.get_typestore(store), ros1, path
        if ros1:  # rosbags does not know it there; a bag brings its definition along
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


@pytest.mark.parametrize("ros1", [False, True])
def test_bags_of_poses(tmp_path, ros1):
    bags = Bags(tmp_path / ("bag.bag" if ros1 else "bag"), ros1)
    path = bags.write(
        [("/marker", bags.pose(1e9 + k / 4, float(k))) for k in range(4)]
        + [("/tf", bags.frames(1e9 + k / 4, k / 2, "thumb_tip", "camera")) for k in range(4)]
    )
    poses = poses_from_bag(path, "/marker", {"thumb": "thumb_tip"})
    assert (poses.thing.times - 1e9).tolist() == [0, 0.25, 0.5, 0.75]
    assert poses.thing.positions[:, 0].tolist() == [0, 1, 2, 3]
    assert poses.tips["thumb"].positions[:, 0].tolist() == [0, 0.5, 1, 1.5]
    assert poses.tips["thumb"].quaternions[0].tolist() == [1, 0, 0, 0]
    assert not poses.same_clock


def test_a_bag_without_that_frame(tmp_path):
    bags = Bags(tmp_path / "bag", ros1=False)
    path = bags.write([("/marker", bags.pose(1.0, 0.0)), ("/tf", bags.frames(1.0, 0.0, "tip"))])
    with pytest.raises(RecordingError, match="has no pose of object; it has /marker, tip"):
        poses_from_bag(path, "object")
    with pytest.raises(RecordingError, match="poses in one frame expected, camera and world given"):
        poses_from_bag(path, "/marker", {"thumb": "tip"})


def test_what_is_no_bag(tmp_path):
    path = tmp_path / "no.bag"
    path.write_bytes(b"nothing")
    with pytest.raises(RecordingError, match="is cut, damaged or no bag"):
        poses_from_bag(path, "object")
    with pytest.raises(RecordingError):
        poses_from_bag(tmp_path / "away", "object")
