"""The threshold at which a method has a given rate of false alarms under a stable label.

A sample that could raise a false alarm raises one if the hand was stable at the sample before and
is not stable any more. This is so for the thresholds above its own margin, up to the margin of
the sample before. So the false alarms at all thresholds are counted at once.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from holdfast.contact import STABLE, TIME_TOLERANCE
from holdfast.metrics import match_alarms
from holdfast.metrics.decisions import Codes
from holdfast.metrics.events import EARLY_TOLERANCE, LATE_TOLERANCE
from holdfast.metrics.masks import Mask
from holdfast.metrics.slip_truth import sample_durations
from holdfast.sensors.types import Array
from holdfast_lab.study.evaluation.scores import HandScores


class FalseAlarmRanges(NamedTuple):
    """The ranges of the threshold at which samples of one recording raise false alarms.

    Attributes:
        lower: (m,) the threshold above which the hand is not stable at the sample; minus
            infinity if the object is not held, infinity if the state is not known.
        upper: (m,) the threshold up to which the hand was stable at the sample before.
        minutes: duration of the stable label [min].
    """

    lower: Array
    upper: Array
    minutes: float

    @classmethod
    def of(cls, scores: HandScores, labels: Codes, ignored: Mask | None = None) -> Self:
        """Return the ranges of the false alarms under a stable label.

        Args:
            scores: of the hand.
            labels: (n,) label codes of the hand.
            ignored: (n,) samples at which neither an alarm nor the time is counted.
        """
        match = match_alarms(scores.times, labels, labels)
        counted = labels == STABLE
        for event in match.events:
            counted &= (scores.times < event.onset - EARLY_TOLERANCE - TIME_TOLERANCE) | (
                scores.times > event.end + LATE_TOLERANCE + TIME_TOLERANCE
            )
        seconds = match.stable_seconds
        if ignored is not None:
            counted &= ~ignored
            seconds -= float(sample_durations(scores.times)[(labels == STABLE) & ignored].sum())
        lost = scores.known & ~scores.held
        after = np.where(lost, -np.inf, scores.margin)
        before = np.where(scores.known & scores.held, scores.margin, -np.inf)
        rows = np.flatnonzero(counted[1:] & (before[:-1] > after[1:]))
        return cls(after[rows + 1], before[rows], seconds / 60)


def threshold_shift(ranges: Sequence[FalseAlarmRanges], per_minute: float) -> float:
    """Return the highest shift of the threshold with at most this rate of false alarms.

    The rate is not exceeded at any smaller shift either. The search ends at the shift with the
    most false alarms. Above it a hand is so rarely stable that it has few alarms to raise.

    Args:
        ranges: of the recordings that the threshold is chosen on.
        per_minute: false alarms per minute of stable label [1/min].

    Returns:
        The shift [log odds]; minus infinity if the alarms by loss of contact alone are too many,
        0 if there is no false alarm at any threshold.
    """
    upper = np.sort(np.concatenate([interval.upper for interval in ranges]))
    lower = np.sort(np.concatenate([interval.lower for interval in ranges]))
    edges = np.unique(np.concatenate([upper, lower]))
    if not len(edges):
        return 0.0
    n_alarms = np.searchsorted(lower, edges, "right") - np.searchsorted(upper, edges, "right")
    too_many = n_alarms > per_minute * sum(interval.minutes for interval in ranges)
    last = int(np.argmax(too_many)) if too_many.any() else int(np.argmax(n_alarms)) + 1
    return float(edges[last])
