"""The templates of hands beyond the contract: ceilings, deadband and rate, width.

The contract runs over the first two in `packages/holdfast-grip/tests/grip/hands/test_contract.py`.
"""

import math
import re

import pytest

from grip.hands.rigs import NewtonRig, WidthRig
from holdfast_grip import FingerCommand, GripCommand, Limits, LoopState
from holdfast_grip.errors import HandError


def command(scale, **changes):
    return GripCommand(1.0, LoopState.REACT, {"thumb": FingerCommand(scale)}, **changes)


@pytest.fixture
def rig(tmp_path):
    rig = NewtonRig(tmp_path)
    yield rig
    rig.close()


def test_a_change_within_the_deadband_waits_for_more(tmp_path):
    rig = NewtonRig(tmp_path, rate=1e9)
    with rig.hand as hand:
        sent = [hand.send(command(scale)) for scale in (1.0, 1.01, 1.02, 1.03)]
        assert sent == [True, False, False, True]
        assert rig.messages() == [{"thumb": 2.0}, {"thumb": pytest.approx(2.06)}]
    rig.close()


def test_a_command_that_is_early_waits_and_a_release_does_not(rig):
    with rig.hand as hand:
        assert [hand.send(command(1.0)), hand.send(command(1.5))] == [True, False]
        assert hand.send(command(1.5, release=True))
        assert rig.forces(2) == "open"


def test_the_highest_force_is_refused_before_arming_and_at_a_command(rig):
    with pytest.raises(ValueError, match="8 N given at max_scale 4"):
        rig.hand.check(Limits(max_scale=4.0), ["thumb"])
    rig.hand.check(Limits(max_scale=3.0), ["thumb"])
    with rig.hand as hand, pytest.raises(HandError, match=r"thumb: .* 8 N given"):
        hand.send(command(4.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_force": 0.0}, "start_force"),
        ({"max_force": float("nan")}, "max_force"),
        ({"rate": -1.0}, "rate"),
        ({"deadband": 2.0}, "deadband"),
    ],
)
def test_a_number_out_of_range_is_refused(rig, changes, message):
    given = {"start_force": 2.0, "max_force": 6.0} | changes
    with pytest.raises(ValueError, match=re.escape(message)):
        type(rig.hand)(("127.0.0.1", 5005), **given)


class TestWidth:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"stiffness": 0.0}, "stiffness: "),
            ({"start_force": math.nan}, "start_force: "),
            ({"stroke": 80.0}, "stroke: "),
        ],
    )
    def test_a_number_out_of_range_is_refused(self, tmp_path, changes, message):
        rig = WidthRig(tmp_path)
        with pytest.raises(ValueError, match=f"width:: {message}"):
            rig.make("width:", rig, **(rig.numbers | changes))

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"max_force": 5.0}, "6 N given"),
            ({"stiffness": 40.0}, "0.1 m given"),
        ],
    )
    def test_it_is_checked_before_arming(self, tmp_path, changes, message):
        rig = WidthRig(tmp_path)
        with pytest.raises(ValueError, match=message):
            rig.make("width:", rig, **(rig.numbers | changes)).check(Limits(), ["thumb"])

    def test_a_width_that_leaves_no_room_is_refused(self, tmp_path):
        rig = WidthRig(tmp_path)
        with rig.make("width:", rig, **(rig.numbers | {"stiffness": 60.0})) as hand:
            hand.check(Limits(), ["thumb"])
            with pytest.raises(HandError, match=r"0.0667 to 0.08 m at the beg.*, 0.06 m given"):
                hand.send(command(1.0))
        assert not rig.moves
