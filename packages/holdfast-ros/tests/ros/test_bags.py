import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from holdfast.errors import RecordingError
from holdfast.io.definitions import parse_definition
from holdfast.io.importers import read_poses
from holdfast.labelling.rules.poses import poses_from_bag
from holdfast_ros.bags import PoseDecoder, find_bags, open_bag, poses_of, standard_definition
from ros.bag_writer import BagWriter, forget_definitions

TF = {"TFMessage": "geometry_msgs/TransformStamped[] transforms"}
"""A type that rosbags does not have for ROS 1."""


@pytest.fixture(params=["ros1", "sqlite3"])
def bag(request, tmp_path):
    return empty_bag(tmp_path, request.param)


def empty_bag(folder, storage="sqlite3"):
    return BagWriter(folder / "bag", storage, "tf2_msgs", TF if storage == "ros1" else {})


def pose(bag, time, x, frame="camera"):
    inner = bag.make(
        "geometry_msgs/msg/Pose",
        position=bag.make("geometry_msgs/msg/Point", x=x, y=0.0, z=0.5),
        orientation=bag.make("geometry_msgs/msg/Quaternion", x=0.48, y=0.0, z=0.36, w=0.8),
    )
    header = bag.header(time, frame)
    return bag.make("geometry_msgs/msg/PoseStamped", header=header, pose=inner)


def frame(bag, time, x, child, frame="world"):
    transform = bag.make(
        "geometry_msgs/msg/Transform",
        translation=bag.make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.5),
        rotation=bag.make("geometry_msgs/msg/Quaternion", x=0.48, y=0.0, z=0.36, w=0.8),
    )
    one = bag.make(
        "geometry_msgs/msg/TransformStamped",
        header=bag.header(time, frame), child_frame_id=child, transform=transform,
    )  # fmt: skip
    return bag.make("tf2_msgs/msg/TFMessage", transforms=[one])


def a_pose_and_a_frame(bag):
    """Write a bag with a topic of poses and a frame, four of each."""
    with bag:
        for k in range(4):
            time = 1e9 + k / 4
            bag.write("/marker", pose(bag, time, float(k), "/camera"), k)
            bag.write("/tf", frame(bag, time, k / 2, "/thumb_tip", "camera"), k + 0.5)
    return bag.path


def test_topics_and_messages(bag):
    path = a_pose_and_a_frame(bag)
    assert find_bags(path) == find_bags(path.parent) == [path]
    with open_bag(path) as opened:
        assert opened.ros2 is bag.ros2
        assert [(topic.name, topic.kind, topic.n_messages) for topic in opened.topics] == [
            ("/marker", "geometry_msgs/PoseStamped", 4),
            ("/tf", "tf2_msgs/TFMessage", 4),
        ]
        found = list(opened.messages(opened.topics[1:]))
        assert [topic.name for topic, _, _ in found] == ["/tf"] * 4
        assert [time for _, time, _ in found] == [0.5, 1.5, 2.5, 3.5]
        assert list(opened.messages([])) == []


def test_poses_of_topics_and_of_frames(bag):
    poses = read_poses(a_pose_and_a_frame(bag), {"object": "/marker", "thumb": "thumb_tip"})
    for body, step in (("object", 1.0), ("thumb", 0.5)):
        expected = np.tile([0, 0, 0, 0.5, 0.8, 0.48, 0.0, 0.36], (4, 1))
        expected[:, 0] = 1e9 + np.arange(4) / 4
        expected[:, 1] = step * np.arange(4)
        np.testing.assert_array_equal(poses[body], expected)


def test_nothing_from_a_bag_is_compiled_or_executed(bag):
    path = a_pose_and_a_frame(bag)
    poses_of(path, {"object": "/marker"})  # modules are imported here
    _EVENTS.clear()
    _LISTENING.append(True)
    try:
        poses_of(path, {"object": "/marker", "thumb": "thumb_tip"})  # what the child runs
    finally:
        _LISTENING.clear()
    assert _EVENTS == []


_EVENTS, _LISTENING = [], []


def _note(event, arguments):
    if _LISTENING and event in ("compile", "exec"):
        _EVENTS.append((event, arguments))


sys.addaudithook(_note)


def test_bags_without_definitions_and_tracks_of_a_label_rule(tmp_path):
    path = a_pose_and_a_frame(empty_bag(tmp_path))
    forget_definitions(path)
    with open_bag(path) as opened:
        assert all(topic.definition is not None for topic in opened.topics)
    poses = poses_from_bag(path, "/marker", {"thumb": "thumb_tip"})
    assert (poses.object_track.times - 1e9).tolist() == [0, 0.25, 0.5, 0.75]
    assert poses.object_track.positions[:, 0].tolist() == [0, 1, 2, 3]
    assert poses.tip_tracks["thumb"].positions[:, 0].tolist() == [0, 0.5, 1, 1.5]
    assert not poses.same_clock


def test_messages_without_poses():
    assert standard_definition("pkg/String") is None
    with pytest.raises(ValueError, match="pkg/Text has no poses"):
        PoseDecoder(parse_definition("pkg/Text", "string text"), ros2=True)


def test_missing_and_different_frames(bag):
    with bag:
        bag.write("/marker", pose(bag, 1.0, 0.0), 0)
        bag.write("/tf", frame(bag, 1.0, 0.0, "tip"), 1)
        bag.write("/chatter", bag.make("std_msgs/msg/String", data="hello"), 2)
    with pytest.raises(RecordingError, match="object; it has /marker, tip"):
        read_poses(bag.path, {"object": "object"})
    with pytest.raises(RecordingError, match="camera and world"):
        read_poses(bag.path, {"object": "/marker", "thumb": "tip"})


def test_no_bag_and_two_bags(tmp_path):
    path = tmp_path / "no.bag"
    path.write_bytes(b"nothing")
    for given in (path, tmp_path):
        with pytest.raises(RecordingError, match=f"^{given} is of no supported format"):
            read_poses(given, {"object": "object"})
    for name in ("a.bag", "b.bag"):
        (tmp_path / name).write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(RecordingError, match=f"at {tmp_path}, 2 found"):
        read_poses(tmp_path, {"object": "object"})


def test_a_damaged_bag(bag):
    path = a_pose_and_a_frame(bag)
    file = next(Path(path).glob("*.db3")) if bag.ros2 else path
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    command = "ros2 bag" if bag.ros2 else "rosbag"
    with pytest.raises(RecordingError, match=rf"{path} is cut .*: {command} reindex {path}$"):
        read_poses(path, {"object": "/marker"})
