"""Counts of slips at many thresholds: choice of a threshold, and intervals that include it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.classifiers.slip import raised_at_each
from holdfast.contact import TIME_TOLERANCE
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.slips import (
    FOUND_WITHIN,
    SlipCounter,
    SlipCounts,
    SlipMetrics,
    slip_metrics,
)
from holdfast.metrics.statistics import (
    Interval,
    Statistic,
    bootstrap_interval,
    draw_recordings,
)
from holdfast.sensors.types import Array, Flags, Integers

THRESHOLD_LOG_ODDS = np.arange(-40, 81) * 0.1
"""Log odds of the thresholds that are tried."""
THRESHOLDS = 1.0 / (1.0 + np.exp(-THRESHOLD_LOG_ODDS))
"""Thresholds of the probability of a slip that are tried, lowest first."""
MAX_RAISED_QUIET = 2.0
"""Maximum share of quiet hold in which a slip may be reported [%]."""

Curve = tuple[SlipCounts, ...]
"""Counts at each of `THRESHOLDS`."""


class SlipIntervals(msgspec.Struct, frozen=True):
    """Intervals of the pooled `SlipMetrics`, by bootstrap over recordings; None if undefined."""

    incipient: dict[str, Interval | None]
    gross: dict[str, Interval | None]
    over_1mm: dict[str, Interval | None]
    before_1mm: Interval | None
    before_3mm: Interval | None
    raised_quiet: Interval | None
    false_alarms_per_minute: dict[str, Interval | None]


class SlipSummary(msgspec.Struct, frozen=True, omit_defaults=True):
    """Metrics of the slips of each finger, and of all fingers together.

    Attributes:
        fingers: of each finger.
        pooled: of all fingers.
        intervals: of `pooled`; None with fewer than two recordings.
        threshold_chosen: whether the intervals include the choice of the threshold.
    """

    fingers: dict[str, SlipMetrics]
    pooled: SlipMetrics
    intervals: SlipIntervals | None = None
    threshold_chosen: bool = False


def slip_curve(decisions: SlipDecisions) -> Curve:
    """Return the counts of decisions about one finger at each of `THRESHOLDS`.

    Args:
        decisions: with a truth; where it is raised is not used.
    """
    times, probability, hold = decisions.times, decisions.probability, decisions.hold
    counter = SlipCounter.of(decisions)
    masks = raised_at_each(times, probability, THRESHOLDS.tolist(), hold)
    return tuple(counter.count(raised) for raised in masks)


def total_curve(curves: Sequence[Curve]) -> Curve:
    """Return the counts of all curves together, at each of `THRESHOLDS`."""
    return tuple(SlipCounts.total(column) for column in zip(*curves, strict=True))


def choose_threshold(curve: Curve, false_alarms: float) -> int | None:
    """Return the place of the lowest threshold with few enough false alarms.

    It has at most so many per minute of all held time, and a slip is reported in at most 2 % of
    quiet hold; so has every higher threshold.

    Args:
        curve: of the recordings from which the threshold is chosen.
        false_alarms: maximum number per minute of held time, of one finger.

    Returns:
        The place in `THRESHOLDS`; None if no threshold fits.
    """
    rates = np.array([60 * counts.false_held / counts.held_seconds for counts in curve])
    raised = np.array(
        [100 * counts.raised_seconds / max(counts.quiet_seconds, 1e-9) for counts in curve]
    )
    place = int(_lowest((rates <= false_alarms) & (raised <= MAX_RAISED_QUIET)))
    return place if place < len(curve) else None


def _lowest(fits: Flags) -> Integers:
    """Return the first place from which on all fit, along the last axis; its length for none."""
    from_end = np.logical_and.accumulate(fits[..., ::-1], axis=-1)
    return np.asarray(fits.shape[-1] - from_end.sum(axis=-1))


@dataclass(frozen=True)
class ThresholdChoice:
    """Choice of a threshold that an interval repeats in each resample.

    Attributes:
        false_alarms: maximum number per minute of held time, of one finger.
    """

    false_alarms: float


def held_out_places(
    curves: Sequence[Curve], groups: Sequence[int], choice: ThresholdChoice
) -> Integers:
    """Return the place of the threshold for each recording, chosen without its group.

    Args:
        curves: of each recording.
        groups: of each recording.
        choice: of the threshold; if no threshold fits, the highest is taken.
    """
    others = np.array([[group != own for group in groups] for own in groups], dtype=np.float64)
    table = [[_ratios(counts) for counts in curve] for curve in curves]
    return _chooser(table, choice)(others)


class _Ratio(NamedTuple):
    """A metric of one recording at one threshold, as part / whole times a factor."""

    part: float
    whole: float
    factor: float = 100


def _ratios(counts: SlipCounts) -> dict[tuple[str, str], _Ratio]:
    """Return the metrics of slips as ratios, by name and, of those that have one, time limit."""
    quiet, held = counts.quiet_seconds, counts.held_seconds
    ratios = {
        ("raised_quiet", ""): _Ratio(counts.raised_seconds, quiet),
        ("false_alarms", "quiet"): _Ratio(counts.false_quiet, quiet, 60),
        ("false_alarms", "held"): _Ratio(counts.false_held, held, 60),
    }
    for name, n_found, n in zip(
        ("before_1mm", "before_3mm"), counts.found_before, counts.n_reached, strict=True
    ):
        ratios[name, ""] = _Ratio(float(n_found), float(n))
    delays = {
        "incipient": counts.delays,
        "gross": counts.gross_delays,
        "over_1mm": counts.delays[counts.is_over_1mm],
    }
    for name, values in delays.items():
        ratios[name, "before"] = _Ratio(float((values < -TIME_TOLERANCE).sum()), len(values))
        for limit in FOUND_WITHIN:
            n_within = float((values <= limit + TIME_TOLERANCE).sum())
            ratios[name, str(limit)] = _Ratio(n_within, len(values))
    return ratios


def slip_intervals(
    curves: Sequence[Curve],
    choice: ThresholdChoice | None = None,
    *,
    training: Sequence[Curve] = (),
    n: int = 1000,
    seed: int = 0,
    level: float = 0.95,
) -> SlipIntervals | None:
    """Compute the intervals of the pooled metrics of slips.

    Args:
        curves: of each recording, at `THRESHOLDS`; of one threshold each without a choice.
        choice: that is made again in each resample; None for a threshold that is given.
        training: of the recordings from which the threshold is chosen, resampled too; by default
            those of `curves`.
        n: number of resamples.
        seed: of the resamples.
        level: fraction of the resamples within each interval.

    Returns:
        The intervals; None with fewer than two recordings.
    """
    if len(curves) < 2:
        return None
    table = [[_ratios(counts) for counts in curve] for curve in curves]
    chosen = _resampled(training, choice, n, seed) if training else _chooser(table, choice)
    intervals: dict[str, dict[str, Interval | None]] = {}
    for name, limit in table[0][0]:
        ratios = [[row[name, limit] for row in curve] for curve in table]
        intervals.setdefault(name, {})[limit] = bootstrap_interval(
            _statistic(ratios, chosen), len(curves), n=n, seed=seed, level=level
        )
    return SlipIntervals(
        incipient=intervals["incipient"],
        gross=intervals["gross"],
        over_1mm=intervals["over_1mm"],
        before_1mm=intervals["before_1mm"][""],
        before_3mm=intervals["before_3mm"][""],
        raised_quiet=intervals["raised_quiet"][""],
        false_alarms_per_minute=intervals["false_alarms"],
    )


def _resampled(
    training: Sequence[Curve], choice: ThresholdChoice | None, n: int, seed: int
) -> Callable[[Array], Integers]:
    """Return a function that gives the thresholds of n resamples of the training recordings."""
    table = [[_ratios(counts) for counts in curve] for curve in training]
    places = _chooser(table, choice)(draw_recordings(len(training), n, seed + 1))
    return lambda draws: places[: len(draws)]


Table = Sequence[Sequence[Mapping[tuple[str, str], _Ratio]]]
"""Metrics of each recording at each threshold."""


def _chooser(table: Table, choice: ThresholdChoice | None) -> Callable[[Array], Integers]:
    """Return a function from draws (n, n_recordings) to the place of the threshold (n,)."""
    if choice is None:
        return lambda draws: np.zeros(len(draws), dtype=np.int64)
    limits = {("false_alarms", "held"): choice.false_alarms, ("raised_quiet", ""): MAX_RAISED_QUIET}
    rates = {name: _rates([[row[name] for row in curve] for curve in table]) for name in limits}

    def places(draws: Array) -> Integers:
        with np.errstate(invalid="ignore"):
            fits = np.logical_and.reduce(
                [~(rate(draws) > limits[name]) for name, rate in rates.items()]
            )
        return np.minimum(_lowest(fits), len(table[0]) - 1)

    return places


def _rates(ratios: Sequence[Sequence[_Ratio]]) -> Callable[[Array], Array]:
    """Return a function from draws (n, n_recordings) to the pooled ratios (n, n_thresholds)."""
    parts = np.array([[ratio.factor * ratio.part for ratio in row] for row in ratios])
    wholes = np.array([row[0].whole for row in ratios], dtype=np.float64)

    def rates(draws: Array) -> Array:
        whole = (draws @ wholes)[:, None]
        out = np.full((len(draws), parts.shape[1]), np.nan)
        np.divide(draws @ parts, whole, out=out, where=whole > 0)
        return out

    return rates


def _statistic(
    ratios: Sequence[Sequence[_Ratio]], chosen: Callable[[Array], Integers]
) -> Statistic:
    rates = _rates(ratios)
    return lambda draws: rates(draws)[np.arange(len(draws)), chosen(draws)]


def slip_summary(
    recordings: Sequence[Mapping[str, SlipCounts]],
    intervals: SlipIntervals | None = None,
    *,
    threshold_chosen: bool = False,
) -> SlipSummary | None:
    """Return the metrics of the slips of several recordings; None if their truth is not known.

    Args:
        recordings: counts of each finger whose slips are known, of each recording.
        intervals: of the pooled metrics.
        threshold_chosen: whether they include the choice of the threshold.
    """
    names = list(dict.fromkeys(name for fingers in recordings for name in fingers))
    if not names:
        return None
    by_name = {
        name: SlipCounts.total(fingers[name] for fingers in recordings if name in fingers)
        for name in names
    }
    return SlipSummary(
        {name: slip_metrics(counts) for name, counts in by_name.items()},
        slip_metrics(SlipCounts.total(by_name.values())),
        intervals,
        threshold_chosen,
    )
