import time

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast.io.cdr import MessageEncoder
from holdfast_grip import FingerCommand, GripCommand, LoopState
from holdfast_grip.hands import open_hand
from holdfast_ros import dds
from holdfast_ros.hands import ros_hand
from holdfast_ros.hands.driven_twin import DrivenTwin
from holdfast_ros.topic_messages import FLOAT_ARRAY, array_message, topic_definition
from ros.domains import new_domain

PATIENCE = 60.0
SCALES = {"thumb": 1.4, "index": 1.1, "middle": 1.2, "ring": 1.3}


@pytest.fixture
def hand(monkeypatch):
    """The URI of a Plexus hand in a domain of its own."""
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setattr(ros_hand, "DISCOVERY_TIME", 0.05)
    return f"ros2:plexus?effort=0.1&max_effort=0.3&domain={new_domain()}"


def read_until(twin, wanted):
    end = time.monotonic() + PATIENCE
    while not wanted() and time.monotonic() < end:
        assert twin.read(0.0) is not None
        time.sleep(0.005)
    assert wanted()


def test_commands_through_the_wire_reach_the_twin(hand):
    with DrivenTwin("twin:?object=ball", hand, speed=0) as twin, open_hand(hand) as sender:
        fingers = {name: FingerCommand(scale) for name, scale in SCALES.items()}
        sender.send(GripCommand(0.0, LoopState.HOLD, fingers))
        read_until(twin, lambda: twin.n_commands)
        np.testing.assert_allclose(twin._scales, list(SCALES.values()))
        protocol = twin.simulation.protocol
        sender.send(GripCommand(0.0, LoopState.FAULT, fingers, release=True))
        read_until(twin, lambda: protocol.is_released(twin.simulation.time))
    assert twin.n_refused == 0


@pytest.mark.slow
def test_a_message_that_is_no_command_is_refused(hand):
    with DrivenTwin("twin:?object=ball", hand, speed=0) as twin:
        node = dds.Node(int(hand.rpartition("=")[2]))
        definition = topic_definition(FLOAT_ARRAY)
        write, encode = node.writer(twin.topic, definition), MessageEncoder(definition)
        for n, values in enumerate(([0.1] * 15, [float("nan")] * 16), start=1):
            write(encode(array_message(np.array(values))))
            read_until(twin, lambda n=n: twin.n_refused == n)
        np.testing.assert_array_equal(twin._scales, 1.0)


@pytest.mark.parametrize("other", ["ros2:v4", "ros1:efforts", "log:x", "plexus"])
def test_another_hand_is_refused(other):
    with pytest.raises(ValueError, match=r"ros2:plexus\?effort=0.1&max_effort=0.3 expected"):
        DrivenTwin("twin:", other)
