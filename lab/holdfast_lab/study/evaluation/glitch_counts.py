"""Glitches of the hand's controller, by the truth, and how far the object slides after them."""

import msgspec
import numpy as np

from holdfast.contact import CONTACT_FORCE, HELD_PHASES, SLIP_SPEED
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_truth import sample_durations
from holdfast.metrics.truth_labels import LabelRule, glitches
from holdfast.recordings import Truth
from holdfast.sensors.types import Array


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
