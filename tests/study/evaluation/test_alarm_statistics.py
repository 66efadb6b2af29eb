import math

import numpy as np
import pytest

from holdfast.contact import STABLE, UNSTABLE
from holdfast.metrics import FingerDecisions
from holdfast.study.evaluation.alarm_statistics import (
    SlipInterval,
    alarm_statistics,
    find_slips,
    is_after_jump,
)
from study.example_recordings import GLITCH, truth_of

TIMES = np.arange(1725) / 150
TRUTH = truth_of(TIMES, ("thumb", "index"))


def hand(labels, states):
    return FingerDecisions(TIMES, labels, states, np.full(len(TIMES), np.nan))


def where(*spans):
    """Stable but in those spans [s]."""
    inside = np.any([(a - 1e-9 <= TIMES) & (b - 1e-9 > TIMES) for a, b in spans], axis=0)
    return np.where(inside, UNSTABLE, STABLE)


def test_a_slip_begins_after_half_a_second_of_rest():
    (slip,) = find_slips(TRUTH)
    assert slip.onset == pytest.approx(5.6)
    assert slip.end == pytest.approx(5.9 - 1 / 150)
    assert find_slips(None) == []


def test_the_delay_of_a_slip_counts_from_its_onset():
    slip = SlipInterval(5.6, 5.9)
    labels = where((5.3, 6.5))
    cases = {(5.65, 5.7): 0.05, (5.0, 5.61): 0.0, (5.95, 6.5): math.inf, (5.88, 6.0): 0.28}
    for span, delay in cases.items():
        found = alarm_statistics(hand(labels, where(span)), TRUTH, [slip])
        assert found.slip_delays == [pytest.approx(delay, abs=0.007)]
    assert (
        alarm_statistics(hand(labels, where((5.64, 5.7))), TRUTH, [slip]).n_slips_found(0.05) == 1
    )
    assert (
        alarm_statistics(hand(labels, where((5.66, 5.7))), TRUTH, [slip]).n_slips_found(0.05) == 0
    )


def test_a_short_slip_can_be_found_for_a_fifth_of_a_second():
    found = alarm_statistics(
        hand(where((5.3, 6.5)), where((5.78, 6.0))), TRUTH, [SlipInterval(5.6, 5.62)]
    )
    assert found.n_slips_found(0.2) == 1
    assert found.n_slips_found(0.1) == 0


def test_kinds_of_false_alarms_are_counted():
    """One in a stable hold, one just after the jump, one without a label."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((0.5, 0.6), (3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    found = alarm_statistics(hand(labels, states), TRUTH, [])
    assert found.delays == [pytest.approx(0.02)]
    assert (found.n_false_alarms, found.n_under_stable, found.n_after_jump) == (3, 2, 1)
    assert found.stable_seconds == pytest.approx(1725 / 150 - 3.2)
    assert found.n_missed(0.05) == 0
    assert found.n_not_called_stable == 15 + 7
    assert found.n_stable == 1725 - 480


def test_a_jump_has_effect_for_a_tenth_of_a_second():
    times = np.array([GLITCH - 0.01, GLITCH, GLITCH + 0.1, GLITCH + 0.11])
    assert is_after_jump(times, TRUTH).tolist() == [False, True, True, False]
    assert not is_after_jump(times, None).any()
