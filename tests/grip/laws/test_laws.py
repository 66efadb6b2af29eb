import math
from typing import NamedTuple

import pytest

from holdfast.contact import Cause
from holdfast.grip import LAWS, GripReason
from holdfast.grip.laws import Touch, law_named
from holdfast.grip.laws.friction_margin import FORCE_MARGIN

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

    def test_a_vibration_raises_all_fingers(self):
        last = self.shaken(0.1)[-1]
        assert [tuple(wish) for wish in last] == [(1.3, GripReason.SLIP)] * 2

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
        assert one == (1.3, GripReason.SLIP)
        assert other == (1.0, GripReason.NONE)

    def test_a_small_change_does_not(self):
        touches = [touch()]
        law = started("wong-zhu", touches)
        touches[0].tangential = 0.62
        assert wanted(law, touches, DT, DT)[0].reason is GripReason.NONE


class TestFrictionMargin:
    def test_the_target_is_the_margin_times_the_least_force(self):
        touches = [touch(normal=2.0, tangential=1.2)]
        (wish,) = wanted(started("friction-margin", touches), touches, DT, DT)
        assert wish.scale == pytest.approx(FORCE_MARGIN * 1.2 / 0.6 / 2.0)  # 0.6 holds: it is known
        assert wish.reason is GripReason.MARGIN

    def test_a_slip_lowers_the_friction(self):
        touches = [touch(normal=2.0, tangential=1.4)]
        law = started("friction-margin", touches)
        wanted(law, touches, DT, DT)
        touches[0].probability, touches[0].tangential = 0.1, 1.2
        (wish,) = wanted(law, touches, 2 * DT, DT)
        assert wish.scale == pytest.approx(FORCE_MARGIN * 1.2 / (0.9 * 0.6) / 2.0)

    def test_it_falls_by_5_percent_at_most(self):
        touches = [touch(tangential=0.01)]
        (wish,) = wanted(started("friction-margin", touches), touches, DT, DT)
        assert wish == (0.95, GripReason.RELAX)


