import math

import numpy as np
import pytest

from holdfast.contact import STABLE, UNSTABLE
from holdfast.metrics import FingerDecisions
from holdfast.study.evaluation.alarm_statistics import (
    SlipInterval,
    alarm_statistics,
    find_slips,
    follows_jump,
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


def test_latency_of_a_slip_counts_from_its_onset():
    slip = SlipInterval(5.6, 5.9)
    labels = where((5.3, 6.5))
    cases = {(5.65, 5.7): 0.05, (5.0, 5.61): 0.0, (5.95, 6.5): math.inf, (5.88, 6.0): 0.28}
    for span, latency in cases.items():
        heard = alarm_statistics(hand(labels, where(span)), TRUTH, [slip])
        assert heard.slips == [pytest.approx(latency, abs=0.007)]
    assert alarm_statistics(hand(labels, where((5.64, 5.7))), TRUTH, [slip]).n_found(0.05) == 1
    assert alarm_statistics(hand(labels, where((5.66, 5.7))), TRUTH, [slip]).n_found(0.05) == 0


def test_a_short_slip_may_be_told_until_a_fifth_of_a_second():
    heard = alarm_statistics(
        hand(where((5.3, 6.5)), where((5.78, 6.0))), TRUTH, [SlipInterval(5.6, 5.62)]
    )
    assert heard.n_found(0.2) == 1
    assert heard.n_found(0.1) == 0


def test_alarms_in_vain_are_told_apart():
    """One in a calm hold, one just after the glitch, one while nothing is known of stability."""
    labels = where((0.0, 2.0), (5.3, 6.5))
    states = where((0.5, 0.6), (3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    heard = alarm_statistics(hand(labels, states), TRUTH, [])
    assert heard.delays == [pytest.approx(0.02)]
    assert (heard.false_alarms, heard.under_stable, heard.follows_jump) == (3, 2, 1)
    assert heard.stable_seconds == pytest.approx(1725 / 150 - 3.2)
    assert heard.n_missed(0.05) == 0
    assert heard.n_doubted == 15 + 7
    assert heard.n_stable == 1725 - 480


def test_a_glitch_is_felt_for_a_tenth_of_a_second():
    times = np.array([GLITCH - 0.01, GLITCH, GLITCH + 0.1, GLITCH + 0.11])
    assert follows_jump(times, TRUTH).tolist() == [False, True, True, False]
    assert not follows_jump(times, None).any()
