"""Slips of a finger: the truth by sample, and the score of decisions about them.

A finger slides where the load-weighted speed of its contact exceeds 1 mm/s, and is still below
0.3 mm/s. Between the two it creeps: such samples are neither right nor wrong.
"""

import math
from collections.abc import Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import NamedTuple, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    CONTACT_FORCE,
    HELD_PHASES,
    MIN_CONTACT_DURATION,
    SLIP_SPEED,
    TIME_TOLERANCE,
    Cause,
    ContactState,
)
from holdfast.metrics.binned import N_BINS, bins_of
from holdfast.metrics.events import MIN_GAP_DURATION, Onsets
from holdfast.metrics.masks import Mask, join_runs, runs
from holdfast.metrics.statistics import percent
from holdfast.recordings import Label, Recording, Truth
from holdfast.sensors.types import Array, Integers

Codes = npt.NDArray[np.int8]

NOT_HELD, STILL, CREEPING, SLIDING = range(-1, 3)
"""Codes of the truth of a slip at a sample."""

STILL_SPEED = 0.0003
"""Speed below which a held contact does not slide [m/s]."""
GROSS_SHARE = 0.9
"""Share of the load on sliding parts of the contact from which a slip is gross."""
MIN_SLIP_DURATION = 0.02
"""A slip lasts at least this time [s], or slides at least `MIN_SLIP_DISTANCE`."""
MIN_SLIP_DISTANCE = 1e-4
"""Sliding distance from which a shorter slip counts [m]."""
EARLIEST_ALARM = 0.5
"""An alarm that comes more than this time before the onset does not belong to the slip [s]."""
LATEST_ALARM = 0.25
"""Time after the end of a slip in which a raised decision is no false alarm [s]."""
FALSE_ALARM_DURATION = 0.5
"""Each begun part of this length of a decision that is wrongly raised is one false alarm [s]."""
FOUND_WITHIN = (0.03, 0.05, 0.1)
"""Times after the onset within which the slips are counted that are found [s]."""
DISTANCES = (0.001, 0.003)
"""Sliding distances before which the slips are counted that are found [m]."""

_OUT_OF_HOLD = {Cause.CLOSING, Cause.RELEASED, Cause.LOST}


class Slip(NamedTuple):
    """A slip of one finger over a held object.

    Attributes:
        onset: time of the first sliding sample: the incipient slip [s].
        end: time of the first sample after it [s].
        gross: time from which 90 % of the load slides [s]; NaN if that never happens, or if it
            is not known.
        distance: slid from the onset to the end [m]; NaN if it is not known.
        reached: times at which each of `DISTANCES` was slid [s]; NaN if it was not.
    """

    onset: float
    end: float
    gross: float = math.nan
    distance: float = math.nan
    reached: tuple[float, ...] = (math.nan,) * len(DISTANCES)


@dataclass(frozen=True, eq=False)
class SlipTruth:
    """Truth of the slips of one finger, at the samples of its decisions.

    Attributes:
        codes: (n,) NOT_HELD, STILL, CREEPING or SLIDING.
        quiet: (n,) True where the finger holds still and nothing disturbs the object.
        slips: in order of time.
        onsets: where the slips come from.
    """

    codes: Codes
    quiet: Mask
    slips: tuple[Slip, ...]
    onsets: Onsets


@dataclass(frozen=True, eq=False)
class SlipDecisions:
    """Decisions about the slips of one finger, sample by sample.

    Attributes:
        times: (n,) strictly increasing [s].
        probability: (n,) that the finger slides; NaN without an estimate.
        raised: (n,) True where the finger is decided to slide.
        truth: of the same samples; None if it is not known.
    """

    times: Array
    probability: Array
    raised: Mask
    truth: SlipTruth | None


def finger_slips(truth: Truth, finger: str) -> tuple[Slip, ...]:
    """Return the slips of one finger by the truth.

    Sliding that stops for less than 0.1 s is one slip. A slip lasts at least 20 ms, or slides at
    least 0.1 mm.

    Args:
        truth: with `phase` of the hand, and `contact_force`, `slip_speed` and, for gross slips,
            `slipping_share` of the finger.
        finger: name of the finger.
    """
    times, arrays = truth.times, truth.fingers[finger]
    sliding = _truth_codes(truth, finger) == SLIDING
    speed = np.where(sliding, arrays["slip_speed"], 0.0)
    share = arrays.get("slipping_share", np.full(len(times), np.nan))
    steps = sample_durations(times)
    period = float(np.median(steps)) if len(steps) else 0.0
    joined = join_runs(sliding, times, MIN_GAP_DURATION + period - TIME_TOLERANCE)
    slips = (_slip(times, steps, speed, share, int(a), int(b)) for a, b in runs(joined))
    return tuple(
        slip
        for slip in slips
        if slip.end - slip.onset >= MIN_SLIP_DURATION - TIME_TOLERANCE
        or slip.distance >= MIN_SLIP_DISTANCE
    )


