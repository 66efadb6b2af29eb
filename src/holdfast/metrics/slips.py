"""Score of decisions about slips, by the truth: found in time, found early, false alarms."""

import math
from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Self

import msgspec
import numpy as np

from holdfast.contact import TIME_TOLERANCE
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.samples import N_BINS, bins_of
from holdfast.metrics.slip_truth import (
    CREEPING,
    DISTANCES,
    SLIDING,
    STILL,
    Slip,
    SlipDecisions,
    sample_durations,
)
from holdfast.metrics.statistics import percent
from holdfast.metrics.truth_labels import Onsets
from holdfast.sensors.types import Array, Integers

EARLIEST_ALARM = 0.5
"""An alarm that comes more than this time before the onset does not belong to the slip [s]."""
LATEST_ALARM = 0.25
"""Time after the end of a slip in which a raised decision is no false alarm [s]."""
FALSE_ALARM_DURATION = 0.5
"""Each begun part of this length of a decision that is wrongly raised is one false alarm [s]."""
FOUND_WITHIN = (0.03, 0.05, 0.1)
"""Times after the onset within which the slips are counted that are found [s]."""


@dataclass(frozen=True, eq=False)
class SlipCounts:
    """Counts of the slips and alarms of one finger in one or more recordings.

    Attributes:
        delays: (n_slips,) first alarm of each slip minus its onset [s]; infinite without one.
        gross_delays: (n_gross,) the same from the onset of the gross slip [s].
        distances: (n_slips,) slid [m]; NaN where it is not known.
        found_before: (n_distances,) slips found before each of `DISTANCES` was slid.
        n_reached: (n_distances,) slips that slid each of `DISTANCES`.
        false_quiet: false alarms in quiet hold.
        false_held: false alarms in all held time.
        quiet_seconds: duration of quiet hold [s].
        held_seconds: duration of all held time [s].
        raised_seconds: duration of quiet hold in which the decision is raised [s].
        scores: (2, N_BINS) histograms of the probabilities of STILL and SLIDING samples.
        onsets: where the slips come from.
    """

    delays: Array
    gross_delays: Array
    distances: Array
    found_before: Integers
    n_reached: Integers
    false_quiet: int
    false_held: int
    quiet_seconds: float
    held_seconds: float
    raised_seconds: float
    scores: Integers
    onsets: frozenset[Onsets]

    @classmethod
    def total(cls, parts: Iterable[Self]) -> Self:
        """Return the counts of all parts together."""
        every = list(parts)
        none, zeros = np.empty(0), np.zeros(len(DISTANCES), dtype=np.int64)
        return cls(
            np.concatenate([none, *(part.delays for part in every)]),
            np.concatenate([none, *(part.gross_delays for part in every)]),
            np.concatenate([none, *(part.distances for part in every)]),
            sum((part.found_before for part in every), zeros),
            sum((part.n_reached for part in every), zeros),
            sum(part.false_quiet for part in every),
            sum(part.false_held for part in every),
            sum(part.quiet_seconds for part in every),
            sum(part.held_seconds for part in every),
            sum(part.raised_seconds for part in every),
            sum((part.scores for part in every), np.zeros((2, N_BINS), dtype=np.int64)),
            frozenset[Onsets]().union(*(part.onsets for part in every)),
        )

    @property
    def is_over_1mm(self) -> Mask:
        """(n_slips,) True for the slips that slid over 1 mm."""
        return np.asarray(self.distances > DISTANCES[0])


def count_slips(decisions: SlipDecisions) -> SlipCounts:
    """Return the counts of the decisions about one finger in one recording.

    An alarm is a sample at which the decision is raised and was not at the sample before. The
    first alarm from 0.5 s before the onset of a slip on belongs to it: a decision that was raised
    earlier, and stays so, finds nothing. What is raised outside

        [onset - 0.5 s, end + 0.25 s]

    of all slips is wrong: each begun 0.5 s of it is one false alarm. Only samples count in which
    the finger holds the object and does not creep.

    Args:
        decisions: with a truth.

    Raises:
        ValueError: the truth is not known.
    """
    truth = decisions.truth
    if truth is None:
        raise ValueError("decisions with a truth of the slips expected; it is not known")
    times, raised, slips = decisions.times, decisions.raised, truth.slips
    before = np.concatenate([[False], raised[:-1]])
    alarms = times[raised & ~before]
    first = np.array([_first_alarm(alarms, slip) for slip in slips]).reshape(len(slips))
    gross = np.array([not math.isnan(slip.gross) for slip in slips], dtype=bool)
    reached = np.array([slip.reached for slip in slips]).reshape(-1, len(DISTANCES))
    steps = sample_durations(times)
    outside = (truth.codes >= STILL) & (truth.codes != CREEPING) & _outside(slips, times)
    quiet = outside & truth.quiet
    held = truth.codes >= STILL
    known = ~np.isnan(decisions.probability)
    return SlipCounts(
        delays=first - np.array([slip.onset for slip in slips]),
        gross_delays=(first - np.array([slip.gross for slip in slips]))[gross],
        distances=np.array([slip.distance for slip in slips]),
        found_before=(first[:, None] <= reached + TIME_TOLERANCE).sum(axis=0),
        n_reached=(~np.isnan(reached)).sum(axis=0),
        false_quiet=_count_false(raised, quiet, steps),
        false_held=_count_false(raised, outside, steps),
        quiet_seconds=float(steps[quiet].sum()),
        held_seconds=float(steps[held & (truth.codes != CREEPING)].sum()),
        raised_seconds=float(steps[quiet & raised].sum()),
        scores=np.array(
            [
                np.bincount(
                    bins_of(decisions.probability[known & (truth.codes == code)]), minlength=N_BINS
                )
                for code in (STILL, SLIDING)
            ]
        ),
        onsets=frozenset({truth.onsets}),
    )


