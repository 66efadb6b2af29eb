import math

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import FingerDecisions
from holdfast_lab.study.evaluation.alarm_statistics import alarm_statistics, near_glitch
from holdfast_lab.study.evaluation.slips import Slip
from study.example_recordings import GLITCH

TIMES = np.arange(1725) / 150
ENDS = np.array([5.6, 5.9])
SLIP = Slip(5.6, 5.9, False, ENDS, np.array([0.0, 3e-3]))
"""A slip at 10 mm/s."""


def hand(labels, states):
    return FingerDecisions(TIMES, labels, states, np.full(len(TIMES), np.nan))


def inside(*spans):
    return np.any([(a - 1e-9 <= TIMES) & (b - 1e-9 > TIMES) for a, b in spans], axis=0)


def where(*spans):
    """Stable but in those spans [s]."""
    return np.where(inside(*spans), UNSTABLE, STABLE)


LABELS = where((5.3, 6.5))


def slip_found(*spans, slip=SLIP):
    return alarm_statistics(hand(LABELS, where(*spans)), [slip])


@pytest.mark.parametrize(
    ("span", "delay", "distance"),
    [
        ((5.65, 5.7), 0.05, 0.5e-3),
        ((5.585, 5.7), -0.0133, 0.0),
        ((5.88, 6.0), 0.28, 2.8e-3),
        ((6.1, 6.5), 0.5, 3e-3),
        ((6.2, 6.5), math.inf, math.inf),
        ((5.5, 5.7), math.inf, math.inf),
    ],
)
def test_a_slip_is_detected_by_an_alarm_from_20_ms_before_it_to_250_ms_after_it(
    span, delay, distance
):
    found = slip_found(span)
    assert found.slip_delays == [pytest.approx(delay, abs=0.007)]
    assert found.slip_distances == [pytest.approx(distance, abs=0.07e-3)]


def test_a_hand_that_is_not_stable_before_the_slip_has_missed_it():
    """It counts as missed, stays among the slips, and is counted as already not stable."""
    found = slip_found((5.0, 6.5))
    assert (found.slip_delays, found.n_slips_not_stable) == ([math.inf], 1)
    assert found.n_slips_found(10.0) == 0
    again = slip_found((5.0, 5.62), (5.7, 6.0))
    assert again.slip_delays == [pytest.approx(0.1)]
    assert again.n_slips_not_stable == 1
    assert slip_found((5.65, 5.7)).n_slips_not_stable == 0


def test_a_change_to_unknown_is_no_alarm():
    states = np.where(inside((5.62, 5.7)), UNKNOWN, STABLE)
    found = alarm_statistics(hand(LABELS, states), [SLIP])
    assert (found.slip_delays, found.n_slips_not_stable) == ([math.inf], 0)


def test_a_slip_counts_up_to_a_time():
    assert slip_found((5.645, 5.7)).n_slips_found(0.05) == 1
    assert slip_found((5.65, 5.7)).n_slips_found(0.05) == 0
    short = Slip(5.6, 5.62, False, np.array([5.6, 5.62]), np.array([0.0, 2e-4]))
    late = slip_found((5.78, 6.0), slip=short)
    assert (late.n_slips_found(0.2), late.n_slips_found(0.1)) == (1, 0)
    assert late.slip_distances == [pytest.approx(2e-4)]


def test_events_at_whose_onset_the_hand_is_not_stable():
    """The events begin at 3 s and at 5.3 s."""
    labels = where((3.0, 3.2), (5.3, 6.5))
    found = alarm_statistics(hand(labels, where((2.9, 3.1), (5.31, 6.0))), [])
    assert found.delays == [math.inf, pytest.approx(0.0133, abs=1e-3)]
    assert found.n_events_not_stable == 1
    assert found.n_missed(0.05) == 1


GLITCHED = inside((GLITCH, GLITCH + 0.1))


def test_kinds_of_false_alarms_are_counted():
    """One in a stable hold, one of a glitch, one where the label is not stable."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((0.5, 0.6), (3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    found = alarm_statistics(hand(labels, states), [], GLITCHED)
    assert found.delays == [pytest.approx(0.02)]
    assert (found.n_false_alarms, found.n_under_stable, found.n_of_glitch) == (3, 2, 1)
    assert found.stable_seconds == pytest.approx(1725 / 150 - 3.2)
    assert found.n_not_called_stable == 15 + 7
    assert found.n_stable == 1725 - 480


def test_glitches_can_be_left_out():
    """With the alarm go the time in which it would count and the slip that a glitch caused."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    slips = [SLIP, SLIP._replace(onset=GLITCH, end=GLITCH + 0.1, of_glitch=True)]
    found = alarm_statistics(hand(labels, states), slips, GLITCHED, without_glitches=True)
    assert (found.n_false_alarms, found.n_under_stable, found.n_of_glitch) == (1, 1, 0)
    n_near = int(near_glitch(TIMES, GLITCHED).sum())
    assert n_near == 3 + 15 + 38
    assert found.stable_seconds == pytest.approx((1725 - 480 - n_near) / 150)
    assert (found.n_stable, found.n_not_called_stable) == (1725 - 480 - n_near, 15)
    assert len(found.slip_delays) == 1
    counted = alarm_statistics(hand(labels, states), slips, GLITCHED)
    assert len(counted.slip_delays) == 2


def test_an_alarm_belongs_to_a_glitch_from_20_ms_before_it_to_250_ms_after_it():
    near = TIMES[near_glitch(TIMES, GLITCHED)]
    assert near[0] == pytest.approx(GLITCH - 0.02)
    assert near[-1] == pytest.approx(GLITCH + 0.35, abs=0.007)
    assert not near_glitch(TIMES, None).any()
    assert not near_glitch(np.empty(0), np.empty(0, dtype=bool)).any()
