"""Counts of slips at many thresholds: choice of a threshold, and intervals that include it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Self

import msgspec
import numpy as np

from holdfast.contact import TIME_TOLERANCE
from holdfast.metrics.masks import Mask
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.slips import (
    FOUND_WITHIN,
    SlipCounter,
    SlipCounts,
    SlipCurve,
    SlipMetrics,
    slip_metrics,
)
from holdfast.metrics.statistics import (
    Interval,
    Statistic,
    bootstrap_interval,
    draw_recordings,
)
from holdfast.sensors.types import Array, Integers

LOG_ODDS = np.arange(-160, 161) * 0.05
"""Log odds of the thresholds that are tried, for every head."""
THRESHOLDS = 1.0 / (1.0 + np.exp(-LOG_ODDS))
"""Thresholds of a probability that are tried, lowest first."""
SLIP_THRESHOLD_LOG_ODDS, SLIP_THRESHOLDS = LOG_ODDS[80:], THRESHOLDS[80:]
"""Those of a slip, which are not below a probability of 0.018."""
MAX_RAISED_QUIET = 2.0
"""Maximum share of quiet hold in which a slip may be reported [%]."""

MAX_DISTURBED_SHARE = 0.4
"""Maximum share of held time in which something pushes or moves the object, when a rate of false
alarms is taken from grasps that were made to teach: an assumption, near the share in the paper's
experiment."""

MAX_FLAGS = 1 << 22
"""Number of samples times thresholds that are counted at a time: bounds the memory."""


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


def slip_curve(decisions: SlipDecisions) -> SlipCurve:
    """Return the counts of decisions about one finger at each of `SLIP_THRESHOLDS`.

    Args:
        decisions: with a truth; where it is raised is not used.
    """
    counter = SlipCounter.of(decisions)
    n = max(1, MAX_FLAGS // max(len(decisions.times), 1))
    blocks = [SLIP_THRESHOLDS[first : first + n] for first in range(0, len(SLIP_THRESHOLDS), n)]
    return SlipCurve.joined([counter.count(decisions.raised_at(block)) for block in blocks])


def choose_threshold(
    curve: SlipCurve, false_alarms: float, counted_in: Literal["held", "quiet"] = "held"
) -> int | None:
    """Return the place of the lowest threshold with few enough false alarms.

    It has at most so many per minute, and a slip is reported in at most 2 % of quiet hold; so has
    every higher threshold.

    Args:
        curve: of the recordings from which the threshold is chosen.
        false_alarms: maximum number per minute, of one finger.
        counted_in: all held time, or quiet hold alone.

    Returns:
        The place in `SLIP_THRESHOLDS`; None if no threshold fits, or nothing is held.
    """
    choice = ThresholdChoice(false_alarms, counted_in)
    index = int(_places(_limited([_ratios(curve)], choice), choice, np.ones((1, 1)))[0])
    return index if index < len(curve) else None


def weighted_threshold(curve: SlipCurve, false_alarms: float) -> int | None:
    """Return the place of the lowest threshold with few enough false alarms in ordinary use.

    Grasps that are made to teach have more pushes than use has. So where more than 0.4 of their
    held time is disturbed, the rates of quiet and of disturbed time are weighted by the shares
    1 - s = 0.6 and s = 0.4:

        rate = (1 - s) rate_quiet + s rate_disturbed

    Otherwise s is their own share, so that the rate is that of all held time, as of
    `choose_threshold`. The rate itself counts, no bound above it: docs/teach.md has both.

    Args:
        curve: of the grasps, out of fold.
        false_alarms: maximum number per minute, of one finger.

    Returns:
        The place in `SLIP_THRESHOLDS`; None if no threshold fits, or nothing is held.
    """
    quiet, held = curve.silent.quiet_seconds / 60, curve.silent.held_seconds / 60
    if not held:
        return None
    disturbed = held - quiet
    share = min(disturbed / held, MAX_DISTURBED_SHARE) if quiet else 1.0
    rate = np.zeros(len(curve))
    if quiet:
        rate += (1 - share) * curve.false_quiet / quiet
    if share:
        rate += share * (curve.false_held - curve.false_quiet) / disturbed
    fits = (rate <= false_alarms) & (curve.raised_seconds <= MAX_RAISED_QUIET / 100 * 60 * quiet)
    index = int(_lowest_fit(fits))
    return index if index < len(fits) else None


@dataclass(frozen=True)
class ThresholdChoice:
    """Choice of a threshold that an interval repeats in each resample.

    Attributes:
        false_alarms: maximum number per minute, of one finger.
        counted_in: all held time, pushes and glitches included, or quiet hold alone. Either way
            a slip is reported in at most 2 % of quiet hold.
    """

    false_alarms: float
    counted_in: Literal["held", "quiet"] = "held"


def held_out_places(
    curves: Sequence[SlipCurve], groups: Sequence[int], choice: ThresholdChoice
) -> Integers:
    """Return the place of the threshold for each recording, chosen without its group.

    Args:
        curves: of each recording.
        groups: of each recording.
        choice: of the threshold; if no threshold fits, the highest is taken.
    """
    table = [_ratios(curve) for curve in curves]
    indices = _held_out(table, choice, groups, np.ones((1, len(curves))))
    return indices.reshape(-1)


class _Ratio(NamedTuple):
    """A metric of one recording at each threshold, as parts (n_thresholds,) / whole."""

    parts: Array
    whole: float


def _ratios(curve: SlipCurve) -> dict[tuple[str, str], _Ratio]:
    """Return the metrics of slips as ratios, by name and, of those that have one, time limit."""
    silent = curve.silent
    quiet, held = silent.quiet_seconds, silent.held_seconds
    ratios = {
        ("raised_quiet", ""): _Ratio(100 * curve.raised_seconds, quiet),
        ("false_alarms", "quiet"): _Ratio(60 * curve.false_quiet.astype(np.float64), quiet),
        ("false_alarms", "held"): _Ratio(60 * curve.false_held.astype(np.float64), held),
    }
    for name, n_found, n in zip(
        ("before_1mm", "before_3mm"), curve.found_before.T, silent.n_reached, strict=True
    ):
        ratios[name, ""] = _Ratio(100.0 * n_found, float(n))
    delays = {
        "incipient": curve.delays,
        "gross": curve.gross_delays,
        "over_1mm": curve.delays[:, silent.is_over_1mm],
    }
    for name, values in delays.items():
        limits = {"before": values < -TIME_TOLERANCE}
        limits |= {str(limit): values <= limit + TIME_TOLERANCE for limit in FOUND_WITHIN}
        for limit, found in limits.items():
            ratios[name, limit] = _Ratio(100.0 * found.sum(axis=1), values.shape[1])
    return ratios


def slip_intervals(
    curves: Sequence[SlipCurve],
    choice: ThresholdChoice | None = None,
    *,
    groups: Sequence[int] = (),
    training: Sequence[SlipCurve] = (),
    n: int = 1000,
    seed: int = 0,
    level: float = 0.95,
) -> SlipIntervals | None:
    """Compute the intervals of the pooled metrics of slips.

    Args:
        curves: of each recording, at `SLIP_THRESHOLDS`; of one threshold each without a choice.
        choice: that is made again in each resample; None for a threshold that is given.
        groups: of each recording: the threshold of a recording is chosen from the recordings of
            the other groups in the resample; by default each recording is one.
        training: of other recordings, from which the threshold is chosen, resampled too.
        n: number of resamples.
        seed: of the resamples.
        level: fraction of the resamples within each interval.

    Returns:
        The intervals; None with fewer than two recordings.
    """
    if len(curves) < 2:
        return None
    table = [_ratios(curve) for curve in curves]
    draws = draw_recordings(len(curves), n, seed)
    if choice is None:
        indices = np.zeros((n, 1), dtype=np.int64)
    elif training:
        # The other recordings are another sample of the world: their draws have their own seed.
        drawn = draw_recordings(len(training), n, seed + 1)
        limited = _limited([_ratios(curve) for curve in training], choice)
        indices = np.minimum(_places(limited, choice, drawn), len(training[0]) - 1)[:, None]
    else:
        indices = _held_out(table, choice, groups or range(len(curves)), draws)
    intervals: dict[str, dict[str, Interval | None]] = {}
    for name, limit in table[0]:
        intervals.setdefault(name, {})[limit] = bootstrap_interval(
            _statistic(table, (name, limit), indices), len(curves), n=n, seed=seed, level=level
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


Table = Sequence[Mapping[tuple[str, str], _Ratio]]
"""Metrics of each recording."""


def _held_out(
    table: Table, choice: ThresholdChoice, groups: Sequence[int], draws: Array
) -> Integers:
    """Return the place of the threshold of each recording, chosen without its group.

    Args:
        table: of the recordings.
        choice: of the threshold; if no threshold fits, the highest is taken.
        groups: of each recording.
        draws: (n, n_recordings) how often each is drawn.

    Returns:
        (n, n_recordings) places.
    """
    own = np.array(groups)
    limited = _limited(table, choice)
    indices = np.empty(draws.shape, dtype=np.int64)
    for group in np.unique(own):
        others = np.where(own == group, 0.0, draws)
        indices[:, own == group] = _places(limited, choice, others)[:, None]
    return np.asarray(np.minimum(indices, limited[0].n_thresholds - 1))


def _limits(choice: ThresholdChoice) -> dict[tuple[str, str], float]:
    """Return the limits of the metrics by which a threshold is chosen."""
    return {
        ("false_alarms", choice.counted_in): choice.false_alarms,
        ("raised_quiet", ""): MAX_RAISED_QUIET,
    }


def _limited(table: Table, choice: ThresholdChoice) -> "list[_Sums]":
    """Return the metrics by which a threshold is chosen, in the order of `_limits`."""
    return [_Sums.of(table, name) for name in _limits(choice)]


def _places(limited: "Sequence[_Sums]", choice: ThresholdChoice, draws: Array) -> Integers:
    """Return the lowest threshold within the limits in each resample.

    Args:
        limited: metrics as of `_limited`.
        choice: of the threshold.
        draws: (n, n_recordings) how often each is drawn.

    Returns:
        (n,) places; the number of thresholds where none fits, or nothing is held.
    """
    fits = []
    for sums, (name, limit) in zip(limited, _limits(choice).items(), strict=True):
        parts, wholes = sums.drawn(draws)
        # Without held time the rate is not known, so no threshold fits; without quiet hold nothing
        # can be raised in it.
        fits.append((parts <= limit * wholes) & ((wholes > 0) | (name[0] == "raised_quiet")))
    return _lowest_fit(np.logical_and.reduce(fits))


def _lowest_fit(fits: Mask) -> Integers:
    """Return the place of the lowest threshold from which on all higher ones fit, too.

    It is what is left of the unbroken run at the end, so that a lucky low threshold below a bad one
    is not taken.

    Args:
        fits: (..., n_thresholds), lowest first.

    Returns:
        (...,) places; the number of thresholds where none fits.
    """
    from_end = np.logical_and.accumulate(fits[..., ::-1], axis=-1)
    return np.asarray(from_end.shape[-1] - from_end.sum(axis=-1))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Parts and wholes of a metric of each recording.

    Attributes:
        parts: (n_recordings, n_thresholds).
        wholes: (n_recordings,).
    """

    parts: Array
    wholes: Array

    @classmethod
    def of(cls, table: Table, name: tuple[str, str]) -> Self:
        """Return those of one metric of a table."""
        ratios = [recording[name] for recording in table]
        wholes = np.array([ratio.whole for ratio in ratios], dtype=np.float64)
        return cls(np.array([ratio.parts for ratio in ratios]), wholes)

    @property
    def n_thresholds(self) -> int:
        """Number of thresholds."""
        return int(self.parts.shape[1])

    def drawn(self, draws: Array) -> tuple[Array, Array]:
        """Return the sums of resamples: parts (n, n_thresholds) and wholes (n, 1)."""
        return draws @ self.parts, (draws @ self.wholes)[:, None]


