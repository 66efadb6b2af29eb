"""What every hand must fulfil; tests of other packages run it for their hands."""

import msgspec
import numpy as np
import pytest

from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands import open_hand

from .rigs import NAMES, Rigs

pytestmark = pytest.mark.slow

SCALES = {"thumb": 1.4, "index": 1.1, "middle": 1.2, "ring": 1.3}
COMMAND = GripCommand(1.0, LoopState.REACT, {f: FingerCommand(s) for f, s in SCALES.items()})
RELEASE = msgspec.structs.replace(COMMAND, release=True, state=LoopState.FAULT)
HOLD = msgspec.structs.replace(COMMAND, state=LoopState.FAULT)
IDLE = msgspec.structs.replace(COMMAND, state=LoopState.IDLE)


def scaled(scale, finger="index"):
    return GripCommand(1.0, LoopState.HOLD, {finger: FingerCommand(scale)})


def expected_of(rig):
    """The scales that a hand has after `COMMAND`."""
    return SCALES if rig.per_finger else max(SCALES.values())


@pytest.fixture(scope="module")
def rigs(tmp_path_factory):
    rigs = Rigs(lambda: tmp_path_factory.mktemp("rig"))
    yield rigs
    rigs.close()


def rigs_of(names):
    """A fixture: each of some rigs."""

    @pytest.fixture(params=names)
    def rig(rigs, request):
        found = rigs(request.param)
        yield found
        found.hand.close()

    return rig


rig = process_rig = rigs_of(NAMES)
"""All hands; those that are in this process, so that they report joints."""
finger_rig = rigs_of(["twin", "newtons"])
"""Hands with a force for each finger, which they know by name."""


def test_the_force_of_each_finger_is_that_of_the_command(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        assert rig.forces(1) == pytest.approx(expected_of(rig), rel=1e-5)


def test_release_opens_the_hand(rig):
    with rig.hand as hand:
        hand.send(COMMAND)
        hand.send(RELEASE)
        assert rig.forces(2) == "open"


@pytest.mark.parametrize("scale", [float("nan"), float("inf"), -0.5])
def test_a_scale_that_is_no_force_is_refused(rig, scale):
    with rig.hand as hand:
        with pytest.raises(HandError, match=r"a scale of at least 0 expected, .* given for index"):
            hand.send(scaled(scale))
        hand.send(COMMAND)
        rig.forces(1)  # and no other


def test_a_closed_hand_takes_no_command(rig):
    with pytest.raises(HandError, match="is not open"):
        rig.hand.send(COMMAND)


def test_it_can_be_closed_twice_and_opened_again(rig):
    for n in (1, 2):
        rig.hand.open()
        rig.hand.send(COMMAND)
        rig.forces(n)
        rig.hand.close()
        rig.hand.close()


def test_its_name_is_its_uri(rig):
    if not rig.hand.name.startswith(
        ("twin:", "newtons:", "width:")
    ):  # opened with a source, by a plug-in
        assert open_hand(rig.hand.name).name == rig.hand.name


def test_an_unknown_finger_is_refused(finger_rig):
    text = "has .*thumb.*; 'toe' commanded"
    with pytest.raises(ValueError, match=text):
        finger_rig.hand.check(Limits(), ["thumb", "toe"])
    with finger_rig.hand as hand:
        with pytest.raises(HandError, match=text):
            hand.send(scaled(1.0, "toe"))
        hand.send(COMMAND)
        finger_rig.forces(1)


def test_nothing_is_commanded_before_the_grip_begins(rig):
    """Neither the commands of an idle loop, nor the stop of one."""
    with rig.hand as hand:
        assert [hand.send(IDLE), hand.send(IDLE), hand.send(HOLD)] == [False] * 3
        assert hand.send(COMMAND)
        rig.forces(1)


def test_a_command_that_does_not_change_is_sent_once(rig):
    later = [msgspec.structs.replace(COMMAND, time=1.0 + 0.01 * k) for k in range(20)]
    with rig.hand as hand:
        assert [hand.send(one) for one in later] == [True] + [False] * 19
        assert hand.send(RELEASE)
        assert not hand.send(RELEASE)
        assert rig.forces(2) == "open"


def test_a_new_grip_gets_its_first_command(rig):
    with rig.hand as hand:
        assert [hand.send(one) for one in (COMMAND, IDLE, COMMAND)] == [True, False, True]
        rig.forces(2)


def test_a_hand_that_asks_for_a_heartbeat_gets_its_command_again(rig):
    with rig.hand as hand:
        for heartbeat, expected in ((None, [True, False]), (3600.0, [False]), (0.0, [True, True])):
            hand.heartbeat = heartbeat
            assert [hand.send(COMMAND) for _ in expected] == expected
        rig.forces(3)
        hand.heartbeat = None


def test_who_takes_over_sends_in_any_case(rig):
    with rig.hand as hand:
        assert [hand.send(RELEASE, repeat=True) for _ in range(3)] == [True] * 3
        assert rig.forces(3) == "open"


def test_joint_reports_are_measured_angles_or_none(process_rig):
    with process_rig.hand as hand:
        hand.send(COMMAND)
        reports = list(hand.joint_reports())
        assert all(np.isfinite(report).all() for report in reports)
        assert len({report.shape for report in reports}) <= 1
