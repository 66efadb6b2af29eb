"""Truth of the slips of a finger, sample by sample, and the decisions about them.

A finger slides where the load-weighted speed of its contact exceeds 1 mm/s, and is still below
0.3 mm/s. Between the two it creeps: such samples are neither right nor wrong.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

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
from holdfast.metrics.masks import Mask, join_runs, runs, without_short_runs
from holdfast.metrics.truth_labels import Onsets, labels_by_rule
from holdfast.recordings import Label, Recording, Truth
from holdfast.sensors.types import Array

Codes = npt.NDArray[np.int8]

NOT_HELD, STILL, CREEPING, SLIDING = range(-1, 3)
"""Codes of the truth of a slip at a sample. By labels, CREEPING is held time without a label, or
unstable without a cause."""

STILL_SPEED = 0.0003
"""Speed below which a held contact does not slide [m/s]."""
GROSS_SHARE = 0.9
"""Share of the load on sliding parts of the contact from which a slip is gross."""
MIN_STILL_DURATION = 0.1
"""Sliding that stops for less than this time is one slip [s]."""
MIN_SLIP_DURATION = 0.02
"""A slip lasts at least this time [s], or slides at least `MIN_SLIP_DISTANCE`."""
ROUNDING = 1e-9
"""Share of a distance by which a sum of steps may fall short of it."""
MIN_SLIP_DISTANCE = 1e-4
"""Sliding distance from which a shorter slip counts [m]."""
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
        impacts: begin and end of each impact on object or arm [s], if the truth has them.
    """

    codes: Codes
    quiet: Mask
    slips: tuple[Slip, ...]
    onsets: Onsets
    impacts: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class SlipDecisions:
    """Decisions about the slips of one finger, sample by sample.

    Attributes:
        times: (n,) strictly increasing [s].
        probability: (n,) that the finger slides; NaN without an estimate.
        raised: (n,) True where the finger is decided to slide.
        hold: time for which the rule still reports a slip [s].
        truth: of the same samples; None if it is not known.
    """

    times: Array
    probability: Array
    raised: Mask
    hold: float
    truth: SlipTruth | None

    def raised_at(self, thresholds: Array) -> Mask:
        """Return where a slip is reported at each threshold, by the rule of the detector.

        Args:
            thresholds: (n_thresholds,) of the probability; NaN and 0 end a slip at once.

        Returns:
            (n_thresholds, n).
        """
        times, probability, limits = self.times, self.probability, np.asarray(thresholds)[:, None]
        # The rule of `kernel/heads.c` for many thresholds at once: raised where the probability is
        # over the threshold, and for `hold` after it, unless a gap or a fault (NaN), or a finger
        # without contact (0), came between. Half a period allows for rounding of times.
        with np.errstate(invalid="ignore"):
            ended = ~(probability > 0)
            over = (probability >= limits) & (limits < 1)  # 1 is never reached
        end = np.maximum.accumulate(np.where(ended, times, -np.inf))
        last = np.maximum.accumulate(np.where(over, times, -np.inf), axis=1)
        period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        lasting = (times - last + 0.5 * period < self.hold) & (last > end)
        return np.asarray((over | lasting) & ~ended)


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
    # `join_runs` measures from the last sample of a run to the first of the next, a period more
    # than the pause lasts.
    joined = join_runs(sliding, times, MIN_STILL_DURATION + period - TIME_TOLERANCE)
    slips = []
    for start, end in runs(joined).tolist():
        slid = np.cumsum((speed * steps)[start:end])
        ends = times[start:end] + steps[start:end]
        # In a pause within a slip the share says nothing: nothing slides.
        gross = np.flatnonzero((share[start:end] >= GROSS_SHARE) & (speed[start:end] > 0))
        indices = np.searchsorted(slid, np.array(DISTANCES) * (1 - ROUNDING))
        slip = Slip(
            float(times[start]),
            float(ends[-1]),
            float(times[start + gross[0]]) if len(gross) else math.nan,
            float(slid[-1]),
            tuple(float(ends[k]) if k < len(ends) else math.nan for k in indices),
        )
        is_long = slip.end - slip.onset >= MIN_SLIP_DURATION - TIME_TOLERANCE
        if is_long or slip.distance >= MIN_SLIP_DISTANCE:
            slips.append(slip)
    return tuple(slips)


