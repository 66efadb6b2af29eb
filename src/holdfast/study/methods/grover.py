"""Grover et al. (2022): a temporal convolutional network over the last second."""

import numpy as np

from holdfast.classifiers.tcn import TemporalConvolution
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

N_STEPS = 100
STEP = 0.01
"""A window of one second at 100 Hz [s]."""

SOURCE = (
    "Grover et al. 2022, by the released configuration: the network and its "
    "training, but the three axes of the fingertip force in place of six barometers, no "
    "augmentation, and few epochs"
)


def last_second(hand: HandSignal) -> dict[str, Array]:
    """(n, 300) of every finger: its force over the last second, oldest step first.

    Steps are 0.01 s apart whatever the rate, by straight lines between samples, the last at the
    sample itself; float32, for there are many. NaN in the first second of a stretch.
    """
    return {name: rows.astype(np.float32) for name, rows in stretchwise(hand, _steps).items()}


def _steps(finger: FingerSignal) -> Array:
    """The steps of the second that ends at each sample, x y z of one after the other."""
    found = np.full((len(finger.times), N_STEPS, 3), np.nan)
    first = finger.times[:1] + (N_STEPS - 1) * STEP - 0.5 / finger.rate
    full = finger.times >= first
    at = finger.times[full, None] - STEP * np.arange(N_STEPS)[::-1]
    if full.any():
        for axis in range(3):
            found[full, :, axis] = np.interp(at, finger.times, finger.force[:, axis])
    return found.reshape(len(found), 3 * N_STEPS)


TCN = Method(
    "tcn",
    "TCN (Grover et al.)",
    "learning",
    SOURCE,
    last_second,
    TemporalConvolution(),
)
