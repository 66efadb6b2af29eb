"""Errors of one recording while the hand holds the object, and glitches of its controller."""

from typing import Any

import msgspec
import numpy as np

from holdfast.contact import (
    CONTACT_FORCE,
    HELD_PHASES,
    SLIP_SPEED,
    STABLE,
    TIME_TOLERANCE,
    UNKNOWN,
)
from holdfast.metrics import Decisions
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_truth import sample_durations
from holdfast.metrics.truth_labels import LabelRule, glitches
from holdfast.recordings import Truth
from holdfast.sensors.types import Array

CountPair = tuple[int, int]
"""Number of samples, and of wrong decisions among them."""


def held_errors(truth: Truth | None, decisions: Decisions) -> CountPair:
    """Return the count of all fingers while the hand holds the object; zeros without a truth.

    Args:
        truth: with the phases.
        decisions: of each finger; of a whole-hand method, of `HAND`.
    """
    n = n_wrong = 0
    if truth is None or "phase" not in truth.hand:
        return n, n_wrong
    for unit in decisions.fingers.values():
        grasped = np.isin(truth.hand["phase"][latest_rows(truth, unit.times)], HELD_PHASES)
        counted = grasped & (unit.labels != UNKNOWN) & (unit.states != UNKNOWN)
        wrong = counted & ((unit.labels == STABLE) != (unit.states == STABLE))
        n, n_wrong = n + int(counted.sum()), n_wrong + int(wrong.sum())
    return n, n_wrong


def latest_rows(truth: Truth, times: Array) -> Any:  # noqa: ANN401 (indices)
    """Return the latest row of the truth at each time."""
    return np.maximum(np.searchsorted(truth.times, times + TIME_TOLERANCE, side="right") - 1, 0)


class GlitchCount(msgspec.Struct, frozen=True):
    """Glitches of the hand's controller in one recording, while the hand holds the object.

    Attributes:
        distances: for each glitch, how far the object slides until the effect of the glitch and
            the sliding that began in it are over [m].
        grasped_seconds: time for which the hand holds the object [s].
    """

    distances: list[float] = []
    grasped_seconds: float = 0.0


def count_glitches(truth: Truth | None) -> GlitchCount:
    """Return the glitches while the hand holds the object, and how far the object slides."""
    if truth is None or not {"phase", "set_point_error"} <= set(truth.hand):
        return GlitchCount()
    grasped = np.isin(truth.hand["phase"], HELD_PHASES)
    steps = sample_durations(truth.times)
    # The speed on the finger on which the object slides fastest [m/s].
    speed = np.zeros(len(truth.times))
    for finger in truth.fingers.values():
        if {"contact_force", "slip_speed"} <= set(finger):
            touching = np.linalg.norm(finger["contact_force"], axis=1) > CONTACT_FORCE
            slips = touching & (finger["slip_speed"] > SLIP_SPEED)
            speed = np.maximum(speed, np.where(slips, finger["slip_speed"], 0.0))
    speed = np.where(grasped, speed, 0.0)
    sliding = runs(speed > 0)
    distances = []
    for start, end in runs(grasped & glitches(truth, LabelRule())):
        # A slide that the glitch began may outlast it: its whole way belongs to the glitch.
        begun = sliding[(sliding[:, 0] >= start) & (sliding[:, 0] < end)]
        last = max([end, *begun[:, 1].tolist()])
        distances.append(float((speed * steps)[start:last].sum()))
    return GlitchCount(distances, float(steps[grasped].sum()))
