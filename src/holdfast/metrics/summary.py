"""Metrics of several recordings: per finger, pooled, per recording, by event."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np

from holdfast.metrics.decisions import Decisions
from holdfast.metrics.events import (
    POST_DURATIONS,
    AlarmMatch,
    EventMetrics,
    event_delays,
    match_decisions,
    pool_events,
)
from holdfast.metrics.intervals import (
    Interval,
    Statistic,
    auc_of,
    bootstrap_interval,
    quantile_of,
    ratio_of_sums,
)
from holdfast.metrics.samples import (
    SampleMetrics,
    ScoredSamples,
    metrics_of_samples,
    pool_samples,
    score_samples,
)


class HandEventMetrics(msgspec.Struct, frozen=True):
    """Event metrics of each finger and of the hand as a whole."""

    fingers: dict[str, EventMetrics]
    hand: EventMetrics


class RecordingMetrics(msgspec.Struct, frozen=True):
    """Metrics of one recording."""

    name: str
    fingers: dict[str, SampleMetrics]
    events: HandEventMetrics


class EventIntervals(msgspec.Struct, frozen=True):
    """Intervals of the event metrics of the hand, in their units.

    An interval is None if no resample defines its metric. The end of the interval of a delay is
    null if it is infinite.
    """

    missed: dict[str, Interval | None]
    delay_median: Interval | None
    delay_p95: Interval | None
    false_alarms_per_minute: Interval | None


class Intervals(msgspec.Struct, frozen=True):
    """Intervals of the pooled sample metrics and of the event metrics of the hand.

    Attributes:
        n_recordings: number of recordings with labels.
        level: fraction of the resamples within each interval.
        accuracy: [%].
        fdr: [%].
        fpr: [%].
        fnr: [%].
        auc: stable against the rest.
        auc_contact: stable against unstable.
        brier: of the probabilities.
        hand: of the event metrics.
    """

    n_recordings: int
    level: float
    accuracy: Interval | None
    fdr: Interval | None
    fpr: Interval | None
    fnr: Interval | None
    auc: Interval | None
    auc_contact: Interval | None
    brier: Interval | None
    hand: EventIntervals


class Metrics(msgspec.Struct, frozen=True):
    """Metrics of decisions about recordings; `msgspec.json.encode` returns their JSON.

    Attributes:
        fingers: by sample, of each finger over all recordings.
        pooled: by sample, over all fingers and recordings.
        recordings: of each recording.
        events: by event, over all recordings.
        intervals: by bootstrap over recordings; None with fewer than two labelled recordings.
    """

    fingers: dict[str, SampleMetrics]
    pooled: SampleMetrics
    recordings: list[RecordingMetrics]
    events: HandEventMetrics
    intervals: Intervals | None


@dataclass(frozen=True, eq=False)
class _RecordingResults:
    """Scores, events and alarms of a recording, without its samples.

    A finger, or the hand, without labels has no events and no false alarms.
    """

    name: str
    samples: Mapping[str, ScoredSamples]
    matches: Mapping[str, AlarmMatch]
    hand: Sequence[AlarmMatch]


def summarise(
    decisions: Iterable[Decisions], *, n_resamples: int = 1000, seed: int = 0, level: float = 0.95
) -> Metrics:
    """Compute the metrics of several recordings.

    The recordings are read one at a time. Only the scores of labelled samples, counts, events
    and alarms stay in memory.

    Args:
        decisions: of each recording.
        n_resamples: number of resamples of the bootstrap over recordings.
        seed: of the bootstrap.
        level: fraction of the resamples within each interval.

    Raises:
        ValueError: the probability of a decided sample is NaN.

    Example:
        >>> from holdfast.metrics import FingerDecisions
        >>> thumb = FingerDecisions([0.0, 0.01], [3, 2], [3, 2], [0.9, 0.2])
        >>> metrics = summarise([Decisions.of("one", {"thumb": thumb}, n_model_fingers=1)])
        >>> metrics.pooled.accuracy, metrics.events.hand.n_events, metrics.intervals
        (100.0, 0, None)
    """
    results = [_evaluate(each) for each in decisions]
    names = list(dict.fromkeys(name for each in results for name in each.samples))
    every = [own for each in results for own in each.samples.values()]
    return Metrics(
        fingers={
            name: metrics_of_samples(
                pool_samples([each.samples[name] for each in results if name in each.samples])
            )
            for name in names
        },
        pooled=metrics_of_samples(pool_samples(every)),
        recordings=[_recording_metrics(each) for each in results],
        events=_event_metrics(results, names),
        intervals=_intervals([each for each in results if each.matches], n_resamples, seed, level),
    )


def _evaluate(decisions: Decisions) -> _RecordingResults:
    samples = {
        name: score_samples(finger.labels, finger.states, finger.stable_probability)
        for name, finger in decisions.fingers.items()
    }
    matches = {
        name: match_decisions(finger)
        for name, finger in decisions.fingers.items()
        if finger.labels.any()
    }
    hand = decisions.hand
    hand_matches = [] if hand is None or not hand.labels.any() else [match_decisions(hand)]
    return _RecordingResults(decisions.name, samples, matches, hand_matches)


def _recording_metrics(results: _RecordingResults) -> RecordingMetrics:
    fingers = {name: metrics_of_samples(own) for name, own in results.samples.items()}
    return RecordingMetrics(results.name, fingers, _event_metrics([results], list(fingers)))


def _event_metrics(results: Sequence[_RecordingResults], names: Sequence[str]) -> HandEventMetrics:
    fingers = {
        name: pool_events([each.matches[name] for each in results if name in each.matches])
        for name in names
    }
    return HandEventMetrics(
        fingers, pool_events([match for each in results for match in each.hand])
    )


def _intervals(
    results: Sequence[_RecordingResults], n: int, seed: int, level: float
) -> Intervals | None:
    if len(results) < 2:
        return None
    interval = partial(bootstrap_interval, n_recordings=len(results), n=n, seed=seed, level=level)
    samples = [pool_samples(list(each.samples.values())) for each in results]
    by_sample = {name: interval(each) for name, each in _sample_statistics(samples).items()}
    events = {name: interval(each) for name, each in _event_statistics(results).items()}
    missed = {str(post): events.pop(str(post)) for post in POST_DURATIONS}
    hand = EventIntervals(missed=missed, **events)
    return Intervals(n_recordings=len(results), level=level, hand=hand, **by_sample)


def _sample_statistics(samples: Sequence[ScoredSamples]) -> dict[str, Statistic]:
    """Return the statistics of the sample metrics, given the samples of each recording."""
    tn, fp, fn, tp = np.array([each.confusion.ravel() for each in samples]).T
    n = tn + fp + fn + tp
    stable = [each.stable for each in samples]
    return {
        "accuracy": ratio_of_sums(100 * (tp + tn), n),
        "fdr": ratio_of_sums(100 * fp, tp + fp),
        "fpr": ratio_of_sums(100 * fp, fp + tn),
        "fnr": ratio_of_sums(100 * fn, fn + tp),
        "auc": auc_of(stable, [each.not_stable for each in samples]),
        "auc_contact": auc_of(stable, [each.unstable for each in samples]),
        "brier": ratio_of_sums([each.squared_error for each in samples], n),
    }


def _event_statistics(results: Sequence[_RecordingResults]) -> dict[str, Statistic]:
    """Return the statistics of the hand's event metrics; missed events under their `post`."""
    matches = [match for each in results for match in each.hand or [_NO_EVENTS]]
    n_events = [len(match.events) for match in matches]
    n_false = [len(match.false_alarms) for match in matches]
    minutes = [match.stable_seconds / 60 for match in matches]
    delays = [event_delays([match]) for match in matches]
    missed = {
        str(post): ratio_of_sums([100 * match.n_missed(post) for match in matches], n_events)
        for post in POST_DURATIONS
    }
    return missed | {
        "delay_median": quantile_of(delays, 0.5),
        "delay_p95": quantile_of(delays, 0.95),
        "false_alarms_per_minute": ratio_of_sums(n_false, minutes),
    }


_NO_EVENTS = AlarmMatch((), (), 0.0)
"""Events of a recording whose hand has no labels, so that every recording counts once."""
