"""Counts of each method on each real recording, on the same samples, and their table rows."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from holdfast.contact import STABLE, TIME_TOLERANCE, UNKNOWN, ContactState
from holdfast.metrics import bootstrap_interval, match_alarms
from holdfast.metrics.masks import Mask
from holdfast.metrics.statistics import auc_of, mann_whitney_u
from holdfast.sensors.types import Array
from holdfast_lab.report.result_tables import Row
from holdfast_lab.study.comparison.real_estimates import (
    RecordingEstimates,
    RecordingLabels,
    UnitEstimates,
    UnitLabels,
)
from holdfast_lab.study.comparison.real_models import SHIPPED
from holdfast_lab.study.comparison.rows import WITHOUT_ESTIMATE, RowKeys, count_row, ratio_row

MIN_RECORDINGS = 3
"""Minimum number of recordings for an interval."""
MISSED_AFTER = 0.2
"""A slip is missed without an alarm until this time after its onset [s]."""
AUC, AUC_OF_HAND, MEAN_AUC = "AUC", "AUC of the hand", "mean AUC"
AUC_OF_SHIPPED, AUC_DIFFERENCE = f"AUC of {SHIPPED}", "difference"
ACCURACY = "accuracy [%]"
CALLED_STABLE = "stable called STABLE [%]"
SLIP_COUNT, MISSED_SLIPS, FALSE_ALARMS = "slips", "missed slips [%]", "false alarms per minute"
COUNT_DIGITS = {AUC: 2, AUC_OF_HAND: 2, MEAN_AUC: 2, SLIP_COUNT: 0}
"""Digits after the decimal point, where they are not 1."""


class SlipAgainstStable(NamedTuple):
    """Probabilities of stability of the samples labelled stable, and of those labelled slip."""

    stable: Array
    slip: Array

    @property
    def auc(self) -> float | None:
        """Probability that a stable sample has a higher score than a sample of slip."""
        pairs = len(self.stable) * len(self.slip)
        return mann_whitney_u(self.stable, self.slip) / pairs if pairs else None


class UnitCounts(NamedTuple):
    """Counts of the samples of a finger, or of the hand, in one recording.

    Attributes:
        n_labelled: labelled samples.
        n_without: of those, samples without an estimate.
        n: labelled samples at which all methods have an estimate.
        n_correct: of those, samples that are called STABLE if, and only if, they are labelled so.
        n_stable: of those, samples labelled stable.
        n_called_stable: of those, samples called STABLE.
        scores: of the samples at which all methods have an estimate.
    """

    n_labelled: int
    n_without: int
    n: int
    n_correct: int
    n_stable: int
    n_called_stable: int
    scores: SlipAgainstStable


class RealAlarmCounts(NamedTuple):
    """Counts of the alarms of the hand in one recording.

    Attributes:
        n_slips: slips that begin while the hand is labelled stable.
        n_missed: of those, slips without an alarm within `MISSED_AFTER`.
        n_false_alarms: alarms under a stable label that belong to no event.
        stable_minutes: duration of the stable label [min].
    """

    n_slips: int
    n_missed: int
    n_false_alarms: int
    stable_minutes: float


class RecordingCounts(NamedTuple):
    """Counts of one method on one recording; a whole-hand method has none of fingers."""

    name: str
    fingers: Mapping[str, UnitCounts]
    hand: UnitCounts
    events: RealAlarmCounts

    @property
    def units(self) -> list[UnitCounts]:
        """Counts of what the method decides for: the fingers, or the hand."""
        return list(self.fingers.values()) or [self.hand]


class ScorePair(NamedTuple):
    """Scores of two methods on one recording, on the samples at which both have an estimate."""

    name: str
    first: SlipAgainstStable
    second: SlipAgainstStable


def count_recordings(
    labels: Sequence[RecordingLabels], estimates: Mapping[str, Sequence[RecordingEstimates]]
) -> dict[str, list[RecordingCounts]]:
    """Return the counts of every method on each recording, on the same samples.

    These are the samples at which every method has an estimate of every finger. A method without
    any estimate in a recording is left out there.

    Args:
        labels: of the recordings.
        estimates: of the same recordings, by method.
    """
    common = [
        common_samples([estimate[index] for estimate in estimates.values()])
        for index in range(len(labels))
    ]
    return {
        method: [_count(*arguments) for arguments in zip(labels, units, common, strict=True)]
        for method, units in estimates.items()
    }


def common_samples(estimates: Sequence[RecordingEstimates]) -> Mask:
    """Return the (n,) samples of the hand at which every method with estimates has one."""
    # A method without any estimate here would leave no sample; it is dropped unless all are so.
    masks = [estimate.known.array for estimate in estimates]
    return np.asarray(np.all([mask for mask in masks if mask.any()] or masks, axis=0))


def count_pairs(
    labels: Sequence[RecordingLabels],
    first: Sequence[RecordingEstimates],
    second: Sequence[RecordingEstimates],
) -> list[ScorePair]:
    """Return the scores of two methods on each recording, where both have an estimate.

    They are those of the fingers; of the hand, if one of the two is a whole-hand method.

    Args:
        labels: of the recordings.
        first: estimates of one method about the same recordings.
        second: estimates of another method.
    """
    pairs = []
    for label, *both in zip(labels, first, second, strict=True):
        # Of the two alone, not of all methods: a method with a long history costs no samples here.
        common = np.all([x.known.array for x in both], axis=0)
        counts = [_count(label, x, common) for x in both]
        by_finger = all(count.fingers for count in counts)
        scores = (
            pool([unit.scores for unit in count.units]) if by_finger else count.hand.scores
            for count in counts
        )
        pairs.append(ScorePair(label.name, *scores))
    return pairs


def pair_rows(keys: RowKeys, pairs: Sequence[ScorePair], seed: int) -> list[Row]:
    """Return the AUC of two methods on the same samples, and the first minus the second.

    Args:
        keys: of the rows, but for their figure.
        pairs: scores on each recording.
        seed: of the bootstrap.
    """
    first, second = [pair.first for pair in pairs], [pair.second for pair in pairs]
    shipped = auc_row({**keys, "figure": AUC_OF_SHIPPED}, first, seed)
    other = auc_row({**keys, "figure": AUC}, second, seed)
    key = {**keys, "figure": AUC_DIFFERENCE}
    if shipped.ours is None or other.ours is None:
        return [shipped, other, Row(key, None, None, shipped.n)]
    # Paired: both statistics get the same resamples.
    interval = None
    if (shipped.n or 0) >= MIN_RECORDINGS:
        statistics = [auc_of([x.stable for x in s], [x.slip for x in s]) for s in (first, second)]
        interval = bootstrap_interval(
            lambda draws: statistics[0](draws) - statistics[1](draws), len(pairs), seed=seed
        )
    return [shipped, other, Row(key, shipped.ours - other.ours, None, shipped.n, interval)]


def recording_rows(keys: RowKeys, counts: Sequence[RecordingCounts], seed: int) -> list[Row]:
    """Return the figures of a method on some recordings together.

    Args:
        keys: of the rows, but for their figure.
        counts: of the recordings.
        seed: of the bootstrap.
    """
    pooled = [pool([unit.scores for unit in count.units]) for count in counts]
    return [
        auc_row({**keys, "figure": AUC}, pooled, seed),
        auc_row({**keys, "figure": AUC_OF_HAND}, [count.hand.scores for count in counts], seed),
        _sample_row({**keys, "figure": ACCURACY}, counts, "n_correct", "n", seed),
        _sample_row({**keys, "figure": CALLED_STABLE}, counts, "n_called_stable", "n_stable", seed),
        _sample_row({**keys, "figure": WITHOUT_ESTIMATE}, counts, "n_without", "n_labelled", seed),
        *_event_rows(keys, [count.events for count in counts], seed),
    ]


def mean_auc_row(keys: RowKeys, counts: Sequence[RecordingCounts], seed: int) -> Row:
    """Return the mean of the AUCs of the recordings that have both classes.

    It does not depend on whether the probabilities of different fits have the same scale.

    Args:
        keys: of the row, but for its figure.
        counts: of the recordings.
        seed: of the bootstrap.
    """
    scores = (pool([unit.scores for unit in count.units]) for count in counts)
    aucs = [score.auc for score in scores if score.auc is not None]
    row = ratio_row({**keys, "figure": MEAN_AUC}, aucs, np.ones(len(aucs)), seed, scale=1.0)
    return _with_interval_if_enough(row)


def auc_row(keys: RowKeys, scores: Sequence[SlipAgainstStable], seed: int) -> Row:
    """Return the AUC of stable against slip, pooled over recordings, with its interval.

    Args:
        keys: of the row.
        scores: of the recordings. Those without a stable sample and without slip do not count.
        seed: of the bootstrap.
    """
    usable = [score for score in scores if len(score.stable) or len(score.slip)]
    interval = None
    if len(usable) >= MIN_RECORDINGS:
        statistic = auc_of([x.stable for x in usable], [x.slip for x in usable])
        interval = bootstrap_interval(statistic, len(usable), seed=seed)
    return Row(dict(keys), pool(usable).auc, None, len(usable), interval)


def pool(scores: Sequence[SlipAgainstStable]) -> SlipAgainstStable:
    """Return all scores together."""
    stable, slip = ([np.empty(0), *(score[k] for score in scores)] for k in range(2))
    return SlipAgainstStable(np.concatenate(stable), np.concatenate(slip))


def _sample_row(
    keys: RowKeys, counts: Sequence[RecordingCounts], part: str, whole: str, seed: int
) -> Row:
    """Return a share of the samples [%], from the names of two counts."""
    parts, wholes = (
        [sum(getattr(unit, name) for unit in count.units) for count in counts]
        for name in (part, whole)
    )
    return _with_interval_if_enough(ratio_row(keys, parts, wholes, seed))


def _event_rows(keys: RowKeys, events: Sequence[RealAlarmCounts], seed: int) -> Iterator[Row]:
    n_slips = [event.n_slips for event in events]
    missed = [event.n_missed for event in events]
    alarms = [event.n_false_alarms for event in events]
    minutes = [event.stable_minutes for event in events]
    yield count_row({**keys, "figure": SLIP_COUNT}, n_slips)
    yield _with_interval_if_enough(
        ratio_row({**keys, "figure": MISSED_SLIPS}, missed, n_slips, seed)
    )
    per_minute = ratio_row({**keys, "figure": FALSE_ALARMS}, alarms, minutes, seed, scale=1.0)
    yield _with_interval_if_enough(per_minute)


def _with_interval_if_enough(row: Row) -> Row:
    return row if (row.n or 0) >= MIN_RECORDINGS else replace(row, interval=None)


def _count(labels: RecordingLabels, estimates: RecordingEstimates, common: Mask) -> RecordingCounts:
    fingers = {}
    for name, estimate in estimates.fingers.items():
        finger = labels.fingers[name]
        at_finger = common[np.searchsorted(labels.hand.times.array, finger.times.array)]
        fingers[name] = _count_unit(finger, estimate, estimate.states.array != UNKNOWN, at_finger)
    hand = _count_unit(labels.hand, estimates.hand, estimates.known.array, common)
    times, slip = labels.hand.times.array, labels.hand.slip.array
    # UNKNOWN where a method has no estimate: no event begins there, and no time is counted.
    codes = np.where(common, labels.hand.codes.array, UNKNOWN)
    match = match_alarms(times, codes, estimates.alarm_states.array)
    slips = [
        event
        for event in match.events
        if slip[np.searchsorted(times, event.onset) : np.searchsorted(times, event.end)].any()
    ]
    events = RealAlarmCounts(
        n_slips=len(slips),
        n_missed=sum(event.delay > MISSED_AFTER + TIME_TOLERANCE for event in slips),
        n_false_alarms=sum(alarm.label is ContactState.STABLE for alarm in match.false_alarms),
        stable_minutes=match.stable_seconds / 60,
    )
    return RecordingCounts(labels.name, fingers, hand, events)


def _count_unit(
    labels: UnitLabels, estimates: UnitEstimates, decided: Mask, common: Mask
) -> UnitCounts:
    labelled = labels.codes.array != UNKNOWN
    scored = labelled & decided & common
    stable = scored & (labels.codes.array == STABLE)
    slip = scored & labels.slip.array
    called = estimates.states.array == STABLE
    probability = estimates.probability.array
    return UnitCounts(
        n_labelled=int(labelled.sum()),
        n_without=int((labelled & ~decided).sum()),
        n=int(scored.sum()),
        n_correct=int((scored & (stable == called)).sum()),
        n_stable=int(stable.sum()),
        n_called_stable=int((stable & called).sum()),
        scores=SlipAgainstStable(probability[stable], probability[slip]),
    )
