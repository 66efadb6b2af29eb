"""Metrics of several recordings: per finger, pooled, per recording, by event."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import msgspec
import numpy as np

from holdfast.metrics.decisions import Decisions
from holdfast.metrics.events import (
    POST_DURATIONS,
    EventCounts,
    EventMetrics,
    event_metrics_of,
    match_decisions,
)
from holdfast.metrics.samples import (
    N_BINS,
    BinnedSamples,
    SampleMetrics,
    SampleTotal,
    ScoredSamples,
    confusion_ratios,
    metrics_of_samples,
    score_samples,
)
from holdfast.metrics.slip_curves import (
    SlipSummary,
    slip_curve,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slips import SlipCounts, count_slips
from holdfast.metrics.statistics import (
    Interval,
    Statistic,
    auc_of,
    auc_of_counts,
    bootstrap_interval,
    quantile_of,
    ratio_of_sums,
)

MAX_EXACT_SCORES = 10_000_000
"""Number of labelled samples above which the AUC comes from a histogram of the scores.

The scores of all recordings would not fit into memory (80 bytes for each, with copies)."""
LEVEL = 0.95
"""Fraction of the resamples within each interval."""
MAX_GROUPS = 1000
"""Number of recordings above which the bootstrap draws groups of recordings.

The variance of the mean of 1000 random groups is that of the recordings, to about 5 %."""


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


class Intervals(msgspec.Struct, frozen=True, omit_defaults=True):
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
        n_groups: number of groups of recordings that the bootstrap draws; None if it draws
            recordings, as up to 1000 recordings.
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
    n_groups: int | None = None


class Metrics(msgspec.Struct, frozen=True, omit_defaults=True):
    """Metrics of decisions about recordings; `msgspec.json.encode` returns their JSON.

    Attributes:
        fingers: by sample, of each finger over all recordings.
        pooled: by sample, over all fingers and recordings.
        recordings: of each recording.
        events: by event, over all recordings.
        intervals: by bootstrap over recordings; None with fewer than two labelled recordings.
        score_bins: number of bins of the histogram of scores from which the AUC of all recordings
            is computed; None if it is exact, as up to 10 million samples.
        slips: of the slip rule; None without one, or if no slips are known.
    """

    fingers: dict[str, SampleMetrics]
    pooled: SampleMetrics
    recordings: list[RecordingMetrics]
    events: HandEventMetrics
    intervals: Intervals | None
    score_bins: int | None = None
    slips: SlipSummary | None = None


@dataclass(frozen=True, eq=False)
class RecordingResults:
    """Scores, events and alarms of a recording, without its samples.

    Without labels a finger, or the hand, has no events and no false alarms.

    Attributes:
        metrics: of the recording.
        samples: by finger.
        events: by finger with labels.
        hand: events of the hand; None without labels.
        slips: by finger whose slips are known.
        slip_curves: the same at many thresholds, if they were asked for.
    """

    metrics: RecordingMetrics
    samples: Mapping[str, ScoredSamples]
    events: Mapping[str, EventCounts]
    hand: EventCounts | None
    slips: Mapping[str, SlipCounts] = field(default_factory=dict)
    slip_curves: Mapping[str, SlipCounts] = field(default_factory=dict)


def summarise(decisions: Iterable[Decisions], *, n_resamples: int = 1000, seed: int = 0) -> Metrics:
    """Compute the metrics of several recordings.

    The recordings are read one at a time. Only the scores of labelled samples, counts, events
    and alarms stay in memory; of many recordings only histograms of the scores.

    Args:
        decisions: of each recording.
        n_resamples: number of resamples of the bootstrap over recordings.
        seed: of the bootstrap.

    Raises:
        ValueError: the probability of a decided sample is NaN.

    Example:
        >>> from holdfast.metrics import FingerDecisions
        >>> thumb = FingerDecisions([0.0, 0.01], [3, 2], [3, 2], [0.9, 0.2])
        >>> metrics = summarise([Decisions.of("one", {"thumb": thumb}, n_model_fingers=1)])
        >>> metrics.pooled.accuracy, metrics.events.hand.n_events, metrics.intervals
        (100.0, 0, None)
    """
    total = ResultTotal()
    for decision in decisions:
        total.add(score_recording(decision))
    return total.metrics(n_resamples, seed)


def score_recording(decisions: Decisions, *, slip_curves: bool = False) -> RecordingResults:
    """Return what `ResultTotal` needs of the decisions about a recording.

    Args:
        decisions: about the recording.
        slip_curves: count the slips at many thresholds, too.

    Raises:
        ValueError: the probability of a decided sample is NaN.
    """
    samples = {
        name: score_samples(finger.labels, finger.states, finger.stable_probability)
        for name, finger in decisions.fingers.items()
    }
    events = {
        name: EventCounts.of(match_decisions(finger))
        for name, finger in decisions.fingers.items()
        if finger.labels.any()
    }
    hand = None
    if decisions.hand is not None and decisions.hand.labels.any():
        hand = EventCounts.of(match_decisions(decisions.hand))
    metrics = RecordingMetrics(
        decisions.name,
        {name: metrics_of_samples(scores) for name, scores in samples.items()},
        _event_metrics([events], [hand], list(samples)),
    )
    slips = decisions.known_slips
    return RecordingResults(
        metrics,
        samples,
        events,
        hand,
        {name: count_slips(slip) for name, slip in slips.items()},
        {name: slip_curve(slip) for name, slip in slips.items()} if slip_curves else {},
    )


class _Group:
    """Recordings that the bootstrap draws together: one, or every 1000th of more."""

    def __init__(self) -> None:
        self.samples, self.hand = SampleTotal(), list[EventCounts]()
        self.slips = SlipCounts.total([])


class ResultTotal:
    """Results of the recordings so far, and their metrics."""

    def __init__(self) -> None:
        # `add` changes all of them; `metrics` only reads.
        self.recordings: list[RecordingMetrics] = []
        self.fingers: dict[str, SampleTotal] = {}
        self.pooled = SampleTotal()
        self.events: list[Mapping[str, EventCounts]] = []
        self.hands: list[EventCounts | None] = []
        self.slips: dict[str, SlipCounts] = {}  # of each finger, of all recordings
        self.groups: list[_Group] = []  # what the bootstrap draws
        self.n_labelled = self.n_scores = 0  # recordings with labels; labelled samples
        self.binned = False  # whether scores became histograms, for good

    def add(self, results: RecordingResults) -> None:
        """Add the results of a recording."""
        self.recordings.append(results.metrics)
        self.events.append(results.events)
        self.hands.append(results.hand)
        # Only recordings with labels are drawn, so the others go into a group that is thrown away.
        # Beyond `MAX_GROUPS` they join the groups in turn: each stays a random share of all.
        group = _Group()
        if results.events:
            index = self.n_labelled % MAX_GROUPS
            self.n_labelled += 1
            if index == len(self.groups):
                self.groups.append(group)
            group = self.groups[index]
        if results.hand is not None:
            group.hand.append(results.hand)
        for name, counts in results.slips.items():
            before = [self.slips[name]] if name in self.slips else []
            self.slips[name] = SlipCounts.total([*before, counts])
            group.slips = SlipCounts.total([group.slips, counts])
        for name, samples in results.samples.items():
            part = BinnedSamples.of(samples) if self.binned else samples
            for total in (self.fingers.setdefault(name, SampleTotal()), self.pooled, group.samples):
                total.add(part)
            self.n_scores += sum(samples.n_scores)
        if self.n_scores > MAX_EXACT_SCORES and not self.binned:
            self.binned = True
            for total in (*self.fingers.values(), self.pooled, *(g.samples for g in self.groups)):
                total.bin()

    def metrics(self, n_resamples: int = 1000, seed: int = 0) -> Metrics:
        """Compute the metrics; for the arguments see `summarise`."""
        curves = [group.slips.as_curve for group in self.groups] if self.slips else []
        slips = slip_intervals(curves, n=n_resamples, seed=seed)
        return Metrics(
            fingers={
                name: metrics_of_samples(total.samples) for name, total in self.fingers.items()
            },
            pooled=metrics_of_samples(self.pooled.samples),
            recordings=self.recordings,
            events=_event_metrics(self.events, self.hands, list(self.fingers)),
            intervals=self._intervals(n_resamples, seed),
            score_bins=N_BINS if self.binned else None,
            slips=slip_summary([self.slips], slips) if self.slips else None,
        )

    def _intervals(self, n: int, seed: int) -> Intervals | None:
        n_groups = len(self.groups)
        if n_groups < 2:
            return None
        samples, events = (
            {
                name: bootstrap_interval(statistic, n_groups, n=n, seed=seed, level=LEVEL)
                for name, statistic in statistics.items()
            }
            for statistics in (_sample_statistics(self.groups), _event_statistics(self.groups))
        )
        missed = {str(post): events.pop(str(post)) for post in POST_DURATIONS}
        return Intervals(
            n_recordings=self.n_labelled,
            level=LEVEL,
            hand=EventIntervals(missed=missed, **events),
            n_groups=n_groups if self.n_labelled > n_groups else None,
            **samples,
        )


def _event_metrics(
    fingers: Sequence[Mapping[str, EventCounts]],
    hands: Sequence[EventCounts | None],
    names: Sequence[str],
) -> HandEventMetrics:
    by_name = {name: [finger[name] for finger in fingers if name in finger] for name in names}
    return HandEventMetrics(
        {name: event_metrics_of(EventCounts.total(counts)) for name, counts in by_name.items()},
        event_metrics_of(EventCounts.total([hand for hand in hands if hand is not None])),
    )


def _sample_statistics(groups: Sequence[_Group]) -> dict[str, Statistic]:
    """Return the statistics of the sample metrics, given the samples of each group."""
    samples = [group.samples.samples for group in groups]
    confusion = np.array([sample.confusion for sample in samples])
    ratios = confusion_ratios(confusion.transpose(1, 2, 0))
    exact = [sample for sample in samples if isinstance(sample, ScoredSamples)]
    if exact:  # then all are: `ResultTotal` turns all into histograms, or none
        stable = [sample.stable for sample in exact]
        auc = {
            "auc": auc_of(stable, [sample.not_stable for sample in exact]),
            "auc_contact": auc_of(stable, [sample.unstable for sample in exact]),
        }
    else:
        binned = [sample.counts for sample in samples if isinstance(sample, BinnedSamples)]
        counts = np.array(binned)
        used = counts.any(axis=(0, 1))  # few of the bins have a score, and U is (bins, bins) wide
        high, unstable, no_contact = counts[:, :, used].transpose(1, 0, 2).astype(np.float64)
        auc = {
            "auc": auc_of_counts(high, unstable + no_contact),
            "auc_contact": auc_of_counts(high, unstable),
        }
    return {
        **{name: ratio_of_sums(100 * part, whole) for name, (part, whole) in ratios.items()},
        **auc,
        "brier": ratio_of_sums([sample.squared_error for sample in samples], ratios["accuracy"][1]),
    }


def _event_statistics(groups: Sequence[_Group]) -> dict[str, Statistic]:
    """Return the statistics of the hand's event metrics; missed events under their `post`."""
    counts = [EventCounts.total(group.hand) for group in groups]
    n_events = [len(count.delays) for count in counts]
    n_false = [count.n_false for count in counts]
    minutes = [count.stable_seconds / 60 for count in counts]
    delays = [count.delays for count in counts]
    missed = {
        str(post): ratio_of_sums([100 * count.n_missed(post) for count in counts], n_events)
        for post in POST_DURATIONS
    }
    return missed | {
        "delay_median": quantile_of(delays, 0.5),
        "delay_p95": quantile_of(delays, 0.95),
        "false_alarms_per_minute": ratio_of_sums(n_false, minutes),
    }
