"""The metrics of many recordings: per finger, pooled, per recording, by event."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import msgspec
import numpy as np

from holdfast.metrics.decisions import Decisions, FingerDecisions
from holdfast.metrics.events import (
    POST_DURATIONS,
    AlarmMatch,
    EventMetrics,
    event_delays,
    match_alarms,
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
from holdfast.metrics.samples import SampleMetrics, Tally, measure, pool_tallies, tally_samples


class HandEventMetrics(msgspec.Struct, frozen=True):
    """Event metrics of each finger and of the hand as a whole."""

    fingers: dict[str, EventMetrics]
    hand: EventMetrics


class RecordingMetrics(msgspec.Struct, frozen=True):
    """The metrics of one recording."""

    name: str
    fingers: dict[str, SampleMetrics]
    events: HandEventMetrics


class EventIntervals(msgspec.Struct, frozen=True):
    """Intervals of the hand's event metrics, in their units; a delay's end may be infinite (null).

    An interval is None where no resample defines its figure.
    """

    missed: dict[str, Interval | None]
    delay_median: Interval | None
    delay_p95: Interval | None
    false_alarms_per_minute: Interval | None


class Intervals(msgspec.Struct, frozen=True):
    """Intervals of the pooled sample metrics and of the hand's event metrics.

    Attributes:
        n_recordings: how many recordings they rest on: those with labels.
        level: share of the resamples within each interval.
        accuracy: [%].
        fdr: [%].
        fpr: [%].
        fnr: [%].
        auc: stable against the rest.
        auc_contact: stable against unstable.
        brier: of the probabilities.
        hand: of the events.
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
    """How good decisions about recordings are; `msgspec.json.encode` gives the JSON.

    Attributes:
        fingers: by sample, of each finger over all recordings.
        pooled: by sample, over all fingers and recordings.
        recordings: of each recording.
        events: by event, over all recordings.
        intervals: by bootstrap over recordings; None with fewer than
            two recordings that have labels.
    """

    fingers: dict[str, SampleMetrics]
    pooled: SampleMetrics
    recordings: list[RecordingMetrics]
    events: HandEventMetrics
    intervals: Intervals | None


@dataclass(frozen=True, eq=False)
class _Counted:
    """What stays of a recording once its samples are let go.

    Fingers, and the hand, without any label have no events and no false alarms.
    """

    name: str
    tallies: Mapping[str, Tally]
    matches: Mapping[str, AlarmMatch]
    hand: Sequence[AlarmMatch]


def summarise(
    decisions: Iterable[Decisions], *, n_resamples: int = 1000, seed: int = 0, level: float = 0.95
) -> Metrics:
    """The metrics of many recordings.

    Takes one recording at a time, and keeps of it the scores of labelled samples, counts,
    events and alarms.

    Args:
        decisions: of each recording.
        n_resamples: of the bootstrap over recordings.
        seed: of the same.
        level: share of the resamples within each interval.

    Raises:
        ValueError: a decided sample's probability is NaN.

    Example:
        >>> thumb = FingerDecisions([0.0, 0.01], [3, 2], [3, 2], [0.9, 0.2])
        >>> metrics = summarise([Decisions.of("one", {"thumb": thumb}, n_model_fingers=1)])
        >>> metrics.pooled.accuracy, metrics.events.hand.n_events, metrics.intervals
        (100.0, 0, None)
    """
    counted = [_count(each) for each in decisions]
    names = list(dict.fromkeys(name for each in counted for name in each.tallies))
    tallies = [tally for each in counted for tally in each.tallies.values()]
    return Metrics(
        fingers={
            name: measure(pool_tallies([c.tallies[name] for c in counted if name in c.tallies]))
            for name in names
        },
        pooled=measure(pool_tallies(tallies)),
        recordings=[_recording_metrics(each) for each in counted],
        events=_event_metrics(counted, names),
        intervals=_intervals([c for c in counted if c.matches], n_resamples, seed, level),
    )


def _count(decisions: Decisions) -> _Counted:
    tallies = {
        name: tally_samples(finger.labels, finger.states, finger.stable_probability)
        for name, finger in decisions.fingers.items()
    }
    matches = {
        name: _match(finger) for name, finger in decisions.fingers.items() if finger.labels.any()
    }
    hand = decisions.hand
    hand_matches = [] if hand is None or not hand.labels.any() else [_match(hand)]
    return _Counted(decisions.name, tallies, matches, hand_matches)


def _match(finger: FingerDecisions) -> AlarmMatch:
    return match_alarms(finger.times, finger.labels, finger.states)


def _recording_metrics(counted: _Counted) -> RecordingMetrics:
    fingers = {name: measure(tally) for name, tally in counted.tallies.items()}
    return RecordingMetrics(counted.name, fingers, _event_metrics([counted], list(fingers)))


def _event_metrics(counted: Sequence[_Counted], names: Sequence[str]) -> HandEventMetrics:
    fingers = {
        name: pool_events([c.matches[name] for c in counted if name in c.matches]) for name in names
    }
    return HandEventMetrics(fingers, pool_events([match for c in counted for match in c.hand]))


def _intervals(counted: Sequence[_Counted], n: int, seed: int, level: float) -> Intervals | None:
    if len(counted) < 2:
        return None
    interval = partial(bootstrap_interval, n_recordings=len(counted), n=n, seed=seed, level=level)
    tallies = [pool_tallies(list(each.tallies.values())) for each in counted]
    samples = {name: interval(each) for name, each in _sample_statistics(tallies).items()}
    events = {name: interval(each) for name, each in _event_statistics(counted).items()}
    missed = {str(post): events.pop(str(post)) for post in POST_DURATIONS}
    hand = EventIntervals(missed=missed, **events)
    return Intervals(n_recordings=len(counted), level=level, hand=hand, **samples)


def _sample_statistics(tallies: Sequence[Tally]) -> dict[str, Statistic]:
    """Of the pooled samples; a tally for each recording."""
    tn, fp, fn, tp = np.array([tally.confusion.ravel() for tally in tallies]).T
    n = tn + fp + fn + tp
    stable = [tally.stable for tally in tallies]
    return {
        "accuracy": ratio_of_sums(100 * (tp + tn), n),
        "fdr": ratio_of_sums(100 * fp, tp + fp),
        "fpr": ratio_of_sums(100 * fp, fp + tn),
        "fnr": ratio_of_sums(100 * fn, fn + tp),
        "auc": auc_of(stable, [tally.not_stable for tally in tallies]),
        "auc_contact": auc_of(stable, [tally.unstable for tally in tallies]),
        "brier": ratio_of_sums([tally.squared_error for tally in tallies], n),
    }


def _event_statistics(counted: Sequence[_Counted]) -> dict[str, Statistic]:
    """Of the hand's events; those missed are named by their `post`."""
    matches = [match for each in counted for match in each.hand or [_NOTHING]]
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


_NOTHING = AlarmMatch((), (), 0.0)
"""Stands for a recording whose hand has no labels or decisions, so that all count alike."""
