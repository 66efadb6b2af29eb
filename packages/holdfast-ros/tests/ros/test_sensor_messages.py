import numpy as np
import pytest

from holdfast.io.definitions import parse_definition
from holdfast_ros.sensor_messages import SENS_STREAM, SampleDecoder, known_definition

pytest.importorskip("rosbags", reason="rosbags is not installed")

from ros_messages import (
    OLD,
    PILLARS,
    PILLARS_OF_ROS2,
    XELA,
    counts,
    sens_stream,
    sensor_state,
    sensor_state_of_ros2,
    store,
    x_server,
    x_stream,
)

ROS = pytest.mark.parametrize("ros2", [False, True], ids=["ros1", "ros2"])


def encoded(types, message, *, ros2):
    name = message.__msgtype__
    data = types.serialize_cdr(message, name) if ros2 else types.serialize_ros1(message, name)
    return bytes(data)


def stored_definition(types, message, *, ros2):
    """The definition as ROS keeps it with a topic."""
    name = message.__msgtype__
    return parse_definition(name, types.generate_msgdef(name, ros_version=2 if ros2 else 1)[0])


def definitions_of(types, message, *, ros2):
    """The definition as ROS keeps it, and of ROS 2 that which is known here."""
    stored = stored_definition(types, message, ros2=ros2)
    return (stored, known_definition(message.__msgtype__)) if ros2 else (stored,)


@ROS
def test_a_stream_of_xela(ros2):
    package = "xela_server_ros2" if ros2 else "xela_server_ros"
    types = store(package, XELA, ros2=ros2)
    thumb, tip = counts(30), counts(16, seed=1)
    forces = np.random.default_rng(2).normal(size=(30, 3)).astype(np.float32)
    message = sens_stream(
        types,
        package,
        (1, "uSCuAH", 7, 1619157045.25, thumb, forces),
        (4, "uSPa44", 2**32 - 1, 0.0, tip, []),
    )
    for definition in definitions_of(types, message, ros2=ros2):
        one, two = SampleDecoder(definition, ros2=ros2)(encoded(types, message, ros2=ros2))
        assert one[:5] == (1, "uSCuAH", 1619157045.25, None, 7)
        assert two[:5] == (4, "uSPa44", None, None, 2**32 - 1)
        assert one.counts.dtype == np.uint16
        np.testing.assert_array_equal(one.counts, thumb)
        np.testing.assert_array_equal(one.forces, forces)
        np.testing.assert_array_equal(two.counts, tip)
        assert two.forces.shape == (0, 3)


@ROS
def test_older_streams_of_xela(ros2):
    types = store("xela_server", OLD, ros2=ros2)
    message = x_stream(types, "xela_server", counts(16), counts(4, seed=1))
    found = SampleDecoder(stored_definition(types, message, ros2=ros2), ros2=ros2)(
        encoded(types, message, ros2=ros2)
    )
    assert [one.number for one in found] == [1, 2]
    np.testing.assert_array_equal(found[1].counts, counts(4, seed=1))
    message = x_server(types, "xela_server", 3, "XR1944", 12.5, counts(16), ros2=ros2)
    (one,) = SampleDecoder(stored_definition(types, message, ros2=ros2), ros2=ros2)(
        encoded(types, message, ros2=ros2)
    )
    assert one[:5] == (3, "XR1944", None, 12.5, None)
    assert one.counts.dtype == np.uint16
    np.testing.assert_array_equal(one.counts, counts(16))


@ROS
def test_pillars(ros2):
    package = "sensor_interfaces" if ros2 else "papillarray_ros_v2"
    types = store(package, PILLARS, ros2=ros2)
    forces = np.random.default_rng(2).normal(size=(9, 3)).astype(np.float32)
    message = sensor_state(types, package, 1_500_000, 12.25, forces, ros2=ros2)
    for definition in definitions_of(types, message, ros2=ros2):
        (one,) = SampleDecoder(definition, ros2=ros2)(encoded(types, message, ros2=ros2))
        assert one[:5] == (None, "papillarray", 1.5, 12.25, None)
        assert one.counts is None
        np.testing.assert_array_equal(one.forces, forces)


def test_pillars_of_ros2_with_small_letters_and_without_headers():
    types = store("sensor_interfaces", PILLARS_OF_ROS2, ros2=True)
    forces = np.random.default_rng(2).normal(size=(9, 3)).astype(np.float32)
    message = sensor_state_of_ros2(types, "sensor_interfaces", 1_500_000, forces)
    for definition in definitions_of(types, message, ros2=True):
        decode = SampleDecoder(definition, ros2=True)
        for _ in range(2):
            (sample,) = decode(encoded(types, message, ros2=True))
            assert sample[:5] == (None, "papillarray", 1.5, None, None)
            np.testing.assert_array_equal(sample.forces, forces)
        with pytest.raises(ValueError, match="cut"):
            decode(encoded(types, message, ros2=True)[:-20])


def test_counts_of_more_than_16_bits_are_refused():
    types = store("xela_server", OLD, ros2=False)
    message = x_stream(types, "xela_server", np.array([[1, 2, 65536]]))
    unpack = SampleDecoder(stored_definition(types, message, ros2=False), ros2=False)
    with pytest.raises(ValueError, match="65535"):
        unpack(encoded(types, message, ros2=False))


def test_unknown_messages():
    assert known_definition("std_msgs/msg/String") is None
    assert known_definition("other/SensStream") is None
    with pytest.raises(ValueError, match="pkg/Text"):
        SampleDecoder(parse_definition("pkg/Text", "string text"), ros2=False)
    signed = SENS_STREAM.replace("uint16", "int16")
    with pytest.raises(ValueError, match="SensStream"):
        SampleDecoder(parse_definition("xela_server_ros/SensStream", signed), ros2=False)
