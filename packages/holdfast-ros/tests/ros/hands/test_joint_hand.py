"""Hands with a value for each joint: what they need to begin, and how they notice silence."""

import math
import re
import time
from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand
from holdfast_grip.loop import watchdog
from holdfast_ros.hands import ros_hand
from holdfast_ros.hands.joint_hand import LIMIT_TOLERANCE

from .drivers import (
    AH_NAMES,
    EFFORTS,
    FLOATS,
    PATIENCE,
    PLEXUS,
    POSITIONS,
    ROS2,
    THUMB_FIRST,
    V4,
    home,
)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("domain")]

COMMAND = GripCommand(1.0, LoopState.HOLD, {"thumb": FingerCommand(1.2)})
RELEASE = GripCommand(1.0, LoopState.FAULT, {}, release=True)


class TestOpening:
    def test_a_hand_that_does_not_listen(self, driver, impatient, domain):
        driver(ROS2["gripper"])
        with pytest.raises(HandError) as failure:
            open_hand("ros2:v4").open()
        assert str(failure.value) == (
            f"ros2:v4: nothing listens on {V4} in ROS domain {domain} after 0.2 s; topics with a "
            "subscriber: /gripper/force, /joint_states"
        )

    def test_a_hand_without_joint_states(self, driver, impatient):
        driver(replace(ROS2["v4"], states=None))
        with pytest.raises(HandError, match=r"no joint states on /joint_states .* in 0.2 s; publi"):
            open_hand("ros2:v4").open()

    def test_a_second_publisher_that_is_shared(self, driver):
        peer = driver(ROS2["gripper"])
        uri = "ros2:gripper?topic=/gripper/force&effort=4&max_effort=10&shared=true"
        with open_hand(uri) as first, open_hand(uri) as second:
            first.send(COMMAND)
            second.send(RELEASE)
            assert {message["data"] for _, message in peer.wait(2)} == {4 * 1.2, 0.0}


