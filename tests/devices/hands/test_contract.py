"""What every hand must fulfil. The hands of ROS have a driver on the other side of the topics."""

import math

import msgspec
import numpy as np
import pytest

from holdfast.devices.hands import open_hand
from holdfast.errors import HandError
from holdfast.grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_ros.hands import ros_hand

from .rigs import LOCAL, NAMES, WITH_STATES, Rigs
from .ros.drivers import POSITIONS

pytestmark = pytest.mark.slow

SCALES = {"thumb": 1.4, "index": 1.1, "middle": 1.2, "ring": 1.3}
COMMAND = GripCommand(1.0, LoopState.REACT, {f: FingerCommand(s) for f, s in SCALES.items()})
RELEASE = msgspec.structs.replace(COMMAND, release=True, state=LoopState.FAULT)
HOLD = msgspec.structs.replace(COMMAND, state=LoopState.FAULT)
IDLE = msgspec.structs.replace(COMMAND, state=LoopState.IDLE)
ON_TOPICS = [name for name in NAMES if name not in LOCAL]
GRIPPERS = ("log", "call", "gripper", "parallel-gripper", "width-gripper", "width")
WITH_FINGERS = [name for name in NAMES if name.split(":")[-1] not in GRIPPERS]


def scaled(scale, finger="index"):
    return GripCommand(1.0, LoopState.HOLD, {finger: FingerCommand(scale)})


def expected_of(rig):
    """The scales that a hand has after `COMMAND`."""
    return SCALES if rig.per_finger else max(SCALES.values())


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_LOCALHOST_ONLY", "1")
        patch.setattr(ros_hand, "DISCOVERY_TIME", 0.1)
        rigs = Rigs(lambda: tmp_path_factory.mktemp("rig"))
        yield rigs
        rigs.close()


@pytest.fixture
def rig(rigs, request):
    found = rigs(request.param)
    yield found
    found.hand.close()


each = pytest.mark.parametrize("rig", NAMES, indirect=True)
each_on_topics = pytest.mark.parametrize("rig", ON_TOPICS, indirect=True)
each_with_states = pytest.mark.parametrize("rig", WITH_STATES, indirect=True)
IN_PROCESS = [name for name in NAMES if not name.startswith("ros1:")]
"""Hands of ROS 1 run in a process of their own, which passes commands on and no reports."""
each_in_process = pytest.mark.parametrize("rig", IN_PROCESS, indirect=True)
each_in_process_with_states = pytest.mark.parametrize(
    "rig", [name for name in WITH_STATES if name in IN_PROCESS], indirect=True
)
each_with_fingers = pytest.mark.parametrize("rig", WITH_FINGERS, indirect=True)


