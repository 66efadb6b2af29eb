"""Slips at many thresholds: their counts, the choice of a threshold, intervals with the choice."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import msgspec
import numpy as np

from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.slips import (
    BY_THRESHOLD,
    SlipCounter,
    SlipCounts,
    SlipMetrics,
    n_found,
    slip_metrics,
)
from holdfast.metrics.statistics import (
    Interval,
    bootstrap_interval,
    draw_recordings,
    ratio_of_sums,
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

DISTURBED_SHARE = 0.4
"""Share of held time in which something pushes or moves the object in use: an assumption, near the
share in the paper's experiment."""

MAX_FLAGS = 1 << 22
"""Number of samples times thresholds that are counted at a time: bounds the memory."""
FALSE_ALARMS = "false_alarms_per_minute"
N_RESAMPLES = 1000
"""Number of resamples of an interval."""

Ratios = Mapping[tuple[str, str], tuple[Array, Array]]
"""Metrics by name and, of those that have one, time limit: of each recording, the parts
(n_recordings, n_thresholds) and the wholes (n_recordings,) of a ratio."""
CountedIn = Literal["held", "quiet", "use"]
"""Time in which the false alarms of a choice count, see `choose_threshold`."""


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


def slip_curve(decisions: SlipDecisions) -> SlipCounts:
    """Return the counts of decisions about one finger at each of `SLIP_THRESHOLDS`.

    Args:
        decisions: with a truth; where it is raised is not used.
    """
    counter = SlipCounter.of(decisions)
    n = max(1, MAX_FLAGS // max(len(decisions.times), 1))
    blocks = [SLIP_THRESHOLDS[first : first + n] for first in range(0, len(SLIP_THRESHOLDS), n)]
    parts = [counter.count(decisions.raised_at(block)) for block in blocks]
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in BY_THRESHOLD
    }
    return replace(parts[0], **joined)


def choose_threshold(
    curve: SlipCounts, false_alarms: float, counted_in: CountedIn = "held"
) -> int | None:
    """Return the index in `SLIP_THRESHOLDS` of the choice on a curve.

    It is the lowest threshold with few enough false alarms, and a slip reported in at most
    `MAX_RAISED_QUIET` of quiet hold, so long as every higher one fits, too: a lucky low threshold
    below a bad one is not taken. It is None if no threshold fits, or nothing is held.

    Args:
        curve: counts at each threshold.
        false_alarms: maximum number per minute of one finger.
        counted_in: all `held` time, pushes included; `quiet` hold alone; or the rate in `use`.
            What is surely held of guided grasps is disturbed for a smaller share of its time than
            s = 0.4 in use, so quiet and disturbed time are weighted:

            rate = (1 - s) rate_quiet + s rate_disturbed + 1 / time

            with one alarm more, which is the mean of a Poisson rate of which a number is known.
    """
    index = int(_lowest(_ratios([curve]), false_alarms, counted_in, np.ones((1, 1)))[0])
    return index if index < len(curve) else None


def _ratios(curves: Sequence[SlipCounts]) -> Ratios:
    """Return the metrics of slips of recordings as ratios."""

    def stacked(values: Iterable[object]) -> Array:
        return np.array(list(values), dtype=np.float64)

    quiet, held = stacked(c.quiet_seconds for c in curves), stacked(c.held_seconds for c in curves)
    ratios = {
        ("raised_quiet", ""): (stacked(100 * c.raised_seconds for c in curves), quiet),
        (FALSE_ALARMS, "quiet"): (stacked(60 * c.false_quiet for c in curves), quiet),
        (FALSE_ALARMS, "held"): (stacked(60 * c.false_held for c in curves), held),
    }
    for k, name in enumerate(("before_1mm", "before_3mm")):
        early = stacked(100 * c.found_before[:, k] for c in curves)
        ratios[name, ""] = early, stacked(c.n_reached[k] for c in curves)
    for name, delays in {
        "incipient": [c.delays for c in curves],
        "gross": [c.gross_delays for c in curves],
        "over_1mm": [c.delays[:, c.is_over_1mm] for c in curves],
    }.items():
        n, found = stacked(d.shape[1] for d in delays), [n_found(d) for d in delays]
        for limit in found[0]:
            ratios[name, limit] = stacked(100 * by_limit[limit] for by_limit in found), n
    return ratios


def _lowest(ratios: Ratios, false_alarms: float, counted_in: CountedIn, draws: Array) -> Integers:
    """Return the index of the chosen threshold in each resample.

    Args:
        ratios: of the recordings.
        false_alarms: maximum number per minute.
        counted_in: as in `choose_threshold`.
        draws: (n, n_recordings) how often each is drawn.

    Returns:
        (n,) indices; the number of thresholds where none fits, or nothing is held.
    """
    names = ("raised_quiet", ""), (FALSE_ALARMS, "quiet"), (FALSE_ALARMS, "held")
    drawn = [(draws @ ratios[name][0], (draws @ ratios[name][1])[:, None]) for name in names]
    (raised, quiet), (n_quiet, _), (n, seconds) = drawn
    disturbed = seconds - quiet
    if counted_in == "quiet":
        n, seconds = n_quiet, quiet
    elif counted_in == "use" and quiet.all() and disturbed.all():
        rate = (1 - DISTURBED_SHARE) * n_quiet / quiet
        rate += DISTURBED_SHARE * (n - n_quiet) / disturbed
        n = seconds * rate + 60  # `n` is per minute
    # Without held time the rate is not known, so no threshold fits; without quiet hold nothing can
    # be raised in it.
    fits = (n <= false_alarms * seconds) & (seconds > 0) & (raised <= MAX_RAISED_QUIET * quiet)
    unbroken = np.logical_and.accumulate(fits[:, ::-1], axis=1)  # from the highest on
    return np.asarray(fits.shape[1] - unbroken.sum(axis=1))


