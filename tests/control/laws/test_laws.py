import math
from typing import NamedTuple

import pytest

from holdfast.control import LAWS, GripReason
from holdfast.control.laws import Touch, law_named
from holdfast.control.laws.friction_margin import FIRST_FRICTION, MARGIN

DT = 1 / 150


def touch(normal=2.0, tangential=0.6, probability=0.95, instability=0.001, name="index"):
    made = Touch(name)
    made.known = made.touching = True
    made.probability, made.instability = probability, instability
    made.force, made.normal, made.tangential = (normal, tangential, 0.0), normal, tangential
    made.start_normal = 2.0
    return made


def started(name, touches, thumb=-1):
    law = law_named(name)
    law.start(touches, thumb)
    return law


class Wanted(NamedTuple):
    scale: float
    reason: GripReason


def wanted(law, touches, time, dt):
    return [Wanted(*wish) for wish in law.wishes(touches, time, dt)]


@pytest.mark.parametrize("name", sorted(LAWS))
def test_a_quiet_grip_wants_no_rise(name):
    touches = [touch()]
    if name == "friction-margin":
        touches[0].scale = 2.0  # its margin for a friction of 0.3 is more than this grip has
    law = started(name, touches)
    for k in range(300):
        (wish,) = wanted(law, touches, k * DT, DT)
        assert wish.scale <= touches[0].scale


class TestPr2:
    def shaken(self, amplitude, slow=0.0):
        touches = [touch(), touch(name="thumb")]
        law, wishes = started("pr2", touches), []
        for k in range(60):
            normal = 2.0 + slow * k * DT
            touches[0].force = (normal, 0.6 + amplitude * (-1) ** k, 0.0)
            touches[0].normal = normal
            wishes.append(wanted(law, touches, k * DT, DT))
        return wishes

    def test_a_vibration_raises_all_fingers_by_8_percent(self):
        last = self.shaken(0.1)[-1]
        assert [tuple(wish) for wish in last] == [(1.08, GripReason.SLIP)] * 2

    def test_a_vibration_below_the_threshold_does_not(self):
        assert all(one.scale == 1.0 for wishes in self.shaken(0.01) for one in wishes)

    def test_a_force_that_changes_slowly_is_no_slip(self):
        assert self.shaken(0.1, slow=5.0)[-1][0].reason is GripReason.NONE


class TestWongZhu:
    def test_a_jump_of_the_tangential_force_raises_that_finger(self):
        touches = [touch(), touch(name="thumb")]
        law = started("wong-zhu", touches)
        touches[0].tangential = 0.67
        one, other = wanted(law, touches, DT, DT)
        assert one == (1.1, GripReason.SLIP)
        assert other == (1.0, GripReason.NONE)

    def test_a_small_change_does_not(self):
        touches = [touch()]
        law = started("wong-zhu", touches)
        touches[0].tangential = 0.65
        assert wanted(law, touches, DT, DT)[0].reason is GripReason.NONE


class TestFrictionMargin:
    def test_the_target_is_the_margin_times_the_least_force(self):
        touches = [touch(normal=2.0, tangential=0.9)]
        (wish,) = wanted(started("friction-margin", touches), touches, DT, DT)
        assert wish.scale == pytest.approx(MARGIN * 0.9 / 0.45 / 2.0)  # 0.45 holds: it is known
        assert wish.reason is GripReason.MARGIN

    def test_a_slip_lowers_the_friction(self):
        touches = [touch(normal=2.0, tangential=1.0)]
        law = started("friction-margin", touches)
        wanted(law, touches, DT, DT)
        touches[0].probability, touches[0].tangential = 0.1, 0.8
        (wish,) = wanted(law, touches, 2 * DT, DT)
        assert wish.scale == pytest.approx(MARGIN * 0.8 / (0.9 * 0.4) / 2.0)

    def test_it_falls_by_5_percent_at_most(self):
        touches = [touch(tangential=0.01)]
        (wish,) = wanted(started("friction-margin", touches), touches, DT, DT)
        assert wish == (0.95, GripReason.RELAX)
        assert FIRST_FRICTION < 0.5


class TestStability:
    def settled(self, touches):
        """A law whose first second, of a quiet grip, is over."""
        law = started("holdfast", touches)
        unstable, touches[0].probability = touches[0].probability, 0.95
        wanted(law, touches, -1.0, 1.0)
        touches[0].probability = unstable
        return law

    def test_a_load_that_grows_is_followed_before_anything_slips(self):
        touches = [touch()]
        law = self.settled(touches)
        touches[0].tangential = 0.9
        for k in range(1, 60):
            (wish,) = wanted(law, touches, k * DT, DT)
        assert wish.scale == pytest.approx(1.5, rel=0.01)
        assert wish.reason is GripReason.LOAD

    def test_the_step_grows_with_lack_of_probability_and_with_sigma(self):
        def step(probability, instability):
            touches = [touch(probability=probability, instability=instability)]
            return wanted(started("holdfast", touches), touches, DT, DT)[0].scale

        assert 1.0 < step(0.4, 0.0) < step(0.1, 0.0) < step(0.1, 0.1)
        assert step(0.1, math.nan) == step(0.1, 0.0)

    def test_no_second_step_in_the_dead_time(self):
        touches = [touch(probability=0.0)]
        law = started("holdfast", touches)
        (first,) = wanted(law, touches, 0.0, DT)
        touches[0].scale = first.scale
        (dead,) = wanted(law, touches, 0.05, DT)
        assert dead.scale == first.scale
        (second,) = wanted(law, touches, 0.1, DT)
        assert second.scale > first.scale

    def test_friction_that_dropped_is_remembered_and_forgotten(self):
        touches = [touch()]
        law = self.settled(touches)
        touches[0].probability, touches[0].tangential = 0.0, 0.4
        wanted(law, touches, 0.0, DT)
        touches[0].probability, touches[0].scale = 0.95, 1.1
        (after,) = wanted(law, touches, 0.2, DT)
        assert after.scale > 1.1
        touches[0].scale = after.scale
        for k in range(3000):
            (later,) = wanted(law, touches, 0.2 + k * DT, DT)
        assert later.scale < 0.8

    def test_a_load_that_someone_else_carries_at_first_is_no_reaction(self):
        """The ratio of the grip is measured while the object is handed over."""
        touches = [touch(tangential=0.05)]
        law = started("holdfast", touches)
        for k in range(300):
            touches[0].tangential = min(0.05 + 0.01 * k, 0.6)
            (wish,) = wanted(law, touches, k * DT, DT)
            assert wish.scale <= 1.001

    def test_a_finger_without_contact_is_pressed(self):
        touches = [touch()]
        touches[0].touching = False
        (wish,) = wanted(started("holdfast", touches), touches, DT, DT)
        assert wish.reason is GripReason.UNSTABLE