class TestBeginOfTheGrip:
    def begin(self, driver, uri="ros2:v4", **changes):
        driver(ROS2["v4"], **changes)
        with open_hand(uri) as hand:
            hand.check(Limits(), ["thumb"])
            hand.send(COMMAND)

    def test_joint_states_without_efforts_are_not_enough(self, driver):
        with pytest.raises(HandError, match=r"have no efforts, so the torques .* give effort="):
            self.begin(driver, efforts=[])

    def test_a_hand_without_torque_is_refused(self, driver):
        with pytest.raises(HandError, match="have no efforts"):
            self.begin(driver, efforts=[0.0] * 16)

    def test_given_efforts_replace_those_of_the_joint_states(self, driver):
        peer = driver(ROS2["v4"], efforts=[])
        with open_hand(f"ros2:v4?effort={','.join(map(str, EFFORTS))}") as hand:
            hand.send(COMMAND)
            expected = {"thumb": 1.2, "index": 1.0, "middle": 1.0, "ring": 1.0}
            assert ROS2["v4"].meaning(peer.wait(1)) == pytest.approx(expected)

    def test_other_names_are_refused(self, driver):
        names = [name.replace("ah", "left") for name in AH_NAMES]
        with pytest.raises(HandError, match=r"no joint ah_joint00 \(there are arm_1, left_joint33"):
            self.begin(driver, names=names)
        with open_hand(f"ros2:v4?joints={joints_of(names, THUMB_FIRST)}") as hand:
            hand.send(COMMAND)

    def test_joint_states_without_names_have_the_order_of_the_commands(self, driver):
        peer = driver(ROS2["v4"], names=[])
        with open_hand("ros2:v4") as hand:
            hand.send(COMMAND)
            assert ROS2["v4"].meaning(peer.wait(1))["thumb"] == pytest.approx(1.2)

    def test_another_order(self, driver):
        order = ("ring", "thumb", "index", "middle")
        peer = driver(replace(ROS2["plexus"], order=order))
        with open_hand(f"{ROS2['plexus'].uri}&joints={joints_of(AH_NAMES, order)}") as hand:
            hand.send(COMMAND)
            assert peer.driver.meaning(peer.wait(1)) == pytest.approx(
                {"ring": 1.0, "thumb": 1.2, "index": 1.0, "middle": 1.0}
            )

    def test_the_base_is_a_median_over_the_time_in_which_the_hand_was_stable(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            peer.stop_states()
            hand._poll()
            _, states = hand._states[-1]
            hand._states.clear()
            for factor in (0.5, 0.9, 0.6, 9.0, 0.7):
                changed = states._replace(efforts=factor * states.efforts)
                hand._states.append((time.monotonic(), changed))
            hand.send(COMMAND)
            assert ROS2["v4"].meaning(peer.wait(1))["thumb"] == pytest.approx(1.2 * 0.7)

    def test_a_new_grip_takes_a_new_base(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            hand.send(COMMAND)
            hand.send(replace_state(COMMAND, LoopState.IDLE))
            hand.send(COMMAND)
            assert len(peer.wait(2)) == 2

    def test_set_points_stay_within_the_joints_limits(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4?max_effort=9") as hand:
            hand.send(GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(50.0)}))
            _, message = peer.wait(1)[-1]
        assert list(message["data"][:4]) == [1.396, 1.163, 1.644, 1.719]


class TestWrongJointStates:
    """What a hand reads must be within the limits of its joints."""

    def test_a_hand_without_a_valid_state_is_not_opened(self, driver, impatient):
        peer = driver(ROS2["v4"])
        peer.spoil(1e6, every=1)
        with pytest.raises(HandError) as failure:
            open_hand("ros2:v4").open()
        assert re.search(
            r"0 valid joint states on /joint_states in ROS domain \d+ in 0.2 s, at least 5 "
            r"expected \(\d+ refused: thumb joint 0 at 1e\+06 rad, 0.263 to 1.396 expected\)$",
            str(failure.value),
        )

    def test_states_that_become_wrong_are_a_fault(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            hand.send(COMMAND)
            peer.spoil(1e6, every=1)
            text = r"no valid joint states on /joint_states for 0.\d s \(\d+ refused: thumb joint 0"
            with pytest.raises(HandError, match=text):
                send_for_a_minute(hand)

    @pytest.mark.parametrize(
        ("beyond", "is_refused"), [(LIMIT_TOLERANCE - 0.01, False), (LIMIT_TOLERANCE + 0.01, True)]
    )
    def test_a_reading_may_be_a_little_beyond_its_limit(self, driver, beyond, is_refused):
        peer = driver(ROS2["v4"])
        peer.spoil(1.396 + beyond)
        with open_hand("ros2:v4") as hand:
            assert (hand.n_refused > 0) is is_refused

    def test_limits_can_be_given(self, driver):
        peer = driver(ROS2["v5"])
        peer.spoil(0.5)
        with open_hand(ROS2["v5"].uri) as hand:
            assert hand.n_refused == 0
        with open_hand(f"{ROS2['v5'].uri}&lowest=-0.3&highest=0.35") as hand:
            assert hand.n_refused > 0
            hand.send(GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(5.0)}))
            _, message = peer.wait(1)[-1]
        assert max(message["position"]) == 0.35


