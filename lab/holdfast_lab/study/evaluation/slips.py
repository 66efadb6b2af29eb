"""Slips of a held object, by the truth: onset, end, distance, and whether a glitch caused it."""

from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.contact import CONTACT_FORCE, HELD_PHASES, SLIP_SPEED, TIME_TOLERANCE
from holdfast.metrics.events import MIN_GAP_DURATION, MIN_STABLE_DURATION
from holdfast.metrics.masks import Mask, join_runs, runs
from holdfast.metrics.truth_labels import LabelRule, glitches
from holdfast.recordings import Truth
from holdfast.sensors.types import Array

MIN_SLIP_DURATION = 0.02
"""A slip lasts at least this time [s], or slides at least `MIN_SLIP_DISTANCE`."""
MIN_SLIP_DISTANCE = 1e-4
"""Sliding distance from which a shorter slip counts [m]."""


class Slip(NamedTuple):
    """A slip of a held object.

    Attributes:
        onset: time of the first sample at which the object slides [s].
        end: time of the first sample after it [s].
        of_glitch: whether it begins in a glitch of the hand's controller, or right after it.
        times: (m,) from `onset` to `end` [s].
        distances: (m,) slid since the onset [m].
    """

    onset: float
    end: float
    of_glitch: bool
    times: Array
    distances: Array

    def distance_until(self, time: float) -> float:
        """Return the distance slid from the onset to a time [m]."""
        return float(np.interp(time, self.times, self.distances))


class GlitchCount(msgspec.Struct, frozen=True):
    """Glitches of the hand's controller in one recording, while the hand holds the object.

    Attributes:
        n: number of glitches.
        distances: for each glitch, how far the object slides until the effect of the glitch and
            the sliding that began in it are over [m].
        held_seconds: time for which the hand holds the object [s].
    """

    n: int
    distances: list[float]
    held_seconds: float


def find_slips(truth: Truth | None) -> list[Slip]:
    """Return the slips of a recording; none if the truth is not known.

    A slip begins when the object starts to slide on a finger over 1 mm/s. Before that, the hand
    has held the object without a slip for half a second. Sliding that stops for less than
    `MIN_GAP_DURATION` is one slip. It lasts at least 20 ms, or slides at least 0.1 mm.
    """
    if truth is None or "phase" not in truth.hand:
        return []
    speed = sliding_speed(truth)
    after_glitch = glitches(truth, LabelRule())
    slips: list[Slip] = []
    last_sliding = -np.inf
    for start, end in runs(_close_gaps(speed > 0, truth.times)):
        slip = _slip(truth, speed, after_glitch, start, end)
        lasts = slip.end - slip.onset >= MIN_SLIP_DURATION - TIME_TOLERANCE
        if not lasts and slip.distances[-1] < MIN_SLIP_DISTANCE:
            continue
        rest_begin = max(last_sliding, _hold_begin(truth, start))
        if slip.onset - rest_begin >= MIN_STABLE_DURATION - TIME_TOLERANCE:
            slips.append(slip)
        last_sliding = float(truth.times[end - 1])
    return slips


def sliding_speed(truth: Truth) -> Array:
    """Return the speed of the held object on the finger on which it slides fastest, (n,) [m/s].

    The speed is 0 while nothing is held, and below 1 mm/s. A finger counts if it touches.
    """
    speed = np.zeros(len(truth.times))
    for finger in truth.fingers.values():
        if {"contact_force", "slip_speed"} <= set(finger):
            touching = np.linalg.norm(finger["contact_force"], axis=1) > CONTACT_FORCE
            sliding = touching & (finger["slip_speed"] > SLIP_SPEED)
            speed = np.maximum(speed, np.where(sliding, finger["slip_speed"], 0.0))
    return np.where(np.isin(truth.hand["phase"], HELD_PHASES), speed, 0.0)


def count_glitches(truth: Truth | None) -> GlitchCount:
    """Return the glitches while the hand holds the object, and how far the object slides."""
    if truth is None or not {"phase", "set_point_error"} <= set(truth.hand):
        return GlitchCount(0, [], 0.0)
    held = np.isin(truth.hand["phase"], HELD_PHASES)
    steps = sample_durations(truth.times)
    speed = sliding_speed(truth)
    sliding = runs(speed > 0)
    distances = []
    for start, end in runs(held & glitches(truth, LabelRule())):
        begun = sliding[(sliding[:, 0] >= start) & (sliding[:, 0] < end)]
        last = max([end, *begun[:, 1].tolist()])
        distances.append(float((speed * steps)[start:last].sum()))
    return GlitchCount(len(distances), distances, float(steps[held].sum()))


def sample_durations(times: Array) -> Array:
    """Return the time from each sample to the next, (n,) [s]; the median for the last."""
    if len(times) < 2:
        return np.zeros(len(times))
    steps = np.diff(times)
    return np.append(steps, np.median(steps))


def _slip(truth: Truth, speed: Array, after_glitch: Mask, start: int, end: int) -> Slip:
    steps = sample_durations(truth.times)[start:end]
    times = np.append(truth.times[start:end], truth.times[end - 1] + steps[-1])
    distances = np.concatenate([[0.0], np.cumsum(speed[start:end] * steps)])
    of_glitch = bool(after_glitch[start])
    return Slip(float(times[0]), float(times[-1]), of_glitch, times, distances)


def _close_gaps(sliding: Mask, times: Array) -> Mask:
    """Fill rests under `MIN_GAP_DURATION`; a rest lasts from its first sample to the next run."""
    period = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    return join_runs(sliding, times, MIN_GAP_DURATION + period - TIME_TOLERANCE)


def _hold_begin(truth: Truth, place: int) -> float:
    """Return the time of the last sample before `place` at which nothing is held [s]."""
    free = np.flatnonzero(~np.isin(truth.hand["phase"][: place + 1], HELD_PHASES))
    return float(truth.times[free[-1]]) if len(free) else float(truth.times[0])
