import math

import numpy as np
import pytest

from holdfast.contact import STABLE, UNSTABLE
from holdfast.metrics import FingerDecisions
from holdfast_lab.study.evaluation.alarm_statistics import alarm_statistics, near_glitch
from study.example_recordings import GLITCH

TIMES = np.arange(1725) / 150


def hand(labels, states):
    return FingerDecisions(TIMES, labels, states, np.full(len(TIMES), np.nan))


def inside(*spans):
    return np.any([(a - 1e-9 <= TIMES) & (b - 1e-9 > TIMES) for a, b in spans], axis=0)


def where(*spans):
    """Stable but in those spans [s]."""
    return np.where(inside(*spans), UNSTABLE, STABLE)


def test_events_at_whose_onset_the_hand_is_not_stable():
    """The events begin at 3 s and at 5.3 s."""
    labels = where((3.0, 3.2), (5.3, 6.5))
    found = alarm_statistics(hand(labels, where((2.9, 3.1), (5.31, 6.0))))
    assert found.delays == [math.inf, pytest.approx(0.0133, abs=1e-3)]
    assert found.n_events_not_stable == 1
    assert found.n_missed(0.05) == 1


GLITCHED = inside((GLITCH, GLITCH + 0.1))


def test_kinds_of_false_alarms_are_counted():
    """One in a stable hold, one of a glitch, one where the label is not stable."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((0.5, 0.6), (3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    found = alarm_statistics(hand(labels, states), GLITCHED)
    assert found.delays == [pytest.approx(0.02)]
    assert (found.n_false_alarms, found.n_under_stable, found.n_of_glitch) == (3, 2, 1)
    assert found.stable_seconds == pytest.approx(1725 / 150 - 3.2)
    assert found.n_not_called_stable == 15 + 7
    assert found.n_stable == 1725 - 480


def test_glitches_can_be_left_out():
    """With the alarm goes the time in which it would count."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    found = alarm_statistics(hand(labels, states), GLITCHED, without_glitches=True)
    assert (found.n_false_alarms, found.n_under_stable, found.n_of_glitch) == (1, 1, 0)
    n_near = int(near_glitch(TIMES, GLITCHED).sum())
    assert n_near == 3 + 15 + 38
    assert found.stable_seconds == pytest.approx((1725 - 480 - n_near) / 150)
    assert (found.n_stable, found.n_not_called_stable) == (1725 - 480 - n_near, 15)


def test_an_alarm_belongs_to_a_glitch_from_20_ms_before_it_to_250_ms_after_it():
    near = TIMES[near_glitch(TIMES, GLITCHED)]
    assert near[0] == pytest.approx(GLITCH - 0.02)
    assert near[-1] == pytest.approx(GLITCH + 0.35, abs=0.007)
    assert not near_glitch(TIMES, None).any()
    assert not near_glitch(np.empty(0), np.empty(0, dtype=bool)).any()
