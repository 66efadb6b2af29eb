"""Hands of one flat patch with given forces, for features computed by hand."""

import numpy as np

from holdfast.detection import Tare
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor
from holdfast_lab.study.methods import HandSignal, hand_signal

UP = np.array([0.0, 0.0, 1.0])


def patch(n_taxels=1, rate=100.0, unit="count"):
    """A patch whose taxel frames are the fingertip frame: the force is the sum of its taxels."""
    places, turns = np.zeros((n_taxels, 3)), np.tile(np.eye(3), (n_taxels, 1, 1))
    return Sensor("patch", places, turns, UP, rate=rate, unit=unit)


def pressed(readings, rate=100.0, unit="count", times=None) -> HandSignal:
    """The hand of one finger; (n, 3) is one taxel, (n, n_taxels, 3) are more. No tare."""
    readings = np.asarray(readings, dtype=float)
    readings = readings[:, None] if readings.ndim == 2 else readings
    times = np.arange(len(readings)) / rate if times is None else times
    finger = Tactile(patch(readings.shape[1], rate, unit), times, readings)
    return hand_signal(Recording("by hand", {"index": finger}), Tare.parse("none"), ("index",))


def along_normal(values):
    """(n, 3) readings of a taxel that is pressed straight."""
    return np.outer(values, UP)
