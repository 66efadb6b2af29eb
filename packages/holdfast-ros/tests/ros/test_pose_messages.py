import re

import pytest

from holdfast.io.cdr import MessageEncoder
from holdfast.io.definitions import parse_definition
from holdfast_ros.bags import (
    PoseDecoder,
    StampedPose,
    has_poses,
    standard_definition,
)


def test_a_stamped_pose():
    definition = standard_definition("geometry_msgs/msg/PoseStamped")
    data = MessageEncoder(definition)(
        {
            "header": {"stamp": {"sec": 12, "nanosec": 500_000_000}, "frame_id": "/camera"},
            "pose": {
                "position": {"x": 1.0, "y": 2.0, "z": 3.0},
                "orientation": {"x": 0.1, "y": 0.2, "z": 0.3, "w": 0.4},
            },
        }
    )
    assert PoseDecoder(definition, ros2=True)(data) == [
        StampedPose("", "camera", 12.5, (1.0, 2.0, 3.0), (0.4, 0.1, 0.2, 0.3))
    ]


def test_frames():
    definition = standard_definition("tf2_msgs/TFMessage")
    frames = [
        {
            "header": {"stamp": {"sec": k, "nanosec": 0}, "frame_id": "world"},
            "child_frame_id": name,
            "transform": {
                "translation": {"x": 1.0, "y": 2.0, "z": 3.0},
                "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
        }
        for k, name in enumerate(("a", "/b"))
    ]
    data = MessageEncoder(definition)({"transforms": frames})
    found = PoseDecoder(definition, ros2=True)(data)
    assert [(pose.body, pose.frame, pose.time) for pose in found] == [
        ("a", "world", 0.0),
        ("b", "world", 1.0),
    ]


@pytest.mark.parametrize("name", ["geometry_msgs/PoseStamped", "tf2_msgs/TFMessage"])
def test_known_definitions_have_poses(name):
    assert has_poses(standard_definition(name))


def test_other_messages():
    assert standard_definition("pkg/String") is None
    text = parse_definition("pkg/Text", "string text")
    assert not has_poses(text)
    expected = (
        "pkg/Text has no poses; messages like geometry_msgs/PoseStamped and tf2_msgs/TFMessage"
    )
    with pytest.raises(ValueError, match=re.escape(expected)):
        PoseDecoder(text, ros2=True)
