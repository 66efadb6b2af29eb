"""Statistics of the alarms of a hand in one recording: events and false alarms."""

from collections.abc import Sequence

import msgspec
import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, TIME_TOLERANCE, UNKNOWN, UNSTABLE
from holdfast.metrics import FingerDecisions, match_alarms
from holdfast.metrics.events import EARLY_TOLERANCE, LATE_TOLERANCE
from holdfast.metrics.masks import Mask, runs
from holdfast.metrics.slip_truth import sample_durations
from holdfast.sensors.types import Array


class AlarmStatistics(msgspec.Struct, frozen=True):
    """Statistics of the alarms of a hand in one recording, at one threshold.

    Attributes:
        delays: alarm minus onset of each event [s]; infinite for a missed event.
        n_events_not_stable: events at whose onset the hand was already not called stable.
        n_false_alarms: alarms that belong to no event.
        n_under_stable: false alarms under a stable label.
        n_of_glitch: of those, alarms that belong to a glitch of the hand's controller.
        stable_seconds: duration of the stable label [s].
        n_stable: samples labelled stable that have a decision.
        n_not_called_stable: of those, samples that are not called stable.
    """

    delays: list[float]
    n_events_not_stable: int
    n_false_alarms: int
    n_under_stable: int
    n_of_glitch: int
    stable_seconds: float
    n_stable: int
    n_not_called_stable: int

    def n_missed(self, post: float) -> int:
        """Return the number of events without an alarm until onset + post [s]."""
        return sum(delay > post + TIME_TOLERANCE for delay in self.delays)


def alarm_statistics(
    hand: FingerDecisions,
    glitch: Mask | None = None,
    *,
    without_glitches: bool = False,
) -> AlarmStatistics:
    """Return the statistics of the alarms of a hand.

    An alarm belongs to a glitch by the rule for events: it comes from 0.02 s before the onset to
    0.25 s after the end.

    Args:
        hand: labels and decisions.
        glitch: (n,) samples at which a glitch acts; by default none.
        without_glitches: leave out the false alarms of glitches, and the stable label in which they
            would count.
    """
    match = match_alarms(hand.times, hand.labels, hand.states)
    near = near_glitch(hand.times, glitch)
    stable = hand.labels == STABLE
    alarms = list(match.false_alarms)
    of_glitch = _at(near, hand.times, np.array([alarm.time for alarm in alarms]))
    stable_seconds = match.stable_seconds
    if without_glitches:
        alarms = [alarm for alarm, left_out in zip(alarms, of_glitch, strict=True) if not left_out]
        of_glitch = np.zeros(len(alarms), dtype=np.bool_)
        stable_seconds -= float(sample_durations(hand.times)[stable & near].sum())
        stable = stable & ~near
    under_stable = np.array([alarm.label.code == STABLE for alarm in alarms], dtype=np.bool_)
    decided = stable & (hand.states != UNKNOWN)
    return AlarmStatistics(
        delays=[event.delay for event in match.events],
        n_events_not_stable=_n_not_stable(hand, [event.onset for event in match.events]),
        n_false_alarms=len(alarms),
        n_under_stable=int(under_stable.sum()),
        n_of_glitch=int((under_stable & of_glitch).sum()),
        stable_seconds=stable_seconds,
        n_stable=int(decided.sum()),
        n_not_called_stable=int((decided & (hand.states != STABLE)).sum()),
    )


def near_glitch(times: Array, glitch: Mask | None) -> Mask:
    """Return the (n,) samples at which an alarm belongs to a glitch: up to 0.25 s after it."""
    near = np.zeros(len(times), dtype=np.bool_)
    if glitch is None or not len(times):
        return near
    ends = times + sample_durations(times)
    for start, end in runs(glitch):
        first = np.searchsorted(times, times[start] - EARLY_TOLERANCE - TIME_TOLERANCE)
        last = np.searchsorted(times, ends[end - 1] + LATE_TOLERANCE + TIME_TOLERANCE, side="right")
        near[first:last] = True
    return near


def _at(mask: Mask, times: Array, instants: Array) -> Mask:
    """Return the value of a mask over `times` at some of these times."""
    return mask[np.searchsorted(times, instants)] if len(instants) else np.zeros(0, dtype=np.bool_)


def _n_not_stable(hand: FingerDecisions, onsets: Sequence[float]) -> int:
    """Return at how many onsets the hand is already UNSTABLE or NO_CONTACT.

    The state counts that the hand has just before the first time at which an alarm belongs to
    the onset.
    """
    first = np.asarray(onsets, dtype=np.float64) - EARLY_TOLERANCE - TIME_TOLERANCE
    places = np.searchsorted(hand.times, first) - 1
    states = hand.states[places[places >= 0]]
    return int(np.isin(states, (UNSTABLE, NO_CONTACT)).sum())
