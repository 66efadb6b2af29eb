import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from holdfast.errors import RecordingError
from holdfast.io.importers import read_poses
from holdfast.labelling.rules.poses import poses_from_bag
from holdfast_ros.bags import find_bags, open_bag, poses_of
from ros.pose_bags import PoseBagWriter


@pytest.fixture(params=["ros1", "ros2"])
def bag(request, tmp_path):
    ros1 = request.param == "ros1"
    return PoseBagWriter(tmp_path / ("bag.bag" if ros1 else "bag"), ros1=ros1)


def a_pose_and_a_frame(bag):
    """Write a bag with a topic of poses and a frame, four of each."""
    return bag.write(
        [("/marker", bag.pose(1e9 + k / 4, float(k))) for k in range(4)]
        + [("/tf", bag.frames(1e9 + k / 4, k / 2, "/thumb_tip", "camera")) for k in range(4)]
    )


def test_topics_and_messages(bag):
    path = a_pose_and_a_frame(bag)
    assert find_bags(path) == find_bags(path.parent) == [path]
    with open_bag(path) as opened:
        assert opened.ros2 is not bag.ros1
        kinds = [(topic.name, topic.kind, topic.n_messages) for topic in opened.topics]
        assert kinds == [
            ("/marker", "geometry_msgs/PoseStamped", 4),
            ("/tf", "tf2_msgs/TFMessage", 4),
        ]
        assert opened.topics[0].definition.fields[1].name == "pose"
        found = list(opened.messages(opened.topics[1:]))
        assert [topic.name for topic, _, _ in found] == ["/tf"] * 4
        assert [time for _, time, _ in found] == [k * 1e-9 for k in (4, 5, 6, 7)]
        assert list(opened.messages([])) == []


def test_poses_of_topics_and_of_frames(bag):
    path = a_pose_and_a_frame(bag)
    poses = read_poses(path, {"object": "/marker", "thumb": "thumb_tip"})
    times = 1e9 + np.arange(4) / 4
    for body, step in (("object", 1.0), ("thumb", 0.5)):
        expected = np.zeros((4, 8))
        expected[:, 0] = times
        expected[:, 1] = step * np.arange(4)
        expected[:, 3] = 0.5
        expected[:, 4] = 1.0
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


def test_bags_without_definitions(tmp_path):
    """ROS 2 before Iron stores the names of types only."""
    path = a_pose_and_a_frame(PoseBagWriter(tmp_path / "bag", ros1=False))
    (file,) = path.glob("*.db3")
    base = sqlite3.connect(file)
    base.execute("DELETE FROM message_definitions")
    base.commit()
    base.close()
    poses = read_poses(path, {"object": "/marker", "thumb": "thumb_tip"})
    assert poses["thumb"][:, 1].tolist() == [0, 0.5, 1, 1.5]


def test_missing_and_different_frames(bag):
    path = bag.write([("/marker", bag.pose(1.0, 0.0)), ("/tf", bag.frames(1.0, 0.0, "tip"))])
    with pytest.raises(RecordingError) as refusal:
        read_poses(path, {"object": "object"})
    assert str(refusal.value) == f"{path} has no pose of object; it has /marker, tip"
    with pytest.raises(RecordingError) as refusal:
        read_poses(path, {"object": "/marker", "thumb": "tip"})
    assert str(refusal.value) == f"{path}: poses in one frame expected, camera and world given"


def test_a_bag_without_poses(tmp_path):
    writer = PoseBagWriter(tmp_path / "bag", ros1=False)
    path = writer.write([("/chatter", writer.store.types["std_msgs/msg/String"]("hello"))])
    with pytest.raises(RecordingError, match="has no pose of object; it has none"):
        read_poses(path, {"object": "object"})


def test_no_bag(tmp_path):
    path = tmp_path / "no.bag"
    path.write_bytes(b"nothing")
    for given in (path, tmp_path):
        with pytest.raises(RecordingError, match=f"^{given} is of no supported format"):
            read_poses(given, {"object": "object"})
    with pytest.raises(RecordingError, match="missing does not exist; a file or folder"):
        read_poses(tmp_path / "missing", {"object": "object"})


def test_two_bags(tmp_path):
    for name in ("a.bag", "b.bag"):
        (tmp_path / name).write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(RecordingError) as refusal:
        read_poses(tmp_path, {"object": "object"})
    assert str(refusal.value) == (
        f"one bag of ROS expected at {tmp_path}, 2 found; a .bag, .db3 or .mcap file, or a folder "
        "with metadata.yaml"
    )


def test_a_damaged_bag(bag):
    path = a_pose_and_a_frame(bag)
    file = path if bag.ros1 else next(Path(path).glob("*.db3"))
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    command = "rosbag" if bag.ros1 else "ros2 bag"
    with pytest.raises(RecordingError, match=r"bag is cut or damaged: [^\n]+$") as refusal:
        read_poses(path, {"object": "/marker"})
    assert str(refusal.value).endswith(f"; to recover it: {command} reindex {path}")


def test_tracks_of_a_label_rule(tmp_path):
    bag = PoseBagWriter(tmp_path / "bag", ros1=False)
    path = bag.write(
        [("/marker", bag.pose(1e9 + k / 4, float(k))) for k in range(4)]
        + [("/tf", bag.frames(1e9 + k / 4, k / 2, "thumb_tip", "camera")) for k in range(4)]
    )
    poses = poses_from_bag(path, "/marker", {"thumb": "thumb_tip"})
    assert (poses.object_track.times - 1e9).tolist() == [0, 0.25, 0.5, 0.75]
    assert poses.object_track.positions[:, 0].tolist() == [0, 1, 2, 3]
    assert poses.tip_tracks["thumb"].positions[:, 0].tolist() == [0, 0.5, 1, 1.5]
    assert poses.tip_tracks["thumb"].quaternions[0].tolist() == [1, 0, 0, 0]
    assert not poses.same_clock
