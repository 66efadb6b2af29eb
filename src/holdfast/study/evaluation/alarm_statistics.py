"""Statistics of the alarms of a hand in one recording: events, slips and false alarms."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.contact import CONTACT_FORCE, HELD_PHASES, SLIP_SPEED, STABLE, UNKNOWN
from holdfast.metrics import FingerDecisions, match_alarms
from holdfast.metrics.events import MIN_STABLE_DURATION, POST_DURATIONS, TIME_TOLERANCE
from holdfast.metrics.masks import Mask, runs
from holdfast.recordings import Truth
from holdfast.sensors.types import Array

JUMP_EFFECT_TIME = 0.1
"""Time after a jump of the controller's set point in which the jump explains an alarm [s]."""

SET_POINT_ERROR = "set_point_error"
"""Name of the error of the controller's set point in the truth of a hand [rad]."""


class SlipInterval(NamedTuple):
    """Times of the first and the last sample at which a held object slides [s]."""

    onset: float
    end: float


class AlarmStatistics(msgspec.Struct, frozen=True):
    """Statistics of the alarms of a hand in one recording, at one threshold.

    Attributes:
        delays: alarm minus onset of each event [s]; infinite for a missed event.
        slip_delays: time from the onset of each slip until the hand is not called stable [s];
            infinite if it is called stable until the sliding ends.
        n_false_alarms: alarms that belong to no event.
        n_under_stable: false alarms under a stable label.
        n_after_jump: of those, alarms right after a jump of the controller's set point.
        stable_seconds: duration of the stable label [s].
        n_stable: samples labelled stable that have a decision.
        n_not_called_stable: of those, samples that are not called stable.
    """

    delays: list[float]
    slip_delays: list[float]
    n_false_alarms: int
    n_under_stable: int
    n_after_jump: int
    stable_seconds: float
    n_stable: int
    n_not_called_stable: int

    def n_missed(self, post: float) -> int:
        """Return the number of events without an alarm until onset + post [s]."""
        return sum(delay > post + TIME_TOLERANCE for delay in self.delays)

    def n_slips_found(self, within: float) -> int:
        """Return the number of slips that are found within a time [s]."""
        return sum(delay <= within + TIME_TOLERANCE for delay in self.slip_delays)


def alarm_statistics(
    hand: FingerDecisions, truth: Truth | None, slips: Sequence[SlipInterval]
) -> AlarmStatistics:
    """Return the statistics of the alarms of a hand.

    Args:
        hand: labels and decisions.
        truth: of the recording.
        slips: in the recording, see `find_slips`.
    """
    match = match_alarms(hand.times, hand.labels, hand.states)
    under_stable = [alarm for alarm in match.false_alarms if alarm.label.code == STABLE]
    after_jump = is_after_jump(np.array([alarm.time for alarm in under_stable]), truth)
    stable = (hand.labels == STABLE) & (hand.states != UNKNOWN)
    return AlarmStatistics(
        delays=[event.delay for event in match.events],
        slip_delays=[_slip_delay(slip, hand) for slip in slips],
        n_false_alarms=len(match.false_alarms),
        n_under_stable=len(under_stable),
        n_after_jump=int(after_jump.sum()),
        stable_seconds=match.stable_seconds,
        n_stable=int(stable.sum()),
        n_not_called_stable=int((stable & (hand.states != STABLE)).sum()),
    )


def find_slips(truth: Truth | None) -> list[SlipInterval]:
    """Return the slips of a recording; none if the truth is not known.

    A slip begins when the object starts to slide on a finger. Before that, the hand has held the
    object without sliding for half a second.
    """
    if truth is None or "phase" not in truth.hand:
        return []
    times, slips, last_sliding = truth.times, [], -np.inf
    for start, end in runs(_sliding(truth)):
        rest_begin = max(last_sliding, _hold_begin(truth, start))
        if times[start] - rest_begin >= MIN_STABLE_DURATION - TIME_TOLERANCE:
            slips.append(SlipInterval(float(times[start]), float(times[end - 1])))
        last_sliding = float(times[end - 1])
    return slips


def _sliding(truth: Truth) -> Mask:
    """Return whether the object slides on a finger of a hand that holds it, (n,)."""
    found = np.zeros(len(truth.times), dtype=np.bool_)
    for finger in truth.fingers.values():
        if {"contact_force", "slip_speed"} <= set(finger):
            touching = np.linalg.norm(finger["contact_force"], axis=1) > CONTACT_FORCE
            found |= touching & (finger["slip_speed"] > SLIP_SPEED)
    return np.asarray(np.isin(truth.hand["phase"], HELD_PHASES) & found)


def _hold_begin(truth: Truth, place: int) -> float:
    """Return the time of the last sample before `place` at which nothing is held [s]."""
    free = np.flatnonzero(~np.isin(truth.hand["phase"][: place + 1], HELD_PHASES))
    return float(truth.times[free[-1]]) if len(free) else float(truth.times[0])


def _slip_delay(slip: SlipInterval, hand: FingerDecisions) -> float:
    """Return the time until the hand is not called stable [s]; infinite if it stays stable.

    The search ends with the slip, but not before the last of `POST_DURATIONS`.
    """
    last = max(slip.end, slip.onset + POST_DURATIONS[-1]) + TIME_TOLERANCE
    rows = slice(*np.searchsorted(hand.times, (slip.onset - TIME_TOLERANCE, last)))
    found = (hand.states[rows] != STABLE) & (hand.states[rows] != UNKNOWN)
    if not found.any():
        return math.inf
    return max(float(hand.times[rows][np.argmax(found)]) - slip.onset, 0.0)


def is_after_jump(times: Array, truth: Truth | None) -> Mask:
    """Return whether the set point of the controller has just jumped, (n,).

    False at all times if the truth does not contain the set point.
    """
    if truth is None or SET_POINT_ERROR not in truth.hand:
        return np.zeros(len(times), dtype=np.bool_)
    jumps: Array = truth.times[np.abs(truth.hand[SET_POINT_ERROR]) > 0]
    first = np.searchsorted(jumps, times - JUMP_EFFECT_TIME - TIME_TOLERANCE)
    last = np.searchsorted(jumps, times + TIME_TOLERANCE)
    return np.asarray(last > first)
