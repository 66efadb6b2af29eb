"""Where a method's threshold has to be for so many false alarms per minute of undisturbed hold.

A sample that could raise a false alarm raises one where the hand was stable at the sample before
and is not any more: for just the thresholds above its own score, up to that of the sample
before. So the false alarms at all thresholds are counted at once.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from holdfast.contact import STABLE
from holdfast.metrics import match_alarms
from holdfast.metrics.decisions import Codes
from holdfast.metrics.events import EARLY, LATE, ROUNDING
from holdfast.sensors.types import Array
from holdfast.study.evaluation.scores import HandScores, Mask


class FalseAlarmRanges(NamedTuple):
    """What tells the false alarms of one recording at any threshold.

    Attributes:
        before: (m,) up to which threshold the hand was stable at the sample before.
        after: (m,) above which it is not stable at the sample; minus infinity where it holds
            nothing, infinity where that is not known.
        minutes: of stable label [min].
    """

    before: Array
    after: Array
    minutes: float

    @classmethod
    def of(cls, score: HandScores, labels: Codes, spared: Mask | None = None) -> Self:
        """The false alarms under a stable label, of a hand.

        Args:
            score: of the hand.
            labels: (n,) its codes.
            spared: (n,) where an alarm is not counted.
        """
        found = match_alarms(score.times, labels, labels)
        calm = labels == STABLE
        for event in found.events:
            calm &= (score.times < event.onset - EARLY - ROUNDING) | (
                score.times > event.end + LATE + ROUNDING
            )
        if spared is not None:
            calm &= ~spared
        nothing = score.known & score.alone
        after = np.where(nothing, -np.inf, score.least)
        before = np.where(score.known & ~score.alone, score.least, -np.inf)
        rows = np.flatnonzero(calm[1:] & (before[:-1] > after[1:]))
        return cls(before[rows], after[rows + 1], found.stable_seconds / 60)


def threshold_shift(calms: Sequence[FalseAlarmRanges], per_minute: float) -> float:
    """The most watchful threshold up to which there are never more false alarms than that.

    It goes no further than to the threshold with the most of them: beyond, a hand is hardly
    ever stable, and has no alarm to give.

    Args:
        calms: of the recordings that the threshold is chosen on.
        per_minute: false alarms under a stable label, per minute of it.

    Returns:
        How far the threshold is moved [log odds]; minus infinity where alarms by loss of
        contact alone are too many, 0 where no threshold gives any.
    """
    before = np.sort(np.concatenate([each.before for each in calms]))
    after = np.sort(np.concatenate([each.after for each in calms]))
    edges = np.unique(np.concatenate([before, after]))
    if not len(edges):
        return 0.0
    n_alarms = np.searchsorted(after, edges, "right") - np.searchsorted(before, edges, "right")
    too_many = n_alarms > per_minute * sum(each.minutes for each in calms)
    last = int(np.argmax(too_many)) if too_many.any() else int(np.argmax(n_alarms)) + 1
    return float(edges[last])
