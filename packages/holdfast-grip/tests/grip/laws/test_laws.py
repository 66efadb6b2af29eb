from typing import NamedTuple

import pytest

from holdfast.contact import Cause, ContactEstimate, ContactState, Reason
from holdfast_grip import LAWS, GripReason
from holdfast_grip.laws import Touch, law_named
from holdfast_grip.laws.friction_margin import FORCE_MARGIN, FrictionMargin
from holdfast_grip.laws.pr2 import Pr2
from holdfast_grip.laws.relaxation import RELAXATION_MARGIN, RELAXATION_SETTLE_TIME
from holdfast_grip.laws.stability import MARGIN, REFRACTORY, START_TIME
from holdfast_grip.laws.wong_zhu import WongZhu

DT = 1 / 150


def touch(normal=2.0, tangential=0.6, probability=0.95, name="index"):
    made = Touch(name)
    made.known = made.touching = True
    made.probability = probability
    made.force, made.normal, made.tangential = (normal, tangential, 0.0), normal, tangential
    made.start_normal = 2.0
    return made


@pytest.mark.parametrize("reports_slips", [True, False])
def test_a_slip_rule_that_reports_no_slip_is_none(reports_slips):
    made = Touch("index", reports_slips=reports_slips)
    made.read(
        ContactEstimate(0.0, ContactState.STABLE, Reason.NONE, 0.9, 0.0, (2, 0, 0),
                        slip_probability=0.8, cause=Cause.SLIP)
    )  # fmt: skip
    assert (made.knows_slips, made.slides) == (reports_slips, reports_slips)
    assert made.slip_probability == (0.8 if reports_slips else 0.0)


def started(name, touches, thumb=-1):
    """A law whose grip is not new any more at time 0."""
    law = law_named(name)
    law.start(touches, thumb)
    law.targets(touches, -START_TIME, 0.0)
    return law


class Target(NamedTuple):
    scale: float
    reason: GripReason


def update(law, touches, time, dt):
    return [Target(*target) for target in law.targets(touches, time, dt)]


@pytest.mark.parametrize("name", sorted(LAWS))
def test_a_quiet_grip_wants_no_rise(name):
    touches = [touch()]
    if name == "friction-margin":
        touches[0].scale = 2.0  # its margin for a friction of 0.3 is more than this grip has
    law = started(name, touches)
    for k in range(300):
        (target,) = update(law, touches, k * DT, DT)
        assert target.scale <= touches[0].scale


def shake(touches):
    """Shake the first finger once."""
    x, y, z = touches[0].force
    touches[0].force, touches[0].tangential = (x, y + 1.0, z), touches[0].tangential + 1.0


RELAXING = [
    (Pr2(fall=0.2), shake),
    (WongZhu(fall=0.2), shake),
    (WongZhu(fall=0.2, together=True), shake),
]


class TestRelaxation:
    def after_a_slip(self, law, slip, scale=2.0):
        """Return fingers of a grip that slipped at a scale, and calmed down at once."""
        touches = [touch(), touch(name="thumb")]
        for one in touches:
            one.scale, one.normal, one.tangential = scale, 2.0 * scale, 0.6 * scale
        law.start(touches, -1)
        before = [(one.force, one.tangential) for one in touches]
        slip(touches)
        assert any(target.scale > scale for target in update(law, touches, 0.0, DT))
        for one, (force, tangential) in zip(touches, before, strict=True):
            one.force, one.tangential = force, tangential
            one.slides, one.slip_probability = False, 0.0
        return touches

    def calm(self, law, touches, seconds, start=0.0):
        for k in range(1, round(seconds / DT) + 1):
            targets = update(law, touches, start + k * DT, DT)
            for one, target in zip(touches, targets, strict=True):
                one.scale = min(target.scale, one.scale)
        return [one.scale for one in touches]

    @pytest.mark.parametrize(("law", "slip"), RELAXING)
    def test_the_force_falls_in_calm_after_the_settle_time(self, law, slip):
        touches = self.after_a_slip(law, slip, scale=2.0)
        for one in touches:
            one.scale = 3.0
        assert self.calm(law, touches, RELAXATION_SETTLE_TIME / 2)[0] == 3.0
        (scale, _) = self.calm(law, touches, 0.75, start=RELAXATION_SETTLE_TIME / 2)
        assert 2.5 < scale < 3.0

    @pytest.mark.parametrize(("law", "slip"), RELAXING)
    def test_it_stays_above_the_force_of_the_last_slip(self, law, slip):
        touches = self.after_a_slip(law, slip, scale=1.4)
        touches[0].scale = 3.0
        assert self.calm(law, touches, 20.0)[0] == pytest.approx(RELAXATION_MARGIN * 1.4)

    @pytest.mark.parametrize("kind", [Pr2, WongZhu])
    def test_without_a_fall_the_force_stays_and_a_new_grip_forgets_the_slip(self, kind):
        law = kind(fall=0.0)
        assert self.calm(law, self.after_a_slip(law, shake), 5.0) == [2.0, 2.0]
        law = kind(fall=0.2)
        self.after_a_slip(law, shake)
        touches = [touch(), touch(name="thumb")]
        law.start(touches, -1)
        for one in touches:
            one.scale = 2.0
        assert self.calm(law, touches, 20.0) == [1.0, 1.0]


