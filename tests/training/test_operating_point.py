"""Thresholds that are chosen on own handling."""

import numpy as np
import pytest

from detection.detector.build import finger_model, slip_head
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN
from holdfast.detection import Debounce
from holdfast.errors import TrainingError
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.training.operating_point import (
    STABLE_SHARE,
    GraspingFinger,
    GraspingFingers,
    choose_operating_point,
)
from holdfast.training.replay import ThresholdReplay

RATE = 100.0


def part(threshold=0.5, slip=None):
    made = finger_model(threshold=threshold)
    return made if slip is None else made.with_heads(slip_head(made.features, threshold=slip))


def held_finger(probability, slips=None, *, hold=0.0, states=None, name="thumb"):
    """Return a finger that is in contact, with these probabilities of stability and of a slip."""
    n = len(probability)
    times, touching = np.arange(n) / RATE, np.full(n, STABLE, dtype=np.int8)
    states = touching if states is None else np.asarray(states, dtype=np.int8)
    slip = None
    if slips is not None:
        slip = SlipDecisions(times, np.asarray(slips), np.zeros(n, dtype=bool), 0.0, None)
    finger = FingerDecisions(times, np.zeros(n), states, np.asarray(probability), slip=slip)
    raw = Decisions("made", {name: finger}, finger)
    replay = ThresholdReplay(raw, Debounce(hold=hold), 1 / RATE, 1)
    return GraspingFinger(name, replay, states == STABLE)


def handling(*args, **options):
    return GraspingFingers([held_finger(*args, **options)])


def logistic(values):
    return 1 / (1 + np.exp(-np.asarray(values)))


SPREAD = logistic(np.random.default_rng(0).normal(0.5, 1.0, size=3000))


def test_a_share_of_the_handling_is_stable():
    held = handling(SPREAD)
    point = choose_operating_point(held, part())
    assert point.keys() == {"stable"}
    assert held.stable_share(point["stable"]) >= STABLE_SHARE
    assert held.stable_share(point["stable"] * 1.2) < STABLE_SHARE


def test_the_hold_time_of_the_model_counts():
    steady, held = (choose_operating_point(handling(SPREAD, hold=s), part()) for s in (0.0, 0.1))
    assert held["stable"] < steady["stable"]


@pytest.mark.parametrize("usual", [0.1, 0.4321])
def test_it_is_at_most_the_threshold_of_the_model(usual):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    assert choose_operating_point(handling(calm), part(usual))["stable"] == usual


@pytest.mark.parametrize(("usual", "highest"), [(0.1, 0.9), (0.95, 0.95)])
def test_handling_that_moves_may_raise_it(usual, highest):
    calm = logistic(np.random.default_rng(1).normal(6.0, 0.5, size=500))
    chosen = choose_operating_point(handling(calm), part(usual), moves=True)
    assert chosen["stable"] == pytest.approx(highest)


def test_a_tenth_of_slip_does_not_move_it_to_the_slip():
    rng = np.random.default_rng(2)
    mixed = np.concatenate([rng.normal(1.0, 1.0, size=1700), rng.normal(-12.0, 1.0, size=300)])
    point = choose_operating_point(handling(logistic(mixed)), part())
    assert np.mean(logistic(mixed[:1700]) >= point["stable"]) > 0.97
    assert np.mean(logistic(mixed[1700:]) >= point["stable"]) == 0.0


def test_slips_are_reported_seldom():
    slips = logistic(np.random.default_rng(3).normal(-1.0, 1.0, size=2000))
    held = handling(np.full(2000, 0.9), slips)
    point = choose_operating_point(held, part(slip=0.3))
    assert held.raised_share(point["slip"]) <= 0.05 < held.raised_share(0.3)
    assert choose_operating_point(held, part(slip=0.9))["slip"] == 0.9


def test_a_slip_in_it_does_not_silence_the_slip_rule():
    rng = np.random.default_rng(4)
    slips = logistic(
        np.concatenate([rng.normal(-2.0, 0.6, size=1700), rng.normal(4.0, 0.5, size=300)])
    )
    point = choose_operating_point(handling(np.full(2000, 0.9), slips), part(slip=0.3))
    assert np.mean(slips[1700:] >= point["slip"]) == 1.0


def test_false_alarms_are_counted_per_minute_of_holding():
    probability = np.full(6000, 0.9)  # one minute
    probability[1000:1010], probability[2000:2010], probability[3000:3010] = 0.05, 0.2, 0.4
    held = handling(probability)
    assert [held.alarms_per_minute(t) for t in (0.01, 0.1, 0.3, 0.5)] == [0, 1, 2, 3]
    for alarms, low, high in ((0, 0.0, 0.05), (1, 0.05, 0.2), (2, 0.2, 0.4), (3, 0.4, 0.5)):
        chosen = choose_operating_point(held, part(), float(alarms))["stable"]
        assert low < chosen <= high


def test_two_fingers_have_more_alarms_in_the_same_time():
    probability = np.full(6000, 0.9)
    probability[1000:1010] = 0.05
    both = GraspingFingers([held_finger(probability), held_finger(probability, name="index")])
    assert (both.seconds, both.alarms_per_minute(0.5)) == (pytest.approx(60.0), 2.0)
    parts = GraspingFingers([held_finger(probability), held_finger(probability)])
    assert (parts.seconds, parts.alarms_per_minute(0.5)) == (pytest.approx(120.0), 1.0)


def test_an_alarm_at_the_release_is_right():
    states = np.repeat([STABLE, NO_CONTACT, STABLE, UNKNOWN], [1000, 500, 1000, 500])
    probability = np.full(3000, 0.9)
    probability[990:1000] = probability[1500:1510] = probability[2490:2500] = 0.01
    assert held_finger(probability, states=states).n_alarms(0.5) == 0
    probability[500:510] = 0.01
    assert held_finger(probability, states=states).n_alarms(0.5) == 1


def test_reported_slips_are_counted_too():
    slips = np.full(6000, 0.1)
    slips[1000:1010], slips[2000:2010] = 0.8, 0.95
    held = handling(np.full(6000, 0.9), slips)
    assert [held.slips_per_minute(t) for t in (0.5, 0.9, 0.99)] == [2, 1, 0]
    chosen = [choose_operating_point(held, part(slip=0.5), n)["slip"] for n in (2.0, 1.0)]
    assert chosen[0] == 0.5
    assert 0.8 < chosen[1] <= 0.95


def test_too_many_alarms_are_refused():
    probability = np.full(6000, 0.9)
    probability[::100] = 1e-9
    with pytest.raises(TrainingError, match="the least is 59"):
        choose_operating_point(handling(probability), part(), 1.0)
    slips = np.full(6000, 0.1)
    slips[100::100] = 1.0
    with pytest.raises(TrainingError, match="least is 59"):
        choose_operating_point(handling(np.full(6000, 0.9), slips), part(slip=0.5), 0.0)
