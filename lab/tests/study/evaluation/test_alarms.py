from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import match_alarms
from holdfast.metrics.events import LabelledEvents
from holdfast_lab.study.evaluation.alarm_labels import EVENT, FALSE_ALARM, LEFT_OUT, AlarmLabels
from holdfast_lab.study.evaluation.alarms import (
    AlarmStatistics,
    FalseAlarmRanges,
    threshold_shift,
)
from holdfast_lab.study.evaluation.fitted_method import Scores
from study.evaluation.test_fitted_method import recording_at
from study.example_recordings import GLITCH, TIMES, inside

EVERYWHERE = np.ones(1725, dtype=bool)


def statistics(states, labels):
    """Statistics of decisions that are certain."""
    margin = np.where(states == STABLE, 1.0, -1.0)
    return AlarmStatistics.of(Scores(TIMES, margin, EVERYWHERE, EVERYWHERE, margin), labels)


def labels_of(codes):
    """Labels at 150 Hz, without glitches."""
    nowhere = np.zeros(len(codes), dtype=bool)
    events = LabelledEvents.of(np.arange(len(codes)) / 150, codes)
    return AlarmLabels(events, nowhere, nowhere)


def where(*spans):
    """Stable but in those spans [s]."""
    return np.where(inside(spans), UNSTABLE, STABLE).astype(np.int8)


def readings(*spans):
    """Labels of a finger that is not stable in those spans, and in a glitch."""
    glitch = inside([(GLITCH, GLITCH + 0.1)])
    labels = np.where(glitch, UNSTABLE, where(*spans)).astype(np.int8)
    recording = recording_at({"thumb": TIMES})
    calm = np.where(glitch, STABLE, labels).astype(np.int8)
    labelled = replace(recording, exact_labels={"thumb": labels}, calm_labels={"thumb": calm})
    return labelled.alarm_labels


def test_kinds_of_false_alarms_are_counted():
    """One in a stable hold, one of a glitch, one where the label is not stable."""
    states = where((0.5, 0.6), (3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    found = statistics(states, readings((0.0, 2.0), (5.3, 6.5))[FALSE_ALARM])
    assert found.delays == [pytest.approx(0.02)]
    assert (found.n_false_alarms, found.n_under_stable, found.n_of_glitch) == (3, 2, 1)
    assert found.stable_seconds == pytest.approx(1725 / 150 - 3.2)


def test_a_glitch_can_be_an_event_or_left_out():
    """If it is left out, so is the time in which an alarm belongs to it."""
    states = where((3.0, 3.1), (5.32, 6.5), (GLITCH + 0.05, GLITCH + 0.1))
    by_reading = readings((0.0, 2.0), (5.3, 6.5))
    event = statistics(states, by_reading[EVENT])
    assert event.delays == pytest.approx([0.02, 0.05], abs=0.007)
    assert (event.n_false_alarms, event.n_under_stable, event.n_of_glitch) == (1, 1, 0)
    left_out = statistics(states, by_reading[LEFT_OUT])
    assert (left_out.n_false_alarms, left_out.n_under_stable, left_out.n_of_glitch) == (1, 1, 0)
    n_near = int(by_reading[LEFT_OUT].left_out.sum())
    assert n_near == 3 + 15 + 38
    assert left_out.stable_seconds == pytest.approx((1725 - 480 - n_near) / 150)


def random_score(generator, n=3000):
    """Return scores that change between a few levels, with gaps and losses of contact."""
    steps = generator.normal(size=n) * (generator.random(n) < 0.3)
    margin = np.round(3 * np.sin(np.cumsum(steps)), 1)
    known = generator.random(n) > 0.02
    grasped = ~np.repeat(generator.random(n // 50 + 1) < 0.1, 50)[:n]
    margin[generator.random(n) < 0.01] = np.inf
    return Scores(np.arange(n) / 150, margin, known, grasped, np.full(n, 0.5))


def random_labels(generator, n=3000):
    lengths = generator.integers(5, 300, size=n)
    codes = generator.choice([STABLE, STABLE, UNSTABLE, NO_CONTACT, UNKNOWN], size=n)
    return np.repeat(codes, lengths)[:n].astype(np.int8)


def cases(seed):
    generator = np.random.default_rng(seed)
    return [(random_score(generator), random_labels(generator)) for _ in range(3)]


def n_false(score, labels, shift):
    """Return the false alarms under a stable label, from the decisions at that threshold."""
    found = match_alarms(score.times, labels, score.states(shift))
    return sum(alarm.label.code == STABLE for alarm in found.false_alarms)


def brute_shift(pairs, per_minute, tried):
    minutes = sum(match_alarms(s.times, y, y).stable_seconds for s, y in pairs) / 60
    counts = [sum(n_false(s, y, shift) for s, y in pairs) for shift in tried]
    allowed = []
    for shift, count in zip(tried, counts, strict=True):
        if count > per_minute * minutes:
            break
        allowed.append(shift)
    return max(allowed, default=-np.inf), tried[int(np.argmax(counts))]


@pytest.mark.parametrize("seed", range(5))
def test_false_alarms_at_every_threshold_equal_those_of_the_decisions(seed):
    for score, labels in cases(seed):
        ranges = FalseAlarmRanges.of(score, labels_of(labels))
        for shift in (-np.inf, *np.arange(-3.2, 3.3, 0.1)):
            counted = int(((ranges.lower < shift) & (shift <= ranges.upper)).sum())
            if np.isneginf(shift):
                counted = int(np.isneginf(ranges.lower).sum())
            assert counted == n_false(score, labels, shift)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("per_minute", [0.0, 5.0, 40.0, 200.0])
def test_the_highest_threshold_with_few_enough_false_alarms(seed, per_minute):
    pairs = cases(seed)
    tried = np.unique(np.concatenate([s.margin[np.isfinite(s.margin)] for s, _ in pairs]))
    quiet, most_alarms = brute_shift(pairs, per_minute, tried)
    chosen = threshold_shift([FalseAlarmRanges.of(s, labels_of(y)) for s, y in pairs], per_minute)
    assert max(chosen, tried[0]) == max(min(quiet, most_alarms), tried[0])