class TestSilence:
    def test_a_driver_that_ends(self, driver):
        peer = driver(ROS2["gripper"])
        with open_hand(ROS2["gripper"].uri) as hand:
            hand.send(COMMAND)
            peer.close()
            with pytest.raises(HandError, match="nothing listens on /gripper/force any more"):
                send_for_a_minute(hand)

    @pytest.mark.parametrize(("period", "longest"), [(0.01, 0.1), (0.05, 0.15), (0.1, 0.3)])
    def test_it_is_silent_sooner_than_it_fails(self, driver, monkeypatch, period, longest):
        driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            monkeypatch.setattr(hand, "_take_states", list)
            newest = hand._states[-1][1]
            for age, silent in ((longest - 0.02, False), (longest + 0.02, True)):
                monkeypatch.setattr(ros_hand, "time", SimpleNamespace(monotonic=lambda: 7.0))
                hand._states = deque([(7.0 - age - period, newest), (7.0 - age, newest)])
                assert hand.silent is silent
            monkeypatch.undo()

    def test_joint_states_that_stop(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4") as hand:
            hand.send(COMMAND)
            peer.stop_states()
            with pytest.raises(HandError, match=r"no joint states on /joint_states for 0.\d s"):
                send_for_a_minute(hand)


class TestRelease:
    def test_plexus_opens_without_torque_or_to_a_pose(self, driver):
        topics = {**ROS2["plexus"].topics, f"{PLEXUS}/commands": FLOATS}
        peer = driver(replace(ROS2["plexus"], topics=topics))
        pose = home(("thumb", "index", "middle", "ring"))
        uri = f"{ROS2['plexus'].uri}&release=home&home={','.join(map(str, pose))}"
        with open_hand(uri) as hand:
            hand.send(RELEASE)
            ((topic, message),) = peer.wait(1)
        assert topic == f"{PLEXUS}/commands"
        assert list(message["data"]) == pose
        assert max(POSITIONS) < 1

    @pytest.mark.parametrize("on_fault", ["open", "hold"])
    def test_the_watchdog_takes_over_when_the_loop_dies(self, driver, monkeypatch, on_fault):
        """It opens the hand by several messages, of which one is enough, or leaves it as it is."""
        monkeypatch.setattr(watchdog, "WATCHDOG_END_TIMEOUT", PATIENCE)  # of a busy machine
        peer = driver(ROS2["plexus"])
        with open_hand(ROS2["plexus"].uri) as hand:
            dog = watchdog.Watchdog(hand.name, on_fault, timeout=3600.0)
            dog.start()
            dog.beat(COMMAND)
            hand.send(COMMAND)
            peer.wait(1)
            dog.abandon()
            messages = peer.wait(2 if on_fault == "open" else 1)
        forces = {"thumb": 1.2, "index": 1.0, "middle": 1.0, "ring": 1.0}
        expected = "open" if on_fault == "open" else pytest.approx(forces)
        assert peer.driver.meaning(messages) == expected


class TestUnits:
    def test_angles_in_degrees_are_refused(self, driver, impatient):
        driver(ROS2["v4"]).spoil(math.degrees(POSITIONS[0]), every=1)
        with pytest.raises(HandError, match=r"joint 0 at 15.4699 rad, 0.263 to 1.396 expected"):
            open_hand("ros2:v4").open()

    def test_a_stiffness_in_degrees_is_refused_before_anything_is_sent(self, driver):
        peer = driver(ROS2["v4"])
        with open_hand("ros2:v4?stiffness=0.01") as hand:
            hand.check(Limits(), ["thumb"])
            text = r"ring joint 0: a set-point at most 0.94 rad .* check stiffness= \[N m/rad\]"
            with pytest.raises(HandError, match=text):
                hand.send(COMMAND)
        assert not peer.messages

    def test_torques_in_another_order_exceed_the_ceiling_of_a_joint(self):
        torques = ["0.3"] * 16  # of the second joints; the fourth of a finger has 0.2375
        with pytest.raises(ValueError, match=r"ring joint 3|thumb joint 2") as failure:
            open_hand(f"ros2:v4?effort={','.join(torques)}").check(Limits(), ["thumb"])
        assert "given at max_scale 3: lower one of them" in str(failure.value)


def joints_of(names, order):
    """The parameter `joints` of 16 names."""
    parts = (names[4 * k : 4 * k + 4] for k in range(4))
    return ",".join(":".join([finger, *part]) for finger, part in zip(order, parts, strict=True))


def replace_state(command, state):
    return GripCommand(command.time, state, command.fingers)


def send_for_a_minute(hand):
    end = time.monotonic() + 60
    while time.monotonic() < end:
        hand.send(COMMAND)
        time.sleep(0.01)