def _statistic(table: Table, name: tuple[str, str], indices: Integers) -> Statistic:
    """Return the statistic of a metric, each recording at its threshold.

    Args:
        table: of the recordings.
        name: of the metric.
        indices: (n, n_recordings), or (n, 1) for one threshold of all.
    """
    sums = _Sums.of(table, name)
    parts = sums.parts[
        np.arange(len(sums.parts)), np.broadcast_to(indices, (len(indices), len(sums.parts)))
    ]

    def rates(draws: Array) -> Array:
        out, whole = np.full(len(draws), np.nan), draws @ sums.wholes
        np.divide((draws * parts).sum(axis=1), whole, out=out, where=whole > 0)
        return out

    return rates


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


def summarise_choice(
    curves: Sequence[Mapping[str, SlipCurve]],
    choice: ThresholdChoice,
    *,
    groups: Sequence[int] = (),
    training: Sequence[Mapping[str, SlipCurve]] = (),
    seed: int = 0,
) -> SlipSummary | None:
    """Return the metrics of recordings, each at a threshold that is chosen without it.

    Args:
        curves: of each finger, of each recording.
        choice: of the threshold; if no threshold fits, the highest is taken.
        groups: of each recording; its threshold is chosen from the other groups.
        training: curves of other recordings, from which it is chosen instead.
        seed: of the bootstrap, which draws from `training` too.

    Returns:
        The metrics; None if no slips are known.
    """
    pooled, others = (
        [SlipCurve.total(list(fingers.values())) for fingers in recordings]
        for recordings in (curves, training)
    )
    if others:
        total = SlipCurve.total(others)
        index = choose_threshold(total, choice.false_alarms, choice.counted_in)
        indices = [len(total) - 1 if index is None else index] * len(curves)
    else:
        indices = held_out_places(pooled, groups, choice).tolist()
    counts = [
        {finger: curve[index] for finger, curve in fingers.items()}
        for fingers, index in zip(curves, indices, strict=True)
    ]
    intervals = slip_intervals(pooled, choice, groups=groups, training=others, seed=seed)
    return slip_summary(counts, intervals, threshold_chosen=True)