def _slip(times: Array, steps: Array, speed: Array, share: Array, start: int, end: int) -> Slip:
    """Return the slip of the samples from `start` up to `end`."""
    slid = np.cumsum((speed * steps)[start:end])
    ends = times[start:end] + steps[start:end]
    gross = np.flatnonzero((share[start:end] >= GROSS_SHARE) & (speed[start:end] > 0))
    places = np.searchsorted(slid, DISTANCES)
    return Slip(
        float(times[start]),
        float(ends[-1]),
        float(times[start + gross[0]]) if len(gross) else math.nan,
        float(slid[-1]),
        tuple(float(ends[k]) if k < len(ends) else math.nan for k in places),
    )


def label_slips(labels: Sequence[Label]) -> tuple[Slip, ...]:
    """Return the slips that labels name by their cause; labels that touch are one slip."""
    slips: list[Slip] = []
    for label in labels:
        if label.cause is not Cause.SLIP:
            continue
        if slips and label.start - slips[-1].end < MIN_GAP_DURATION - TIME_TOLERANCE:
            slips[-1] = slips[-1]._replace(end=label.end)
        else:
            slips.append(Slip(label.start, label.end))
    return tuple(slips)


def slip_truth(
    recording: Recording, finger: str, times: Array, quiet: Mask | None = None
) -> SlipTruth | None:
    """Return the truth of the slips of a finger at some times.

    It is that of the recording; without it, labels are taken as they are: a label with the cause
    slip slides, another one of a held contact does not.

    Args:
        recording: with a truth or labels of the finger.
        finger: name of the finger.
        times: (n,) [s].
        quiet: (n,) where the contact is stable by the truth; by default, by the labels.

    Returns:
        The truth; None if the recording has neither.
    """
    module, truth = recording.modules[finger], recording.truth
    stable = module_states(module.labels, times) if quiet is None else quiet
    if truth is not None and has_slip_truth(truth, finger):
        place = np.clip(np.searchsorted(truth.times, times, side="right") - 1, 0, None)
        codes = _truth_codes(truth, finger)[place]
        return SlipTruth(codes, stable & (codes == STILL), finger_slips(truth, finger), "truth")
    if not module.labels:
        return None
    codes = _label_codes(module.labels, times)
    return SlipTruth(codes, stable & (codes == STILL), label_slips(module.labels), "labels")


def has_slip_truth(truth: Truth, finger: str) -> bool:
    """Return whether a truth has what the slips of a finger need."""
    arrays = truth.fingers.get(finger, {})
    return "phase" in truth.hand and {"contact_force", "slip_speed"} <= arrays.keys()


def sample_durations(times: Array) -> Array:
    """Return the time from each sample to the next, (n,) [s]; the median for the last."""
    if len(times) < 2:
        return np.zeros(len(times))
    steps = np.diff(times)
    return np.append(steps, np.median(steps))


def module_states(labels: Sequence[Label], times: Array) -> Mask:
    """Return (n,) True where a label is STABLE."""
    stable = np.zeros(len(times), dtype=bool)
    for label in labels:
        if label.state is ContactState.STABLE:
            stable[_places(label, times)] = True
    return stable


def _truth_codes(truth: Truth, finger: str) -> Codes:
    """Return (n,) the code of each sample of the truth."""
    arrays, times = truth.fingers[finger], truth.times
    force = np.linalg.norm(arrays["contact_force"], axis=1)
    touching = ~join_runs(
        ~join_runs(force > CONTACT_FORCE, times, MIN_CONTACT_DURATION), times, MIN_CONTACT_DURATION
    )
    speed = arrays["slip_speed"]
    codes = np.full(len(times), CREEPING, dtype=np.int8)
    codes[speed > SLIP_SPEED] = SLIDING
    codes[speed < STILL_SPEED] = STILL
    codes[~(touching & np.isin(truth.hand["phase"], HELD_PHASES))] = NOT_HELD
    return codes


def _label_codes(labels: Sequence[Label], times: Array) -> Codes:
    codes = np.full(len(times), NOT_HELD, dtype=np.int8)
    for label in labels:
        codes[_places(label, times)] = _label_code(label)
    return codes


def _label_code(label: Label) -> int:
    if label.state is ContactState.NO_CONTACT or label.cause in _OUT_OF_HOLD:
        return NOT_HELD
    if label.cause is Cause.SLIP:
        return SLIDING
    is_known = label.state is ContactState.STABLE or label.cause is not None
    return STILL if is_known else CREEPING


def _places(label: Label, times: Array) -> slice:
    first, last = np.searchsorted(times, (label.start - TIME_TOLERANCE, label.end - TIME_TOLERANCE))
    return slice(int(first), int(last))


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


class SlipSummary(msgspec.Struct, frozen=True):
    """Metrics of the slips of each finger, and of all fingers together."""

    fingers: dict[str, SlipMetrics]
    pooled: SlipMetrics


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
