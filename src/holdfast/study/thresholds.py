"""Where a method's threshold has to be for so many false alarms per minute of undisturbed hold.

With the margin of a sample its log odds over the method's own threshold, the score of a hand is
the least margin of the fingers in contact: for a threshold moved by t the hand is stable where
the score is at least t. So every sample that can raise a false alarm raises one for just the t
between two scores, and all thresholds are counted at once.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from holdfast.contact import STABLE
from holdfast.metrics import match_alarms
from holdfast.metrics.decisions import Codes
from holdfast.metrics.events import EARLY, LATE
from holdfast.sensors.values import Array

SHIFTS = np.arange(-28.0, 12.0, 0.05)
"""Thresholds that are tried, in log odds from the method's own."""


class Calm(NamedTuple):
    """What tells the false alarms of one recording at any threshold.

    Attributes:
        before: (m,) scores of the samples before those at which an alarm would be false.
        after: (m,) scores of those samples.
        minutes: of stable label [min].
    """

    before: Array
    after: Array
    minutes: float

    @classmethod
    def of(cls, times: Array, labels: Codes, scores: Array) -> Self:
        """The false alarms in undisturbed hold of a hand, by its exact labels.

        Args:
            times: (n,) [s].
            labels: (n,) codes of the hand.
            scores: (n,) NaN where nothing is known, -inf without contact.
        """
        found = match_alarms(times, labels, labels)
        calm = labels == STABLE
        for event in found.events:
            calm &= (times < event.onset - EARLY) | (times > event.end + LATE)
        known = calm[1:] & ~np.isnan(scores[1:]) & ~np.isnan(scores[:-1])
        return cls(scores[:-1][known], scores[1:][known], found.stable_seconds / 60)


def false_alarm_rates(calms: Sequence[Calm]) -> Array:
    """False alarms under a stable label, per minute of it, at each of `SHIFTS`."""
    before = np.sort(np.concatenate([each.before for each in calms]))
    both = np.sort(np.concatenate([np.minimum(each.before, each.after) for each in calms]))
    n_alarms = np.searchsorted(both, SHIFTS) - np.searchsorted(before, SHIFTS)
    return np.asarray(n_alarms / max(sum(each.minutes for each in calms), 1e-9))


def shift_for(calms: Sequence[Calm], per_minute: float) -> float:
    """The most watchful threshold up to which there are never more false alarms than that.

    Args:
        calms: of the recordings that the threshold is chosen on.
        per_minute: false alarms per minute of stable label.

    Returns:
        How far the threshold is moved [log odds].
    """
    too_many = np.flatnonzero(false_alarm_rates(calms) > per_minute)
    last = int(too_many[0]) - 1 if len(too_many) else len(SHIFTS) - 1
    return float(SHIFTS[max(last, 0)])
