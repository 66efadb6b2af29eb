"""Alarms of a hand: which are false, which are of a glitch, and at which threshold they are few."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import msgspec
import numpy as np

from holdfast.contact import NO_CONTACT, TIME_TOLERANCE, UNSTABLE
from holdfast.metrics.alarms import outside
from holdfast.metrics.events import EARLY_TOLERANCE, alarm_windows
from holdfast.sensors.types import Array
from holdfast_lab.study.evaluation.alarm_labels import AlarmLabels
from holdfast_lab.study.evaluation.fitted_method import Scores


class AlarmStatistics(msgspec.Struct, frozen=True):
    """Statistics of the alarms of a hand in one or more recordings, at one threshold.

    Attributes:
        delays: alarm minus onset of each event [s]; infinite for a missed event.
        n_events_not_stable: events at whose onset the hand was already not called stable.
        n_false_alarms: alarms that belong to no event.
        n_under_stable: false alarms under a stable label.
        n_of_glitch: of those, alarms that belong to a glitch of the hand's controller.
        stable_seconds: duration of the stable label [s].
    """

    delays: list[float]
    n_events_not_stable: int
    n_false_alarms: int
    n_under_stable: int
    n_of_glitch: int
    stable_seconds: float

    @classmethod
    def of(cls, scores: Scores, labels: AlarmLabels, shift: float = 0.0) -> Self:
        """Return the statistics of a hand, or a finger, in one recording.

        Args:
            scores: of the same samples as the labels.
            labels: in which events and false alarms are found.
            shift: of the threshold [log odds].
        """
        times, states = scores.times, scores.states(shift)
        match = labels.events.match(states)
        at = np.searchsorted(times, [alarm.time for alarm in match.false_alarms])
        at = at[~labels.left_out[at]]
        is_stable = labels.stable[at]
        # The state just before the first time at which an alarm belongs to the onset.
        onsets = np.array([event.onset for event in match.events])
        before = np.searchsorted(times, onsets - EARLY_TOLERANCE - TIME_TOLERANCE) - 1
        return cls(
            delays=[event.delay for event in match.events],
            n_events_not_stable=int(
                np.isin(states[before[before >= 0]], (UNSTABLE, NO_CONTACT)).sum()
            ),
            n_false_alarms=len(at),
            n_under_stable=int(is_stable.sum()),
            n_of_glitch=int((is_stable & labels.glitch[at]).sum()),
            stable_seconds=labels.counted_seconds,
        )

    def n_missed(self, post: float) -> int:
        """Return the number of events without an alarm until onset + post [s]."""
        return sum(delay > post + TIME_TOLERANCE for delay in self.delays)


class FalseAlarmRanges(NamedTuple):
    """The ranges of the threshold at which samples of one recording raise false alarms.

    A sample raises an alarm if the hand was stable at the sample before and is not stable any
    more. This is so for the thresholds above its own margin, up to the margin of the sample
    before. So the false alarms at all thresholds are counted at once.

    Attributes:
        lower: (m,) the threshold above which the hand is not stable at the sample; minus
            infinity if the object is not grasped, infinity if the state is not known.
        upper: (m,) the threshold up to which the hand was stable at the sample before.
        minutes: duration of the stable label [min].
    """

    lower: Array
    upper: Array
    minutes: float

    @classmethod
    def of(cls, scores: Scores, labels: AlarmLabels) -> Self:
        """Return the ranges of the false alarms under a stable label.

        Args:
            scores: held as long as those at which the chosen threshold is used.
            labels: of the same samples.
        """
        # An alarm near an event belongs to the event, whatever the threshold.
        near = ~outside(scores.times, alarm_windows(labels.events.events))
        counted = labels.stable & ~labels.left_out & ~near
        after = np.where(scores.known & ~scores.grasped, -np.inf, scores.margin)
        before = np.where(scores.known & scores.grasped, scores.margin, -np.inf)
        rows = np.flatnonzero(counted[1:] & (before[:-1] > after[1:]))
        return cls(after[rows + 1], before[rows], labels.counted_seconds / 60)


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
    lower = np.sort(np.concatenate([interval.lower for interval in ranges]))
    upper = np.sort(np.concatenate([interval.upper for interval in ranges]))
    edges = np.unique(np.concatenate([upper, lower]))
    if not len(edges):
        return 0.0
    # Just above an edge, a range that begins there is open, and one that ends there is over.
    n_alarms = np.searchsorted(lower, edges, "right") - np.searchsorted(upper, edges, "right")
    too_many = n_alarms > per_minute * sum(interval.minutes for interval in ranges)
    # The first edge with too many; else the edge above that with the most.
    last = int(np.argmax(too_many)) if too_many.any() else int(np.argmax(n_alarms)) + 1
    return float(edges[last])
