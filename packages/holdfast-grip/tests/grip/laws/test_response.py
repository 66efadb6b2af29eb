import math

import pytest

from grip.laws.test_laws import DT, started, touch, update
from holdfast_grip import GripReason
from holdfast_grip.laws.response import PROBE_RISE, ResponseTimer
from holdfast_grip.laws.stability import RESERVE


def knowing(**fields):
    one = touch(**fields)
    one.knows_slips = True
    return one


def held(delay, seconds=0.6, law=None, one=None, gain=1.0, start=0.0):
    """A law whose hand responds after a delay; its targets."""
    one = one or knowing()
    law = law or started("holdfast", [one])
    targets, commands = [], []
    for k in range(1, round(seconds / DT) + 1):
        (target,) = update(law, [one], start + k * DT, DT)
        targets.append(target)
        commands.append(target.scale)
        one.scale = target.scale
        late = k - 1 - round(delay / DT)
        one.normal = 2.0 * (1.0 + gain * ((commands[late] if late >= 0 else 1.0) - 1.0))
    return law, one, targets


class TestTimer:
    def test_it_is_the_time_to_half_of_the_rise(self):
        timer = ResponseTimer()
        timer.begin(1.0, 2.0)
        done = [timer.update(1.0 + k * DT, 2.0 + min(k * DT, 0.1)) for k in range(40)]
        assert sum(done) == 1 and not timer.running
        assert timer.result == pytest.approx(0.05, abs=DT)

    def test_a_force_that_does_not_rise_has_no_response(self):
        timer = ResponseTimer()
        timer.begin(0.0, 2.0)
        assert sum(timer.update(k * DT, 2.01) for k in range(40)) == 1
        assert math.isnan(timer.result)


class TestLaw:
    @pytest.mark.parametrize("delay", [2 * DT, 6 * DT, 10 * DT])
    def test_a_small_rise_at_the_start_measures_the_hand(self, delay):
        law, _, targets = held(delay)
        assert law.response.time == pytest.approx(delay, abs=2.5 * DT)
        assert not law.notice
        assert max(target.scale for target in targets[:35]) == 1.0 + PROBE_RISE
        assert {target.reason for target in targets} <= {
            GripReason.MARGIN, GripReason.RELAX, GripReason.NONE,
        }  # fmt: skip

    def test_a_slow_hand_keeps_a_reserve(self):
        law, _, targets = held(9 * DT, seconds=2.0)
        assert targets[-1].scale == pytest.approx(1.0 + RESERVE * law.response.time)

    def test_a_hand_that_does_not_follow_is_told_once(self):
        law, _, targets = held(0.0, gain=0.0)
        assert "did not follow" in law.notice
        assert law.response.time == 0.0
        assert targets[-1].scale <= 1.0 + PROBE_RISE

    def test_a_slide_at_the_start_is_told(self):
        one = knowing()
        law = started("holdfast", [one])
        one.slides, one.slip_probability = True, 0.9
        update(law, [one], DT, DT)
        assert "something slid" in law.notice

    def test_a_response_that_changes_twice_is_told(self):
        law, _, _ = held(3 * DT)
        for _ in range(2):
            law.response.take(0.11)
        assert "to 110 ms" in law.response.notice

    def test_a_model_without_a_slip_rule_gives_no_rise(self):
        law, _, targets = held(5 * DT, one=touch())
        assert {target.scale for target in targets} == {1.0} and law.response.time == 0.0


class TestTwoSpeeds:
    def calm(self, **fields):
        one = knowing(**fields)
        law, one, _ = held(5 * DT, seconds=2.0, one=one)
        return law, one

    def test_instability_with_load_gives_a_small_rise_first(self):
        law, one = self.calm()
        before = one.scale
        one.probability, targets = 0.85, []
        for k in range(1, 6):
            one.tangential += 0.04
            targets += update(law, [one], 2.0 + k * DT, DT)
            one.scale = max(one.scale, targets[-1].scale)
        assert {target.reason for target in targets} == {GripReason.LOAD, GripReason.RELAX}
        assert before < one.scale < before + 0.4

    def test_a_slip_gives_a_kick(self):
        law, one = self.calm()
        before = one.scale
        one.slides, one.slip_probability = True, 1.0
        (target,) = [update(law, [one], 2.0 + k * DT, DT)[0] for k in range(1, 4)][-1:]
        assert target.reason is GripReason.UNSTABLE and target.scale > before + 0.8