def held_out_indices(
    curves: Sequence[SlipCounts],
    false_alarms: float,
    groups: Sequence[int],
    draws: Array,
    counted_in: CountedIn = "held",
) -> Integers:
    """Return the index of the threshold for each recording, chosen without its group.

    Args:
        curves: of each recording.
        false_alarms: maximum number per minute; if no threshold fits, the highest is taken.
        groups: of each recording.
        draws: (n, n_recordings) how often each is drawn.
        counted_in: as in `choose_threshold`.

    Returns:
        (n, n_recordings).
    """
    ratios, own = _ratios(curves), np.array(groups)
    indices = np.empty(draws.shape, dtype=np.int64)
    for group in np.unique(own):
        others = np.where(own == group, 0.0, draws)
        indices[:, own == group] = _lowest(ratios, false_alarms, counted_in, others)[:, None]
    return np.asarray(np.minimum(indices, len(curves[0]) - 1))


def slip_intervals(
    curves: Sequence[SlipCounts],
    indices: Integers | None = None,
    *,
    n: int = N_RESAMPLES,
    seed: int = 0,
) -> SlipIntervals | None:
    """Compute the intervals of the pooled metrics of slips.

    Args:
        curves: of each recording; of one threshold each without indices.
        indices: (n, n_recordings), or (n, 1), thresholds of each resample.
        n: number of resamples.
        seed: of the resamples.

    Returns:
        The intervals; None with fewer than two recordings.
    """
    if len(curves) < 2:
        return None
    chosen = np.zeros((n, 1), dtype=np.int64) if indices is None else indices
    chosen, rows = np.broadcast_to(chosen, (n, len(curves))), np.arange(len(curves))
    intervals: dict[str, dict[str, Interval | None]] = {}
    for (name, limit), (parts, wholes) in _ratios(curves).items():
        statistic = ratio_of_sums(parts[rows, chosen], wholes)
        interval = bootstrap_interval(statistic, len(curves), n=n, seed=seed)
        intervals.setdefault(name, {})[limit] = interval
    values: dict[str, Any] = {
        name: by_limit.get("", by_limit) for name, by_limit in intervals.items()
    }
    return SlipIntervals(**values)


def slip_summary(
    recordings: Sequence[Mapping[str, SlipCounts]],
    intervals: SlipIntervals | None = None,
    *,
    threshold_chosen: bool = False,
) -> SlipSummary:
    """Return the metrics of the slips of several recordings.

    Args:
        recordings: counts of each finger whose slips are known, of each recording.
        intervals: of the pooled metrics.
        threshold_chosen: whether they include the choice of the threshold.
    """
    names = list(dict.fromkeys(name for fingers in recordings for name in fingers))
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
    curves: Sequence[Mapping[str, SlipCounts]],
    false_alarms: float,
    counted_in: CountedIn = "held",
    *,
    groups: Sequence[int] = (),
    training: Sequence[Mapping[str, SlipCounts]] = (),
    seed: int = 0,
) -> SlipSummary:
    """Return the metrics of recordings, each at a threshold that is chosen without it.

    Args:
        curves: of each finger, of each recording.
        false_alarms: maximum number per minute, for which the threshold is chosen again in each
            resample; if no threshold fits, the highest is taken.
        counted_in: as in `choose_threshold`.
        groups: of each recording; its threshold is chosen from the other groups. By default each
            recording is one.
        training: curves of other recordings, from which it is chosen instead.
        seed: of the bootstrap, which draws from `training` too.
    """
    pooled, others = (
        [SlipCounts.total(fingers.values()) for fingers in recordings]
        for recordings in (curves, training)
    )

    def chosen(draw: Callable[[int, int], Array]) -> Integers:
        if not others:
            draws = draw(len(pooled), seed)
            own = groups or range(len(pooled))
            return held_out_indices(pooled, false_alarms, own, draws, counted_in)
        # The other recordings are another sample of the world: their draws have their own seed.
        draws = draw(len(others), seed + 1)
        lowest = _lowest(_ratios(others), false_alarms, counted_in, draws)
        return np.asarray(np.minimum(lowest, len(others[0]) - 1))[:, None]

    (indices,) = chosen(lambda n, _: np.ones((1, n)))
    counts = [
        {finger: curve[index] for finger, curve in fingers.items()}
        for fingers, index in zip(curves, np.broadcast_to(indices, len(curves)), strict=True)
    ]
    resampled = chosen(lambda n, seed: draw_recordings(n, N_RESAMPLES, seed))
    intervals = slip_intervals(pooled, resampled, seed=seed)
    return slip_summary(counts, intervals, threshold_chosen=True)