def truth_impacts(truth: Truth) -> tuple[tuple[float, float], ...]:
    """Return begin and end of each impact [s]: where `impact` of the hand names its kind."""
    kinds = truth.hand.get("impact")
    if kinds is None:
        return ()
    periods = runs(np.asarray(kinds != ""))
    return tuple((float(truth.times[a]), float(truth.times[b - 1])) for a, b in periods)


def label_slips(labels: Sequence[Label]) -> tuple[Slip, ...]:
    """Return the slips that labels name by their cause; labels that touch are one slip."""
    slips: list[Slip] = []
    for label in labels:
        if label.cause is not Cause.SLIP:
            continue
        if slips and label.start - slips[-1].end < MIN_STILL_DURATION - TIME_TOLERANCE:
            slips[-1] = slips[-1]._replace(end=label.end)
        else:
            slips.append(Slip(label.start, label.end))
    return tuple(slips)


def slip_truth(
    recording: Recording, finger: str, times: Array, quiet: Mask | None = None
) -> SlipTruth | None:
    """Return the truth of the slips of a finger at some times.

    It is that of the recording; without it, labels name three kinds of held time. A label with the
    cause slip slides. One that is stable, or unstable for another cause, is still. What is unstable
    without a cause, or has no label between two labels of held contact, is unknown: CREEPING.

    Args:
        recording: with a truth or labels of the finger.
        finger: name of the finger.
        times: (n,) [s].
        quiet: (n,) where the contact is stable by the truth; by default, by the labels.

    Returns:
        The truth; None if the recording has neither.
    """
    labels, truth = recording.modules[finger].labels, recording.truth
    stable = np.zeros(len(times), dtype=bool) if quiet is None else quiet
    codes, unlabelled = (
        np.full(len(times), NOT_HELD, dtype=np.int8),
        np.ones(len(times), dtype=bool),
    )
    for label in labels:
        start, end = label.start - TIME_TOLERANCE, label.end - TIME_TOLERANCE
        rows = slice(*np.searchsorted(times, (start, end)).tolist())
        is_stable = label.state is ContactState.STABLE
        if quiet is None and is_stable:
            stable[rows] = True
        if label.state is ContactState.NO_CONTACT or label.cause in _OUT_OF_HOLD:
            codes[rows] = NOT_HELD
        elif label.cause is Cause.SLIP:
            codes[rows] = SLIDING
        else:
            codes[rows] = STILL if is_stable or label.cause is not None else CREEPING
        unlabelled[rows] = False
    for first, last in runs(unlabelled).tolist():
        if first > 0 and last < len(times) and NOT_HELD not in codes[[first - 1, last]]:
            codes[first:last] = CREEPING
    if truth is not None and has_slip_truth(truth, finger):
        index = np.clip(np.searchsorted(truth.times, times, side="right") - 1, 0, None)
        codes = _truth_codes(truth, finger)[index]  # they outrank the labels
        slips = finger_slips(truth, finger)
        return SlipTruth(codes, stable & (codes == STILL), slips, "truth", truth_impacts(truth))
    if not labels:
        return None
    onsets: Onsets = "rule" if labels_by_rule(labels) else "labels"
    return SlipTruth(codes, stable & (codes == STILL), label_slips(labels), onsets)


def truth_without(times: Array, truth: SlipTruth, left_out: Mask) -> SlipTruth:
    """Return the truth without some samples, and without the slips that begin in them."""
    if not left_out.any():
        return truth
    onsets = np.searchsorted(times, [slip.onset for slip in truth.slips]).clip(max=len(times) - 1)
    return replace(
        truth,
        codes=np.where(left_out, NOT_HELD, truth.codes).astype(np.int8),
        quiet=truth.quiet & ~left_out,
        slips=tuple(slip for slip, k in zip(truth.slips, onsets, strict=True) if not left_out[k]),
    )


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


def _truth_codes(truth: Truth, finger: str) -> Codes:
    """Return (n,) the code of each sample of the truth."""
    arrays, times = truth.fingers[finger], truth.times
    force = np.linalg.norm(arrays["contact_force"], axis=1)
    touching = without_short_runs(force > CONTACT_FORCE, times, MIN_CONTACT_DURATION)
    speed = arrays["slip_speed"]
    codes = np.full(len(times), CREEPING, dtype=np.int8)
    codes[speed > SLIP_SPEED] = SLIDING
    codes[speed < STILL_SPEED] = STILL
    codes[~(touching & np.isin(truth.hand["phase"], HELD_PHASES))] = NOT_HELD
    return codes