@each
def test_the_force_of_each_finger_is_that_of_the_command(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        assert rig.forces(1) == pytest.approx(expected_of(rig), rel=1e-5)


@each
def test_release_opens_the_hand(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        hand.send(RELEASE)
        assert rig.forces(2) == "open"


@each
@pytest.mark.parametrize("scale", [float("nan"), float("inf"), -0.5])
def test_a_scale_that_is_no_force_is_refused(rig, scale):
    with rig.hand as hand:
        with pytest.raises(HandError, match=r"a scale of at least 0 expected, .* given for index"):
            hand.send(scaled(scale))
        hand.send(COMMAND)
        rig.forces(1)  # and no other


@each
def test_a_closed_hand_takes_no_command(rig):
    with pytest.raises(HandError, match="is not open"):
        rig.hand.send(COMMAND)


@each
def test_it_can_be_closed_twice_and_opened_again(rig):
    for n in (1, 2):
        rig.hand.open()
        rig.hand.send(COMMAND)
        rig.forces(n)
        rig.hand.close()
        rig.hand.close()


@each
def test_its_name_is_its_uri(rig):
    if not rig.hand.name.startswith(
        ("twin:", "newtons:", "width:")
    ):  # opened with a source, by a plug-in
        assert open_hand(rig.hand.name).name == rig.hand.name


@each_with_fingers
def test_an_unknown_finger_is_refused(rig):
    text = "has .*thumb.*; 'toe' commanded"
    with pytest.raises(ValueError, match=text):
        rig.hand.check(Limits(), ["thumb", "toe"])
    with rig.hand as hand:
        with pytest.raises(HandError, match=text):
            hand.send(scaled(1.0, "toe"))
        hand.send(COMMAND)
        rig.forces(1)


@each
def test_nothing_is_commanded_before_the_grip_begins(rig):
    """Neither the commands of an idle loop, nor the stop of one."""
    with rig.hand as hand:
        assert [hand.send(IDLE), hand.send(IDLE), hand.send(HOLD)] == [False] * 3
        assert hand.send(COMMAND)
        rig.forces(1)


@each
def test_a_command_that_does_not_change_is_sent_once(rig):
    later = [msgspec.structs.replace(COMMAND, time=1.0 + 0.01 * k) for k in range(20)]
    with rig.hand as hand:
        assert [hand.send(one) for one in later] == [True] + [False] * 19
        assert hand.send(RELEASE)
        assert not hand.send(RELEASE)
        assert rig.forces(2) == "open"


@each
def test_a_new_grip_gets_its_first_command(rig):
    with rig.hand as hand:
        assert [hand.send(one) for one in (COMMAND, IDLE, COMMAND)] == [True, False, True]
        rig.forces(2)


@each
def test_a_hand_that_asks_for_a_heartbeat_gets_its_command_again(rig):
    with rig.hand as hand:
        for heartbeat, expected in ((None, [True, False]), (3600.0, [False]), (0.0, [True, True])):
            hand.heartbeat = heartbeat
            assert [hand.send(COMMAND) for _ in expected] == expected
        rig.forces(3)
        hand.heartbeat = None


@each
def test_who_takes_over_sends_in_any_case(rig):
    with rig.hand as hand:
        assert [hand.send(RELEASE, repeat=True) for _ in range(3)] == [True] * 3
        assert rig.forces(3) == "open"


@each_in_process
def test_joint_reports_are_measured_angles_or_none(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        reports = list(hand.joint_reports())
        assert all(np.isfinite(report).all() for report in reports)
        assert len({report.shape for report in reports}) <= 1


@each_in_process_with_states
def test_each_joint_state_is_reported_once_in_the_order_of_the_hand(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        first = hand.joint_reports()
        assert len(first) >= 5
        assert len(first[-1])
        np.testing.assert_allclose(first[-1], POSITIONS[: len(first[-1])])
        assert len(hand.joint_reports()) < len(first)


@each_with_states
@pytest.mark.parametrize("position", [1e6, POSITIONS[0] + 2 * math.pi, 0.4])
def test_a_wrong_joint_reading_defines_no_command(rig, position):
    """Beyond the limits of the joint it is refused; within them the median leaves it out."""
    before = rig.hand.n_refused
    with rig.spoiled(position), rig.hand as hand:
        hand.send(COMMAND)
        assert rig.forces(1) == pytest.approx(expected_of(rig), rel=1e-5)
        assert (hand.n_refused > before) is (position != 0.4)


@each_on_topics
def test_a_command_above_the_ceiling_is_refused(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        with pytest.raises(HandError, match=r"at most .* expected, .* given"):
            hand.send(scaled(30.0))
        hand.send(COMMAND)
        rig.forces(2)


@each_on_topics
def test_the_highest_scale_is_checked_before_anything_is_sent(rig):
    with pytest.raises((ValueError, HandError), match=r"given at max_scale 30: lower"):
        rig.hand.check(Limits(max_scale=30.0), ["thumb"])
        with rig.hand as hand:
            hand.send(COMMAND)
    rig.hand.check(Limits(max_scale=1.5), ["thumb"])
    with rig.hand as hand:
        hand.send(COMMAND)
        rig.forces(1)


@each_on_topics
def test_a_second_controller_is_refused(rig):
    with rig.hand, rig.other_hand() as other:
        assert other.resource == rig.hand.resource
        with pytest.raises(HandError, match=r"another program publishes .*: stop it, or give"):
            other.open()


@each_on_topics
def test_a_watchdog_beside_the_controller_can_release(rig):
    with rig.hand as hand, rig.other_hand(standby=True) as watchdog:
        hand.send(COMMAND)
        watchdog.open()
        watchdog.send(HOLD)  # nothing: the driver keeps its last command
        watchdog.send(RELEASE)
        assert rig.forces(2) == "open"
