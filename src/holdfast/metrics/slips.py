"""Score of decisions about slips, by the truth: found in time, found early, false alarms."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import msgspec
import numpy as np

from holdfast.contact import TIME_TOLERANCE
from holdfast.metrics.alarms import first_alarms, outside
from holdfast.metrics.masks import Mask
from holdfast.metrics.samples import N_BINS, bins_of
from holdfast.metrics.slip_truth import (
    CREEPING,
    DISTANCES,
    NOT_HELD,
    SLIDING,
    STILL,
    SlipDecisions,
    sample_durations,
)
from holdfast.metrics.statistics import percent
from holdfast.metrics.truth_labels import Onsets, common_onsets
from holdfast.sensors.types import Array, Integers

EARLIEST_ALARM = 0.5
"""An alarm that comes more than this time before the onset does not belong to the slip [s]."""
LATEST_ALARM = 0.25
"""Time after the end of a slip in which a raised decision is no false alarm [s]."""
FALSE_ALARM_DURATION = 0.5
"""Each begun part of this length of a decision that is wrongly raised is one false alarm [s]."""
GAP_PERIODS = 3.0
"""A longer step between samples is a gap; no more than so many periods of it count."""
FOUND_WITHIN = (0.03, 0.05, 0.1)
"""Times after the onset within which the slips are counted that are found [s]."""


Count = Any
"""A number; of counts at several thresholds, (n_thresholds,)."""


@dataclass(frozen=True, eq=False)
class SlipCounts:
    """Counts of the slips and alarms of one finger in one or more recordings.

    They are of one threshold, or of several, the lowest first: then the fields of `BY_THRESHOLD`
    have a first axis (n_thresholds,).

    Attributes:
        delays: (n_slips,) first alarm of each slip minus its onset [s]; infinite without one.
        gross_delays: (n_gross,) the same from the onset of the gross slip [s].
        distances: (n_slips,) slid [m]; NaN where it is not known.
        found_before: (n_distances,) slips found before each of `DISTANCES` was slid.
        n_reached: (n_distances,) slips that slid each of `DISTANCES`.
        false_quiet: false alarms in quiet hold.
        false_held: false alarms in all held time.
        quiet_seconds: duration of the quiet hold among it [s].
        held_seconds: duration of all held time in which an alarm is wrong [s].
        raised_seconds: duration of quiet hold in which the decision is raised [s].
        scores: (2, N_BINS) histograms of the probabilities of STILL and SLIDING samples.
        onsets: where the slips come from.
        n_impacts: impacts on object or arm in which the finger holds the object and is away from
            its slips.
        false_impacts: those in which the decision is raised, until 0.25 s after their end.
        known_seconds: duration of held time that slides or is still [s].
        unknown_seconds: duration of the other held time [s]; 0 by a truth.
    """

    delays: Array
    gross_delays: Array
    distances: Array
    found_before: Integers
    n_reached: Integers
    false_quiet: Count
    false_held: Count
    quiet_seconds: float
    held_seconds: float
    raised_seconds: Count
    scores: Integers
    onsets: frozenset[Onsets]
    n_impacts: int = 0
    false_impacts: Count = 0
    known_seconds: float = 0.0
    unknown_seconds: float = 0.0

    @classmethod
    def total(cls, parts: Iterable[Self]) -> Self:
        """Return the counts of all parts together; without parts, of one threshold."""
        none, zeros = np.empty(0), np.zeros(len(DISTANCES), dtype=np.int64)
        scores = np.zeros((2, N_BINS), dtype=np.int64)
        empty = cls(none, none, none, zeros, zeros, 0, 0, 0.0, 0.0, 0.0, scores, frozenset())
        every = list(parts) or [empty]
        by_name: dict[str, Any] = {
            item.name: [getattr(part, item.name) for part in every] for item in fields(cls)
        }
        joined: dict[str, Any] = {
            name: np.concatenate(by_name.pop(name), axis=-1) for name in PER_SLIP
        }
        onsets = frozenset[Onsets]().union(*by_name.pop("onsets"))
        return cls(**joined, onsets=onsets, **{name: sum(by_name[name]) for name in by_name})

    @property
    def is_over_1mm(self) -> Mask:
        """(n_slips,) True for the slips that slid over 1 mm."""
        return np.asarray(self.distances > DISTANCES[0])

    def __len__(self) -> int:
        """Return the number of thresholds of counts of several."""
        return len(self.delays)

    def __getitem__(self, index: int) -> Self:
        """Return the counts of one of several thresholds."""
        taken = {name: getattr(self, name)[index] for name in BY_THRESHOLD}
        return replace(self, **{k: v if v.ndim else v.item() for k, v in taken.items()})

    @property
    def as_curve(self) -> Self:
        """Counts of one threshold as a curve of one."""
        values: dict[str, Any] = {name: np.array(getattr(self, name)) for name in BY_THRESHOLD}
        return replace(self, **{name: value[None] for name, value in values.items()})


PER_SLIP = ("delays", "gross_delays", "distances")
"""Fields of `SlipCounts` whose last axis are slips."""
BY_THRESHOLD = (
    "delays", "gross_delays", "found_before", "false_quiet", "false_held", "raised_seconds",
    "false_impacts",
)  # fmt: skip
"""Fields of `SlipCounts` that depend on the threshold."""


def count_slips(decisions: SlipDecisions) -> SlipCounts:
    """Return the counts of the decisions about one finger in one recording.

    An alarm is a sample at which the decision is raised and was not at the sample before. The
    first alarm from 0.5 s before the onset of a slip on belongs to it: a decision that was raised
    earlier, and stays so, finds nothing. What is raised outside

        [onset - 0.5 s, end + 0.25 s]

    of all slips is wrong: each begun 0.5 s of it is one false alarm. Only samples count in which
    the finger holds the object and is still: creep, and sliding that is too short for a slip, are
    neither right nor wrong. Rates are of the time that counts.

    Args:
        decisions: with a truth.

    Raises:
        ValueError: the truth is not known.
    """
    return SlipCounter.of(decisions).count(decisions.raised[None])[0]


@dataclass(frozen=True, eq=False)
class SlipCounter:
    """Counter of the slips and alarms of one finger in one recording, at any threshold.

    What the truth alone determines is computed once.

    Attributes:
        times: (n,) of the decisions [s].
        slips: (n_slips, 4) of each slip: first and last time of its alarms, its onset and its
            gross onset [s]; the last NaN if it never becomes gross.
        away: (n,) True outside the time of the slips and their alarms.
        reached: (n_slips, n_distances) times at which each of `DISTANCES` was slid [s].
        impacts: (n_impacts, 2) first sample of the alarms by each impact that counts, and of what
            follows them.
        quiet: (n + 1,) duration of quiet hold outside the slips before each sample [s].
        outside: (n + 1,) the same of all held time outside the slips.
        known: fields of the counts that do not depend on the threshold.
    """

    times: Array
    slips: Array
    away: Mask
    reached: Array
    impacts: Integers
    quiet: Array
    outside: Array
    known: dict[str, Any]

    @classmethod
    def of(cls, decisions: SlipDecisions) -> Self:
        """Return the counter of decisions; where they are raised is not used.

        Raises:
            ValueError: the truth is not known.
        """
        truth = decisions.truth
        if truth is None:
            raise ValueError("decisions with a truth of the slips expected; it is not known")
        times, slips = decisions.times, truth.slips
        steps = sample_durations(times)
        steps = np.minimum(steps, GAP_PERIODS * np.median(steps)) if len(steps) else steps
        early, late = EARLIEST_ALARM + TIME_TOLERANCE, LATEST_ALARM + TIME_TOLERANCE
        windows = np.array(
            [(slip.onset - early, slip.end + late, slip.onset, slip.gross) for slip in slips]
        ).reshape(-1, 4)
        reached = np.array([slip.reached for slip in slips]).reshape(-1, len(DISTANCES))
        away = outside(times, windows[:, :2])
        counted = away & (truth.codes == STILL)
        quiet = counted & truth.quiet

        def elapsed(mask: Mask) -> Array:
            return np.concatenate([[0.0], np.cumsum(np.where(mask, steps, 0.0))])

        # An impact that makes the finger slide, or comes near a slip, counts as that slip.
        wrong = np.concatenate([[0], np.cumsum(~away | (truth.codes == NOT_HELD))])
        spans = np.array(truth.impacts).reshape(-1, 2) + np.array([-TIME_TOLERANCE, late])
        impacts = np.searchsorted(times, spans)
        first, last = impacts.T
        impacts = impacts[(wrong[last] == wrong[first]) & (last > first)]

        decided = ~np.isnan(decisions.probability)
        histograms = [
            np.bincount(
                bins_of(decisions.probability[decided & (truth.codes == code)]), minlength=N_BINS
            )
            for code in (STILL, SLIDING)
        ]
        known = {
            "distances": np.array([slip.distance for slip in slips]),
            "n_reached": (~np.isnan(reached)).sum(axis=0),
            "quiet_seconds": float(steps[quiet].sum()),
            "held_seconds": float(steps[counted].sum()),
            "scores": np.array(histograms),
            "onsets": frozenset({truth.onsets}),
            "n_impacts": len(impacts),
            "known_seconds": float(steps[np.isin(truth.codes, (STILL, SLIDING))].sum()),
            "unknown_seconds": float(steps[truth.codes == CREEPING].sum())
            if truth.onsets != "truth"
            else 0.0,
        }
        spent = elapsed(quiet), elapsed(counted)
        return cls(times, windows, away, reached, impacts, *spent, known)

    def count(self, raised: Mask) -> SlipCounts:
        """Return the counts at several thresholds.

        Args:
            raised: (n_thresholds, n) True where the decision is raised.
        """
        # An alarm within a slip's time finds it; a run counts as wrong where it is away from slips,
        # so that one which goes on after a slip is wrong only there.
        rows, starts, _ = _runs_of_rows(raised)
        alarms = rows * len(self.times) + starts
        first = first_alarms(self.times, alarms, self.slips[:, :2], len(raised))
        _, _, onset, gross = self.slips.T
        rows, starts, ends = _runs_of_rows(raised & self.away)
        quiet, outside = (spent[ends] - spent[starts] for spent in (self.quiet, self.outside))

        def by_row(values: Array) -> Array:
            return np.asarray(np.bincount(rows, weights=values, minlength=len(raised)), np.float64)

        def n_false(seconds: Array) -> Integers:
            # A decision that stays raised is wrong again in each begun 0.5 s, so that one which is
            # never taken back is no single false alarm.
            begun = np.ceil(seconds / FALSE_ALARM_DURATION - TIME_TOLERANCE).clip(min=0)
            return by_row(begun).astype(np.int64)

        n_alarmed = np.zeros(len(raised), dtype=np.int64)
        for begin, end in self.impacts:
            n_alarmed += raised[:, begin:end].any(axis=1)
        return SlipCounts(
            **self.known,
            delays=first - onset,
            gross_delays=(first - gross)[:, ~np.isnan(gross)],
            found_before=(first[:, :, None] <= self.reached + TIME_TOLERANCE).sum(axis=1),
            false_quiet=n_false(quiet),
            false_held=n_false(outside),
            raised_seconds=by_row(quiet),
            false_impacts=n_alarmed,
        )


def _runs_of_rows(masks: Mask) -> tuple[Integers, Integers, Integers]:
    """Return row, first sample and first sample after each run of True in masks (m, n)."""
    padded = np.pad(masks, ((0, 0), (1, 1))).view(np.int8)
    rows, samples = np.divmod(np.flatnonzero(np.diff(padded)), padded.shape[1] - 1)
    return rows[::2], samples[::2], samples[1::2]


class ImpactMetrics(msgspec.Struct, frozen=True):
    """Slip alarms by knocks, taps and bumps that make no finger slide.

    Attributes:
        n: number of impacts of a finger: one that three fingers feel counts three times.
        false_alarms_per_impact: share of them with a slip alarm of that finger.
    """

    n: int
    false_alarms_per_impact: float


class SlipMetrics(msgspec.Struct, frozen=True, omit_defaults=True):
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
        quiet_minutes: quiet among it [min].
        held_minutes: of one finger, without creep, slips and the time of their alarms [min].
        onsets: `truth`, `labels`, `rule` (labels by a rule), or `mixed`.
        impacts: None if the truth has no impacts.
        unknown: share of held time of which the labels do not say whether it slides [%]; None if
            they say it of all.
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
    impacts: ImpactMetrics | None = None
    unknown: float | None = None


def slip_metrics(counts: SlipCounts) -> SlipMetrics:
    """Compute the metrics of slips from their counts."""
    quiet, held = counts.quiet_seconds / 60, counts.held_seconds / 60
    over = counts.is_over_1mm
    still, sliding = counts.scores
    pairs = float(still.sum()) * float(sliding.sum())
    below = np.cumsum(still) - still / 2

    def found(delays: Array) -> dict[str, float | None]:
        return {limit: percent(int(n), len(delays)) for limit, n in n_found(delays).items()}

    before_1mm, before_3mm = map(percent, counts.found_before.tolist(), counts.n_reached.tolist())
    return SlipMetrics(
        n=len(counts.delays),
        n_over_1mm=int(over.sum()),
        n_gross=len(counts.gross_delays),
        incipient=found(counts.delays),
        gross=found(counts.gross_delays),
        over_1mm=found(counts.delays[over]),
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
        onsets=common_onsets(counts.onsets),
        impacts=ImpactMetrics(counts.n_impacts, counts.false_impacts / counts.n_impacts)
        if counts.n_impacts
        else None,
        unknown=percent(counts.unknown_seconds, counts.known_seconds + counts.unknown_seconds)
        or None,
    )


def n_found(delays: Array) -> dict[str, Count]:
    """Return the numbers of slips found before the onset and within some times after it.

    Args:
        delays: (n_slips,) or (n_thresholds, n_slips) [s].
    """
    masks = {"before": delays < -TIME_TOLERANCE}
    masks |= {str(limit): delays <= limit + TIME_TOLERANCE for limit in FOUND_WITHIN}
    return {limit: mask.sum(axis=-1) for limit, mask in masks.items()}