class TestPr2:
    def shaken(self, amplitude, slow=0.0):
        touches = [touch(), touch(name="thumb")]
        law, targets = Pr2(gain=1.3, threshold_factor=1.0), []
        law.start(touches, -1)
        for k in range(60):
            normal = 2.0 + slow * k * DT
            touches[0].force = (normal, 0.6 + amplitude * (-1) ** k, 0.0)
            touches[0].normal = normal
            targets.append(update(law, touches, k * DT, DT))
        return targets

    def test_a_vibration_above_the_threshold_raises_all_fingers(self):
        assert self.shaken(0.1)[-1] == [(1.3, GripReason.SLIP)] * 2
        assert all(one.scale == 1.0 for targets in self.shaken(0.01) for one in targets)

    def test_the_factor_raises_the_threshold(self):
        def rises(factor):
            touches = [touch()]
            law = Pr2(threshold_factor=factor)
            law.start(touches, -1)
            touches[0].force = (2.0, 0.7, 0.0)
            return update(law, touches, DT, DT)[0].scale > 1.0

        assert rises(1.0) and not rises(3.0)

    def test_a_force_that_changes_slowly_is_no_slip(self):
        assert self.shaken(0.1, slow=5.0)[-1][0].reason is GripReason.NONE


class TestWongZhu:
    @pytest.mark.parametrize(
        ("together", "tangential", "rise"),
        [(False, 0.67, [1.3, 1.0]), (True, 0.67, [1.3, 1.3]), (False, 0.62, [1.0, 1.0])],
    )
    def test_a_jump_of_the_tangential_force_raises(self, together, tangential, rise):
        touches = [touch(), touch(name="thumb")]
        law = WongZhu(threshold=0.05, gain=1.3, together=together)
        law.start(touches, -1)
        touches[0].tangential = tangential
        reasons = [GripReason.SLIP if scale > 1.0 else GripReason.NONE for scale in rise]
        assert update(law, touches, DT, DT) == list(zip(rise, reasons, strict=True))


class TestFrictionMargin:
    def test_the_target_is_the_margin_times_the_least_force(self):
        touches = [touch(normal=2.0, tangential=1.2)]
        (target,) = update(started("friction-margin", touches), touches, DT, DT)
        assert target.scale == pytest.approx(FORCE_MARGIN * 1.2 / 0.6 / 2.0)  # 0.6 is known to hold
        assert target.reason is GripReason.MARGIN

    def test_a_slip_lowers_the_friction(self):
        touches = [touch(normal=2.0, tangential=1.4)]
        law = started("friction-margin", touches)
        update(law, touches, DT, DT)
        touches[0].probability, touches[0].tangential = 0.1, 1.2
        (target,) = update(law, touches, 2 * DT, DT)
        assert target.scale == pytest.approx(FORCE_MARGIN * 1.2 / (0.9 * 0.6) / 2.0)

    def target(self, law, tangential):
        touches = [touch(tangential=tangential)]
        law.start(touches, -1)
        return update(law, touches, DT, DT)[0]

    def test_it_falls_by_5_percent_at_most(self):
        assert self.target(FrictionMargin(fall=100.0), 0.01) == (0.95, GripReason.RELAX)
        assert self.target(FrictionMargin(fall=0.2), 0.01).scale == pytest.approx(1 - 0.2 * DT)