class TestStability:
    def calm(self, *touches, seconds=0.5):
        """A law after a time in which the grip was calm, and the time of the last update."""
        law = started("holdfast", touches)
        for k in range(round(seconds / DT)):
            wanted(law, touches, k * DT, DT)
        return law, seconds

    def test_a_load_that_grows_is_followed_before_anything_slips(self):
        one = touch()
        law, time = self.calm(one)
        one.tangential, one.probability = 0.9, 0.5
        for k in range(1, 60):
            (wish,) = wanted(law, [one], time + k * DT, DT)
        assert wish.scale == pytest.approx(1.5, rel=0.01)
        assert wish.reason is GripReason.LOAD

    def test_a_load_that_someone_else_carries_at_first_is_no_reaction(self):
        """The calm grip is followed while the object is handed over."""
        one = touch(tangential=0.05)
        law = started("holdfast", [one])
        for k in range(300):
            one.tangential = min(0.05 + 0.01 * k, 0.6)
            (wish,) = wanted(law, [one], k * DT, DT)
            assert wish.scale <= 1.001

    def test_the_step_grows_with_lack_of_probability_and_with_sigma(self):
        def step(probability, instability):
            touches = [touch(probability=probability, instability=instability)]
            return wanted(started("holdfast", touches), touches, DT, DT)[0].scale

        assert 1.0 < step(0.25, 0.0) < step(0.1, 0.0) < step(0.1, 0.1)
        assert step(0.1, math.nan) == step(0.1, 0.0)

    def test_no_second_step_while_the_first_one_shakes_the_contact(self):
        one = touch(probability=0.0)
        law = started("holdfast", [one])
        (first,) = wanted(law, [one], 0.0, DT)
        one.scale = first.scale
        one.probability = 0.19  # as a step without slip leaves it
        assert wanted(law, [one], 0.1, DT)[0].scale <= first.scale
        one.probability = 0.01
        assert wanted(law, [one], 0.15, DT)[0].scale <= first.scale
        assert wanted(law, [one], 0.3, DT)[0].scale > first.scale

    def test_an_episode_multiplies_the_force_by_its_factor_at_most(self):
        one = touch(probability=0.1)
        law = started("holdfast", [one])
        for k in range(150):
            (wish,) = wanted(law, [one], k * DT, DT)
            one.scale = max(one.scale, wish.scale)
        assert one.scale == pytest.approx(law.most)

    def test_stable_fingers_support_the_one_that_slips(self):
        one, other = touch(probability=0.0), touch(name="middle", probability=0.6)
        first, second = wanted(started("holdfast", [one, other]), [one, other], DT, DT)
        assert first.scale - 1.0 > second.scale - 1.0 > 0.8 * (first.scale - 1.0)
        assert first.reason is second.reason is GripReason.UNSTABLE

    def test_a_finger_that_is_unstable_alone_must_be_so_for_some_time(self):
        touches = [touch(probability=0.1), *(touch(name=name) for name in ("a", "b", "c"))]
        law = started("holdfast", touches)
        scales = [wanted(law, touches, k * DT, DT)[0].scale for k in range(20)]
        first = next(k for k, scale in enumerate(scales) if scale > 1.0)
        assert first * DT == pytest.approx(law.alone_time, abs=2 * DT)

    def test_fingers_with_much_of_the_load_start_a_reaction_at_once(self):
        thumb, other = touch(name="thumb", probability=0.1), touch()
        law = started("holdfast", [thumb, other])
        assert wanted(law, [thumb, other], 0.0, DT)[0].scale > 1.0

    def test_a_slip_starts_a_reaction_whatever_the_stability(self):
        one = touch(probability=0.9)
        one.slides, one.slip_probability = True, 0.2
        (wish,) = wanted(started("holdfast", [one]), [one], 0.0, DT)
        assert wish.scale > 1.0 and wish.reason is GripReason.UNSTABLE
        one.slides = False
        (wish,) = wanted(started("holdfast", [one]), [one], 0.0, DT)
        assert wish.scale == 1.0

    def test_a_more_probable_slip_gives_a_larger_step(self):
        def step(probability):
            one = touch(probability=0.9)
            one.slides, one.slip_probability = True, probability
            return wanted(started("holdfast", [one]), [one], 0.0, DT)[0].scale

        assert step(0.2) < step(0.6) < step(1.0)

    def test_all_fingers_that_are_a_little_restless_start_a_reaction_together(self):
        """Where friction falls, all contacts slide smoothly: no finger alone is unstable."""
        names = ("thumb", "index", "middle")

        def last_scale(tangential, probabilities):
            touches = [touch(name=name, probability=0.9) for name in names]
            law = started("holdfast", touches)
            for one, probability in zip(touches, probabilities, strict=True):
                one.tangential, one.probability = tangential, probability
            return [wanted(law, touches, k * DT, DT)[0].scale for k in range(9)][-1]

        assert last_scale(0.5, [0.6] * 3) > 1.3
        assert last_scale(0.6, [0.6] * 3) == 1.0, "it carries what it carried before"
        assert last_scale(0.5, [0.9, 0.6, 0.6]) == 1.0, "a third of the load is calm"

    def test_after_a_slip_the_floor_follows_the_load(self):
        """At the friction that the slip has shown, half of the load needs half of the force."""
        one = touch(normal=2.0, tangential=1.0)
        one.slides, one.slip_probability = True, 0.9
        law = started("holdfast", [one])
        (wish,) = wanted(law, [one], 0.0, DT)
        one.scale, one.slides, one.slip_probability = wish.scale, False, 0.0
        one.normal = 2.0 * one.scale

        def settled(seconds, start):
            for k in range(round(seconds / DT)):
                one.scale = min(one.scale, wanted(law, [one], start + k * DT, DT)[0].scale)
                one.normal = 2.0 * one.scale
            return one.scale

        assert settled(2.0, DT) == pytest.approx(1.15, rel=0.15)
        one.tangential = 0.3
        assert settled(2.0, 2.0 + DT) == 1.0

    def test_a_finger_that_carries_nothing_starts_no_reaction(self):
        one, idle = touch(), touch(name="middle", normal=0.01, probability=0.0)
        idle.start_normal = 0.01
        for wish in wanted(started("holdfast", [one, idle]), [one, idle], DT, DT):
            assert wish.scale == 1.0

    @pytest.mark.parametrize(
        ("cause", "floor"), [(Cause.SLIP, 1.15), (Cause.LOST, 1.15), (Cause.DISTURBANCE, 1.0)]
    )
    def test_after_a_slip_the_force_stays_above_that_of_the_slip(self, cause, floor):
        one = touch(probability=0.0)
        one.cause = cause
        law = started("holdfast", [one])
        (wish,) = wanted(law, [one], 0.0, DT)
        one.scale, one.probability, one.cause = wish.scale, 0.95, None
        lowest = one.scale
        for k in range(1, 200):
            one.scale = min(one.scale, wanted(law, [one], k * DT, DT)[0].scale)
            lowest = min(lowest, one.scale)
        assert floor * 0.7 < lowest <= floor
        assert (lowest > 1.0) == (floor > 1.0) or lowest == 1.0

    def test_a_finger_without_contact_is_pressed(self):
        one = touch()
        one.touching = False
        (wish,) = wanted(started("holdfast", [one]), [one], DT, DT)
        assert wish.reason is GripReason.UNSTABLE
