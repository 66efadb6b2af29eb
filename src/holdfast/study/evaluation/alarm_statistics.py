"""What the alarms of a hand are worth in one recording: events, slips and false alarms."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import HELD_PHASES, STABLE, UNKNOWN
from holdfast.metrics import FingerDecisions, match_alarms
from holdfast.metrics.events import POSTS, ROUNDING, STABLE_BEFORE
from holdfast.metrics.masks import runs
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast.twin.labels import LabelRule

Mask = npt.NDArray[np.bool_]

AFTER_GLITCH = 0.1
"""A false alarm within this [s] after the controller's set point jumped is due to that."""

SET_POINT = "set_point_error"
"""Of the truth of a hand: how far the controller's set point is off [rad]."""


class SlipInterval(NamedTuple):
    """An object slides on a fingertip of a hand that holds it: first and last sample [s]."""

    onset: float
    end: float


class AlarmStatistics(msgspec.Struct, frozen=True):
    """What the alarms of a hand are worth in one recording, at one threshold.

    Attributes:
        delays: of each event, alarm minus onset [s]; infinite where it was missed.
        slips: of each slip, how long until the hand was not called stable [s]; infinite where
            it was until the sliding ended.
        false_alarms: alarms that belong to no event.
        under_stable: of them, those under a stable label.
        follows_jump: of those, those right after a jump of the controller's set point.
        stable_seconds: how long the label is stable [s].
        n_stable: samples labelled stable and decided.
        n_doubted: of them, those that were not called stable.
    """

    delays: list[float]
    slips: list[float]
    false_alarms: int
    under_stable: int
    follows_jump: int
    stable_seconds: float
    n_stable: int
    n_doubted: int

    def n_missed(self, post: float) -> int:
        """Events without an alarm until onset + post."""
        return sum(delay > post + ROUNDING for delay in self.delays)

    def n_found(self, within: float) -> int:
        """Slips that were told within that time [s]."""
        return sum(latency <= within + ROUNDING for latency in self.slips)


def alarm_statistics(
    hand: FingerDecisions, truth: Truth | None, slips: Sequence[SlipInterval]
) -> AlarmStatistics:
    """What the alarms of a hand are worth.

    Args:
        hand: labels and decisions.
        truth: of the recording.
        slips: of sliding, that `find_slips` finds in it.
    """
    match = match_alarms(hand.times, hand.labels, hand.states)
    false = [alarm for alarm in match.false_alarms if alarm.label.code == STABLE]
    stable = (hand.labels == STABLE) & (hand.states != UNKNOWN)
    return AlarmStatistics(
        delays=[event.delay for event in match.events],
        slips=[_latency(slip, hand) for slip in slips],
        false_alarms=len(match.false_alarms),
        under_stable=len(false),
        follows_jump=int(follows_jump(np.array([alarm.time for alarm in false]), truth).sum()),
        stable_seconds=match.stable_seconds,
        n_stable=int(stable.sum()),
        n_doubted=int((stable & (hand.states != STABLE)).sum()),
    )


def find_slips(truth: Truth | None) -> list[SlipInterval]:
    """The slips of a recording; none where the truth is not known.

    A slip begins where the object starts to slide on a finger of a hand that has held it, and
    on which it has rested, for half a second.
    """
    if truth is None or "phase" not in truth.hand:
        return []
    times, slips, rested = truth.times, [], -np.inf
    for start, end in runs(_sliding(truth)):
        since = max(rested, _held_since(truth, start))
        if times[start] - since >= STABLE_BEFORE - ROUNDING:
            slips.append(SlipInterval(float(times[start]), float(times[end - 1])))
        rested = float(times[end - 1])
    return slips


def _sliding(truth: Truth) -> Mask:
    """Whether the object slides on a finger of a hand that holds it."""
    rule = LabelRule()
    found = np.zeros(len(truth.times), dtype=np.bool_)
    for finger in truth.fingers.values():
        if {"contact_force", "slip_speed"} <= set(finger):
            touching = np.linalg.norm(finger["contact_force"], axis=1) > rule.contact
            found |= touching & (finger["slip_speed"] > rule.sliding)
    return np.asarray(np.isin(truth.hand["phase"], HELD_PHASES) & found)


def _held_since(truth: Truth, place: int) -> float:
    free = np.flatnonzero(~np.isin(truth.hand["phase"][: place + 1], HELD_PHASES))
    return float(truth.times[free[-1]]) if len(free) else float(truth.times[0])


def _latency(slip: SlipInterval, hand: FingerDecisions) -> float:
    """How long until the hand is not called stable; at least until the last of `POSTS`."""
    last = max(slip.end, slip.onset + POSTS[-1]) + ROUNDING
    rows = slice(*np.searchsorted(hand.times, (slip.onset - ROUNDING, last)))
    told = (hand.states[rows] != STABLE) & (hand.states[rows] != UNKNOWN)
    if not told.any():
        return math.inf
    return max(float(hand.times[rows][np.argmax(told)]) - slip.onset, 0.0)


def follows_jump(times: Array, truth: Truth | None) -> Mask:
    """(n,) whether the controller's set point has just jumped; never, where that is not known."""
    if truth is None or SET_POINT not in truth.hand:
        return np.zeros(len(times), dtype=np.bool_)
    jumps: Array = truth.times[np.abs(truth.hand[SET_POINT]) > 0]
    first = np.searchsorted(jumps, times - AFTER_GLITCH - ROUNDING)
    last = np.searchsorted(jumps, times + ROUNDING)
    return np.asarray(last > first)
