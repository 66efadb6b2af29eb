import struct

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed")

from rosbags.typesys import Stores, get_typestore

from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.io.definitions import parse_definition
from holdfast_ros.topic_messages import (
    FLOAT_ARRAY,
    GRIPPER_COMMAND,
    JOINT_STATE,
    MESSAGE_TYPES,
    array_message,
    gripper_message,
    joint_message,
    topic_definition,
)

TYPES = get_typestore(Stores.ROS2_HUMBLE)


@pytest.mark.parametrize("name", [kind for kind in MESSAGE_TYPES if kind != GRIPPER_COMMAND])
def test_definitions_are_those_of_ros(name):
    text, _ = TYPES.generate_msgdef(name.replace("/", "/msg/"), ros_version=2)
    theirs = parse_definition(name, text)
    ours = topic_definition(name)
    assert {k: f for k, f in ours.types.items() if "/" in k} == {
        k: f for k, f in theirs.types.items() if "/" in k
    }


def test_another_program_reads_the_messages():
    values = np.linspace(0.0, 1.0, 16)
    data = MessageEncoder(topic_definition(FLOAT_ARRAY))(array_message(values))
    read = TYPES.deserialize_cdr(data, "std_msgs/msg/Float64MultiArray")
    np.testing.assert_array_equal(read.data, values)
    data = MessageEncoder(topic_definition(JOINT_STATE))(
        joint_message(12.5, ["a", "b"], efforts=np.array([1.0, 2.0]))
    )
    read = TYPES.deserialize_cdr(data, "sensor_msgs/msg/JointState")
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (12, 500_000_000)
    assert (read.name, list(read.effort), len(read.position)) == (["a", "b"], [1.0, 2.0], 0)


def test_a_gripper_command_is_a_position_and_a_force():
    """Rosbags does not have control_msgs: its file has `float64 position`, `float64 max_effort`."""
    data = MessageEncoder(topic_definition(GRIPPER_COMMAND))(gripper_message(0.02, 35.0))
    assert bytes(data) == b"\x00\x01\x00\x00" + struct.pack("<dd", 0.02, 35.0)


@pytest.mark.parametrize("time", [float("nan"), -1.0, 1e12])
def test_a_time_that_is_no_stamp_is_not_set(time):
    data = MessageEncoder(topic_definition(JOINT_STATE))(joint_message(time, []))
    stamp = MessageDecoder(topic_definition(JOINT_STATE), ros2=True)(data)["header"]["stamp"]
    assert stamp == {"sec": 0, "nanosec": 0}