class TestStability:
    def scale_after(self, law, touches, seconds, start=0.0):
        """Return the scale after a time in which the hand follows each target at once."""
        for k in range(1, round(seconds / DT) + 1):
            (target, *others) = update(law, touches, start + k * DT, DT)
            assert all(other == target for other in others), "one scale for the hand"
            for one in touches:
                one.normal *= target.scale / one.scale
                one.scale = target.scale
        return touches[0].scale

    def test_a_load_that_grows_is_followed_before_anything_slips(self):
        one = touch()
        law = started("holdfast", [one])
        self.scale_after(law, [one], 0.5)
        one.probability = 0.83
        for k in range(1, 20):
            one.tangential = 0.6 + 0.03 * min(k, 10)
            (target,) = update(law, [one], 0.5 + k * DT, DT)
            if target.scale > 1.0:
                break
        assert target.scale > 1.2
        assert target.reason is GripReason.LOAD

    def step(self, probability, scale=1.0, slip=None):
        """Return the rise at the second sample; `slip` is the probability of a slide."""
        one = touch(probability=probability)
        law = started("holdfast", [one])
        one.scale, one.slides, one.slip_probability = scale, slip is not None, slip or 0.0
        return [update(law, [one], k * DT, DT)[0].scale for k in range(2)][-1] - scale

    def test_the_step_grows_with_the_doubt_and_with_the_probability_of_a_slip(self):
        assert 0.0 < self.step(0.1) < self.step(0.05) < self.step(0.0)
        assert self.step(0.9, slip=0.2) < self.step(0.9, slip=0.6) < self.step(0.9, slip=1.0)

    def test_a_hand_that_presses_more_takes_smaller_steps(self):
        assert self.step(0.0) == pytest.approx(2.0 * self.step(0.0, scale=2.0))

    def test_no_second_step_in_the_refractory_time(self):
        one = touch(probability=0.0)
        law = started("holdfast", [one])
        (first,) = update(law, [one], 0.0, DT)
        one.scale = first.scale
        times = [k * DT for k in range(1, 60)]
        second = next(time for time in times if update(law, [one], time, DT)[0].scale > one.scale)
        assert second > REFRACTORY

    @pytest.mark.parametrize(("fingers", "slowest"), [(1, 0.1), (4, 0.02)])
    def test_a_reaction_comes_the_sooner_the_more_of_the_load_slides(self, fingers, slowest):
        touches = [touch(name=name) for name in ("thumb", "index", "middle", "ring")]
        law = started("holdfast", touches)
        for one in touches[:fingers]:
            one.probability = 0.4
        scales = [update(law, touches, k * DT, DT)[0].scale for k in range(30)]
        first = next(k for k, scale in enumerate(scales) if scale > 1.0)
        assert slowest / 4 < first * DT + DT <= slowest

    def test_a_slip_starts_a_reaction_whatever_the_stability(self):
        one = touch(probability=0.95)
        one.slides, one.slip_probability = True, 0.2
        law = started("holdfast", [one])
        target = [update(law, [one], k * DT, DT)[0] for k in range(2)][-1]
        assert target.scale > 1.0 and target.reason is GripReason.UNSTABLE
        one.slides = False
        law = started("holdfast", [one])
        assert update(law, [one], 0.0, DT)[0].scale == 1.0

    def test_after_a_slip_the_floor_follows_the_load(self):
        """At the friction that the slip has shown, half of the load needs half of the force."""
        one = touch(normal=2.0, tangential=1.0, probability=0.0)
        one.slides, one.slip_probability = True, 0.9
        law = started("holdfast", [one])
        one.scale = update(law, [one], 0.0, DT)[0].scale
        one.slides, one.slip_probability, one.probability = False, 0.0, 0.95
        one.normal = 2.0 * one.scale
        assert self.scale_after(law, [one], 4.0) == pytest.approx(MARGIN, rel=0.2)
        one.tangential = 0.3
        assert self.scale_after(law, [one], 4.0, 4.0) == 1.0

    def test_a_floor_without_a_slip_rule_is_the_force_of_the_slip_and_the_margin(self):
        one = touch(probability=0.0)
        law = started("holdfast", [one])
        one.scale = update(law, [one], 0.0, DT)[0].scale
        one.probability = 0.95
        assert 1.0 < self.scale_after(law, [one], 4.0) <= MARGIN

    def test_a_hand_that_relaxes_raises_nothing(self):
        """Scales of single fingers needed a new balance again and again: 46 rises a minute."""
        touches = [touch(name=name, normal=n) for name, n in (("thumb", 3.0), ("index", 2.0))]
        law = started("holdfast", touches)
        for one in touches:
            one.scale = 2.0
        before = 2.0
        for k in range(450):
            scale = self.scale_after(law, touches, DT, k * DT)
            assert scale <= before
            before = scale
        assert before < 1.7

    def test_a_finger_that_carries_nothing_starts_no_reaction(self):
        one, idle = touch(), touch(name="middle", normal=0.01, probability=0.0)
        idle.start_normal = 0.01
        law = started("holdfast", [one, idle])
        assert self.scale_after(law, [one, idle], 1.0) == 1.0
