"""The hands of ROS fulfil what every hand must fulfil, and more."""

import math

import numpy as np
import pytest

from grip.hands.test_contract import (  # noqa: F401 (pytest runs the tests)
    COMMAND,
    HOLD,
    RELEASE,
    expected_of,
    rigs_of,
    scaled,
    test_a_closed_hand_takes_no_command,
    test_a_command_that_does_not_change_is_sent_once,
    test_a_hand_that_asks_for_a_heartbeat_gets_its_command_again,
    test_a_new_grip_gets_its_first_command,
    test_a_scale_that_is_no_force_is_refused,
    test_an_unknown_finger_is_refused,
    test_it_can_be_closed_twice_and_opened_again,
    test_its_name_is_its_uri,
    test_joint_reports_are_measured_angles_or_none,
    test_nothing_is_commanded_before_the_grip_begins,
    test_release_opens_the_hand,
    test_the_force_of_each_finger_is_that_of_the_command,
    test_who_takes_over_sends_in_any_case,
)
from holdfast_grip import Limits
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand
from holdfast_ros.hands import ros_hand
from holdfast_ros.hands.table import hand_rows

from .drivers import POSITIONS, ROS2
from .rigs import NAMES, WITH_STATES, RosRigs

pytestmark = pytest.mark.slow

GRIPPERS = [name for name in NAMES if "gripper" in name]


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_LOCALHOST_ONLY", "1")
        patch.setattr(ros_hand, "DISCOVERY_TIME", 0.1)
        rigs = RosRigs(lambda: tmp_path_factory.mktemp("rig"))
        yield rigs
        rigs.close()


rig = process_rig = rigs_of(NAMES)
finger_rig = rigs_of([name for name in NAMES if name not in GRIPPERS])
states_rig = rigs_of(WITH_STATES)


def test_every_row_of_the_table_has_an_imitation_of_its_driver():
    assert {open_hand(driver.uri).name.partition("?")[0] for driver in ROS2.values()} == {
        f"ros2:{name}" for name in hand_rows()
    }
    assert all(row["source"] for row in hand_rows().values())


def test_each_joint_state_is_reported_once_in_the_order_of_the_hand(states_rig):
    with states_rig.hand as hand:
        hand.send(COMMAND)
        first = hand.joint_reports()
        assert len(first) >= 5
        assert len(first[-1])
        np.testing.assert_allclose(first[-1], POSITIONS[: len(first[-1])])
        assert len(hand.joint_reports()) < len(first)


@pytest.mark.parametrize("position", [1e6, POSITIONS[0] + 2 * math.pi, 0.4])
def test_a_wrong_joint_reading_defines_no_command(states_rig, position):
    """Beyond the limits of the joint it is refused; within them the median leaves it out."""
    before = states_rig.hand.n_refused
    with states_rig.spoiled(position), states_rig.hand as hand:
        hand.send(COMMAND)
        assert states_rig.forces(1) == pytest.approx(expected_of(states_rig), rel=1e-5)
        assert (hand.n_refused > before) is (position != 0.4)


def test_a_command_above_the_ceiling_is_refused(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        with pytest.raises(HandError, match=r"at most .* expected, .* given"):
            hand.send(scaled(30.0))
        hand.send(COMMAND)
        rig.forces(2)


def test_the_highest_scale_is_checked_before_anything_is_sent(rig):
    with pytest.raises((ValueError, HandError), match=r"given at max_scale 30: lower"):
        rig.hand.check(Limits(max_scale=30.0), ["thumb"])
        with rig.hand as hand:
            hand.send(COMMAND)
    rig.hand.check(Limits(max_scale=1.5), ["thumb"])
    with rig.hand as hand:
        hand.send(COMMAND)
        rig.forces(1)


def test_a_second_controller_is_refused(rig):
    with rig.hand, rig.other_hand() as other:
        assert other.resource == rig.hand.resource
        with pytest.raises(HandError, match=r"another program publishes .*: stop it, or give"):
            other.open()


def test_a_watchdog_beside_the_controller_can_release(rig):
    with rig.hand as hand, rig.other_hand(standby=True) as watchdog:
        hand.send(COMMAND)
        watchdog.open()
        watchdog.send(HOLD)  # nothing: the driver keeps its last command
        watchdog.send(RELEASE)
        assert rig.forces(2) == "open"
