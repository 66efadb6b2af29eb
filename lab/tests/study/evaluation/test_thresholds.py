import numpy as np
import pytest

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import match_alarms
from holdfast_lab.study.evaluation.scores import HandScores
from holdfast_lab.study.evaluation.thresholds import FalseAlarmRanges, threshold_shift


def random_score(generator, n=3000):
    """Return scores that change between a few levels, with gaps and losses of contact."""
    steps = generator.normal(size=n) * (generator.random(n) < 0.3)
    margin = np.round(3 * np.sin(np.cumsum(steps)), 1)
    known = generator.random(n) > 0.02
    held = ~np.repeat(generator.random(n // 50 + 1) < 0.1, 50)[:n]
    margin[generator.random(n) < 0.01] = np.inf
    return HandScores(np.arange(n) / 150, margin, known, held, np.full(n, 0.5))


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
        ranges = FalseAlarmRanges.of(score, labels)
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
    chosen = threshold_shift([FalseAlarmRanges.of(*pair) for pair in pairs], per_minute)
    assert max(chosen, tried[0]) == max(min(quiet, most_alarms), tried[0])


def test_the_shift_stays_below_the_threshold_with_the_most_alarms():
    """At 2 there are two alarms; at 3 the hand is never stable and there would be none."""
    margin = np.array([3.0, 1.0, 2.0, 1.0, 2.5, 2.5])
    known = held = np.ones(6, dtype=bool)
    ranges = FalseAlarmRanges.of(
        HandScores(np.arange(6.0), margin, known, held, margin), np.full(6, STABLE)
    )
    assert threshold_shift([ranges], 1e9) == 2.0


def test_without_alarms_the_threshold_is_not_shifted():
    nothing = FalseAlarmRanges(np.empty(0), np.empty(0), 1.0)
    assert threshold_shift([nothing], 1.0) == 0.0


def test_ignored_alarms_do_not_count():
    margin = np.array([1.0, 1.0, -1.0, 1.0, -2.0, 1.0])
    score = HandScores(
        np.arange(6.0), margin, np.ones(6, dtype=bool), np.ones(6, dtype=bool), np.zeros(6)
    )
    labels = np.full(6, STABLE, dtype=np.int8)
    ignored = np.arange(6) == 4
    assert threshold_shift([FalseAlarmRanges.of(score, labels)], 0.0) == -2.0
    assert threshold_shift([FalseAlarmRanges.of(score, labels, ignored)], 0.0) == -1.0


def test_ignored_samples_count_neither_as_alarms_nor_as_time():
    """Of 3000 samples at 150 Hz, all labelled stable, the first half is ignored."""
    score, _ = cases(0)[0]
    labels = np.full(3000, STABLE, dtype=np.int8)
    ignored = np.arange(3000) < 1500
    every, late = (FalseAlarmRanges.of(score, labels, each) for each in (None, ignored))
    assert every.minutes == pytest.approx(20 / 60)
    assert late.minutes == pytest.approx(10 / 60)
    assert 0 < len(late.lower) < len(every.lower)
