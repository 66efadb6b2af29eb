"""The template of a hand beyond the contract: its ceiling, deadband and rate.

The contract runs over it in `tests/devices/hands/test_contract.py`.
"""

import re

import pytest

from devices.hands.rigs import NewtonRig
from holdfast.errors import HandError
from holdfast.grip import FingerCommand, GripCommand, Limits, LoopState


def command(scale, **changes):
    return GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(scale)}, **changes)


@pytest.fixture
def rig(tmp_path):
    rig = NewtonRig(tmp_path)
    yield rig
    rig.close()


def test_a_change_within_the_deadband_waits_for_more(rig):
    rig.hand._period = 0.0
    with rig.hand as hand:
        sent = [hand.send(command(scale)) for scale in (1.0, 1.01, 1.02, 1.03)]
        assert sent == [True, False, False, True]
        assert rig.messages() == [{"thumb": 2.0}, {"thumb": pytest.approx(2.06)}]


def test_a_command_that_is_early_is_sent_later_and_a_release_at_once(rig):
    with rig.hand as hand:
        assert [hand.send(command(1.0)), hand.send(command(1.5))] == [True, False]
        hand._period = 0.0
        assert hand.send(command(1.5))
        hand._period = 1e3
        assert hand.send(command(1.5, release=True))
        assert rig.forces(3) == "open"


def test_the_highest_force_is_refused_before_arming_and_at_a_command(rig):
    with pytest.raises(ValueError, match=r"at most 6 N expected, 8 N given at max_scale 4: lower"):
        rig.hand.check(Limits(max_scale=4.0), ["thumb"])
    rig.hand.check(Limits(max_scale=3.0), ["thumb"])
    with rig.hand as hand, pytest.raises(HandError, match="thumb: at most 6 N expected, 8 N given"):
        hand.send(command(4.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_force": 0.0}, "start_force: above 0 expected, 0 given"),
        ({"max_force": float("nan")}, "max_force: above 0 expected, nan given"),
        ({"rate": -1.0}, "rate: above 0 expected, -1 given"),
        ({"deadband": 2.0}, "deadband: 0 to below 2 N expected, 2 given"),
    ],
)
def test_a_number_out_of_range_is_refused(rig, changes, message):
    given = {"start_force": 2.0, "max_force": 6.0} | changes
    with pytest.raises(ValueError, match=re.escape(message)):
        type(rig.hand)(("127.0.0.1", 5005), **given)
