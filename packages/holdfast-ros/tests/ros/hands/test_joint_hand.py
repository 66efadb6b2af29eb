"""Hands with a value for each joint: what they need to begin, and how they notice silence."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand
from holdfast_ros.hands import ros_hand

from .drivers import EFFORTS, ROS2

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("domain")]

COMMAND = GripCommand(1.0, LoopState.HOLD, {"thumb": FingerCommand(1.2)})
RELEASE = GripCommand(1.0, LoopState.FAULT, {}, release=True)


class TestOpening:
    def test_a_hand_without_joint_states(self, driver, impatient):
        driver(replace(ROS2["v4"], states=None))
        with pytest.raises(HandError, match="no joint states on /joint_states"):
            open_hand("ros2:v4").open()


class TestBeginOfTheGrip:
    @pytest.mark.parametrize("efforts", [[], [0.0] * 16])
    def test_a_hand_without_torque_is_refused_unless_it_is_given(self, driver, efforts):
        peer = driver(ROS2["v4"], efforts=efforts)
        with open_hand("ros2:v4") as hand, pytest.raises(HandError, match="effort="):
            hand.send(COMMAND)
        with open_hand(f"ros2:v4?effort={','.join(map(str, EFFORTS))}") as hand:
            hand.send(COMMAND)
            expected = {"thumb": 1.2, "index": 1.0, "middle": 1.0, "ring": 1.0}
            assert ROS2["v4"].meaning(peer.wait(1)) == pytest.approx(expected)

    def test_a_stiffness_in_degrees_is_refused_before_anything_is_sent(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4?stiffness=0.01") as hand:
            hand.check(Limits(), ["thumb"])
            with pytest.raises(HandError, match=r"ring joint 0: .*0.94 rad .*stiffness="):
                hand.send(COMMAND)
        assert not peer.messages


class TestSilence:
    def test_a_driver_that_ends(self, driver):
        peer = driver(ROS2["gripper"])
        with open_hand(ROS2["gripper"].uri) as hand:
            hand.send(COMMAND)
            peer.close()
            with pytest.raises(HandError, match="nothing listens on /gripper/force"):
                send_for_a_minute(hand)

    def test_it_is_silent_sooner_than_it_fails(self, driver, monkeypatch):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            end = time.monotonic() + 60
            while hand.silent and time.monotonic() < end:
                time.sleep(0.005)
            assert not hand.silent
            peer.stop_states()
            later = time.monotonic() + 0.11
            monkeypatch.setattr(ros_hand, "time", SimpleNamespace(monotonic=lambda: later))
            assert hand.silent
            monkeypatch.undo()

    @pytest.mark.parametrize(
        ("end", "text"),
        [
            (lambda peer: peer.stop_states(), "no joint states on /joint_states"),
            (lambda peer: peer.spoil(1e6, every=1), "no valid .*thumb joint 0"),
        ],
        ids=["none", "wrong"],
    )
    def test_joint_states_that_end(self, driver, end, text):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            hand.send(COMMAND)
            end(peer)
            with pytest.raises(HandError, match=text):
                send_for_a_minute(hand)


def send_for_a_minute(hand):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        hand.send(COMMAND)
        time.sleep(0.01)
