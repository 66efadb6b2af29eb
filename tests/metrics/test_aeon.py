"""Our event metrics against aeon's range metrics (Tatbul et al. 2018), where the two overlap.

An alarm is an instant: for aeon a predicted range of one sample. An alarm belongs to an event in
a span around it: that span is aeon's true range. Then the reward for existence is a hit or a
miss, and precision is the share of alarms that are not false. Both are made here from the runs
that the labels were made of, not by our code. aeon has no counterpart for closed gaps, for the
stable time before an event, for latency and for rates by time.

aeon needs an older NumPy, so it is not among the development tools: see
CONTRIBUTING.md.
"""

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import match_alarms, sample_metrics
from holdfast.metrics.events import EventCounts

aeon = pytest.importorskip("aeon.benchmarking.metrics.anomaly_detection")

RATE = 100
"""Samples a second, so that 0.02, 0.05, 0.1, 0.2 and 0.25 s are whole numbers of them."""


def grasp(seed):
    """Labels where every not-stable run is an event, those runs, and states that try to follow.

    The last event is followed by stable labels, so that its span ends inside.
    """
    random = np.random.default_rng(seed)
    labels, runs = [], []
    for _ in range(random.integers(1, 8)):
        labels += [STABLE] * random.integers(50, 200)
        runs.append((len(labels), len(labels) + random.integers(5, 80)))
        labels += [random.choice((UNSTABLE, NO_CONTACT))] * (runs[-1][1] - runs[-1][0])
    labels += [STABLE] * random.integers(50, 100)
    states = np.roll(labels, random.integers(-5, 40))
    for _ in range(random.integers(1, 20)):
        first = random.integers(0, len(labels))
        states[first : first + random.integers(1, 40)] = random.choice(
            (UNKNOWN, NO_CONTACT, UNSTABLE, STABLE)
        )
    return np.array(labels, dtype=np.int8), runs, states.astype(np.int8)


def spans(runs, n, before, after):
    """1 in each run, widened by so many samples."""
    out = np.zeros(n, dtype=np.int64)
    for first, stop in runs:
        out[max(first - before, 0) : stop + after] = 1
    return out


def alarms(states):
    """1 at each sample where a stable state ends in another that is not unknown."""
    out = np.zeros(len(states), dtype=np.int64)
    for k in range(1, len(states)):
        out[k] = states[k - 1] == STABLE and states[k] in (UNSTABLE, NO_CONTACT)
    return out


CASES = [case for seed in range(300) if alarms((case := grasp(seed))[2]).any()]


def match(case):
    labels, _, states = case
    return match_alarms(np.arange(len(labels)) / RATE, labels, states)


def test_the_cases_hold_hits_misses_and_false_alarms():
    found = [match(case) for case in CASES]
    delays = [event.delay for one in found for event in one.events]
    assert len(CASES) > 250
    assert 0.1 < np.mean(np.isinf(delays)) < 0.5
    assert sum(len(one.false_alarms) for one in found) > 200


def test_events_without_an_alarm_against_recall_by_existence():
    for case in CASES:
        _, runs, states = case
        found = match(case)
        hit = aeon.range_recall(spans(runs, len(states), 2, 26), alarms(states), alpha=1)
        assert len(found.events) == len(runs)
        assert hit == pytest.approx(
            1 - EventCounts.of(found).n_missed(np.finfo(float).max) / len(runs)
        )


@pytest.mark.parametrize("post", [0.05, 0.1, 0.2])
def test_missed_at_post_against_recall_by_existence(post):
    for case in CASES:
        _, runs, states = case
        soon = [(first, first + round(post * RATE)) for first, _ in runs]
        hit = aeon.range_recall(spans(soon, len(states), 2, 1), alarms(states), alpha=1)
        assert hit == pytest.approx(1 - EventCounts.of(match(case)).n_missed(post) / len(runs))


def test_false_alarms_against_precision():
    for case in CASES:
        _, runs, states = case
        true = aeon.range_precision(spans(runs, len(states), 2, 26), alarms(states))
        n_alarms = alarms(states).sum()
        assert len(match(case).false_alarms) == pytest.approx((1 - true) * n_alarms)


def test_a_state_that_was_not_stable_before_is_no_alarm():
    """Where we differ on purpose: aeon's whole ranges overlap with more than an alarm would."""
    more = 0
    for case in CASES:
        _, runs, states = case
        given_up = np.isin(states, (UNSTABLE, NO_CONTACT)).astype(np.int64)
        hit = aeon.range_recall(spans(runs, len(states), 2, 26), given_up, alpha=1)
        ours = 1 - EventCounts.of(match(case)).n_missed(np.finfo(float).max) / len(runs)
        assert hit >= ours - 1e-12
        more += hit > ours + 1e-12
    assert more > 0


def test_the_area_under_the_curve():
    random = np.random.default_rng(0)
    for labels, _, _ in CASES[:20]:
        score = np.round(random.normal(size=len(labels)) + (labels == STABLE), 1)
        probability = 1 / (1 + np.exp(-score))
        states = np.where(score > 0, STABLE, UNSTABLE)
        ours = sample_metrics(labels, states, probability).auc
        theirs = aeon.roc_auc_score((labels == STABLE).astype(np.int64), probability)
        assert ours == pytest.approx(theirs)