def _first_alarm(alarms: Array, slip: Slip) -> float:
    """Return the time of the first alarm that belongs to a slip [s]; infinite without one."""
    place = int(np.searchsorted(alarms, slip.onset - EARLIEST_ALARM - TIME_TOLERANCE))
    latest = slip.end + LATEST_ALARM + TIME_TOLERANCE
    return float(alarms[place]) if place < len(alarms) and alarms[place] <= latest else math.inf


def _outside(slips: Sequence[Slip], times: Array) -> Mask:
    """Return (n,) True outside the time of every slip and its alarms."""
    outside = np.ones(len(times), dtype=bool)
    for slip in slips:
        first = slip.onset - EARLIEST_ALARM - TIME_TOLERANCE
        last = slip.end + LATEST_ALARM + TIME_TOLERANCE
        outside[np.searchsorted(times, first) : np.searchsorted(times, last, side="right")] = False
    return outside


def _count_false(raised: Mask, counted: Mask, steps: Array) -> int:
    """Return the false alarms: of each raised run, the counted time in begun parts of 0.5 s."""
    wrong = np.concatenate([[0.0], np.cumsum(np.where(raised & counted, steps, 0.0))])
    spans = runs(raised)
    lengths = wrong[spans[:, 1]] - wrong[spans[:, 0]]
    return int(np.ceil(lengths / FALSE_ALARM_DURATION - TIME_TOLERANCE).clip(min=0).sum())


class SlipMetrics(msgspec.Struct, frozen=True):
    """Metrics of the detection of slips.

    Attributes:
        n: number of slips.
        n_over_1mm: number of slips that slide over 1 mm.
        n_gross: number of slips of which 90 % of the load slides at some time.
        incipient: shares found, from the first sliding [%]: `before` its onset, and until 0.03,
            0.05 and 0.1 s after it.
        gross: the same from the onset of the gross slip; only of slips that become gross.
        over_1mm: the same as `incipient` of slips over 1 mm.
        before_1mm: share of the slips over 1 mm that are found before they have slid 1 mm [%].
        before_3mm: the same of 3 mm.
        raised_quiet: share of quiet hold in which the decision is raised [%].
        false_alarms_per_minute: of one finger, of `quiet` hold and of all `held` time.
        auc: sliding samples against held samples that do not slide.
        quiet_minutes: of one finger [min].
        held_minutes: of one finger, without creep [min].
        onsets: `truth`, `labels`, or `mixed`.
    """

    n: int
    n_over_1mm: int
    n_gross: int
    incipient: dict[str, float | None]
    gross: dict[str, float | None]
    over_1mm: dict[str, float | None]
    before_1mm: float | None
    before_3mm: float | None
    raised_quiet: float | None
    false_alarms_per_minute: dict[str, float | None]
    auc: float | None
    quiet_minutes: float
    held_minutes: float
    onsets: Onsets


def slip_metrics(counts: SlipCounts) -> SlipMetrics:
    """Compute the metrics of slips from their counts."""
    quiet, held = counts.quiet_seconds / 60, counts.held_seconds / 60
    over = counts.is_over_1mm
    still, sliding = counts.scores
    pairs = float(still.sum()) * float(sliding.sum())
    below = np.cumsum(still) - still / 2
    before_1mm, before_3mm = (
        percent(int(n_found), int(n))
        for n_found, n in zip(counts.found_before, counts.n_reached, strict=True)
    )
    return SlipMetrics(
        n=len(counts.delays),
        n_over_1mm=int(over.sum()),
        n_gross=len(counts.gross_delays),
        incipient=found_shares(counts.delays),
        gross=found_shares(counts.gross_delays),
        over_1mm=found_shares(counts.delays[over]),
        before_1mm=before_1mm,
        before_3mm=before_3mm,
        raised_quiet=percent(counts.raised_seconds, counts.quiet_seconds),
        false_alarms_per_minute={
            "quiet": counts.false_quiet / quiet if quiet else None,
            "held": counts.false_held / held if held else None,
        },
        auc=float((sliding * below).sum()) / pairs if pairs else None,
        quiet_minutes=quiet,
        held_minutes=held,
        onsets=_common(counts.onsets),
    )


def found_shares(delays: Array) -> dict[str, float | None]:
    """Return the shares of slips found before the onset and within some times after it [%]."""
    n_before = int((delays < -TIME_TOLERANCE).sum())
    shares = {"before": percent(n_before, len(delays))}
    for limit in FOUND_WITHIN:
        n_found = int((delays <= limit + TIME_TOLERANCE).sum())
        shares[str(limit)] = percent(n_found, len(delays))
    return shares


def _common(onsets: AbstractSet[Onsets]) -> Onsets:
    return next(iter(onsets), "labels") if len(onsets) < 2 else "mixed"
