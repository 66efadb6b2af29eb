"""The slip servo of the PR2's gripper (Romano et al. 2011)."""

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, lfilter

from holdfast.classifiers import Threshold
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise

HIGH_PASS = 5.0
"""Above which a force is fast [Hz]."""
BAND = (0.8, 5.0)
"""In which it tells that the grip itself changes [Hz]."""
SHARE = 0.007
LEAST, MOST = 0.048, 0.2
"""Limits of the threshold of the fast force [N]."""
SLOW = 0.18
"""The slow force from which on nothing is called slip [N]."""

SOURCE = (
    "Romano et al. 2011, with the figures of the released code: slip where "
    "|F_hp| > clip(0.007 |F|, 0.048 N, 0.2 N) and |F_bp| < 0.18 N. Ported: F is F_x in place "
    "of the sum over a pad's pressures; newtons are nominal where readings are counts (0.000729 N "
    "each), so the ratio |F_hp| / clip(...), 0 where the grip changes, is compared "
    "with a threshold found on the training set (1 in the source); the order of the band-pass, "
    "first, is our own choice. The servo is made for a held object: closing is no slip to it"
)


def slip_ratio(hand: HandSignal) -> Mapping[str, Array]:
    """The fast force over its threshold, 0 where the slow force forbids to judge: (n, 1).

    |F_hp| / clip(0.007 |F|, 0.048 N, 0.2 N) where |F_bp| < 0.18 N.
    """
    return stretchwise(hand, _of)


def high_pass(values: Array, rate: float, frequency: float = HIGH_PASS) -> Array:
    """The first-order high-pass y_k = a (y_(k-1) + x_k - x_(k-1)), from rest at 0.

    Linear, so that filtering the sum over a pad is the same as summing the filtered.

    Args:
        values: (n,) of one unbroken stretch.
        rate: samples per second [Hz].
        frequency: f, by which a = 1 / (1 + 2 pi f / rate) [Hz].

    Returns:
        (n,), in the unit of the values.
    """
    a = 1.0 / (1.0 + 2.0 * np.pi * frequency / rate)
    return np.asarray(lfilter([a, -a], [1.0, -a], values - values[:1]))


def band_pass(values: Array, rate: float, band: tuple[float, float] = BAND) -> Array:
    """What of (n,) values lies within a band [Hz]: first-order Butterworth, causal, from rest."""
    numerator, denominator = butter(1, band, "bandpass", fs=rate)
    return np.asarray(lfilter(numerator, denominator, values - values[:1]))


def _of(finger: FingerSignal) -> Array:
    force, newton = finger.pressing, finger.newton
    threshold = np.clip(SHARE * np.abs(force), LEAST * newton, MOST * newton)
    steady = np.abs(band_pass(force, finger.rate)) < SLOW * newton
    ratio = np.abs(high_pass(force, finger.rate)) / threshold
    return np.asarray((ratio * steady)[:, None])


SLIP_SERVO = Method(
    "slip_servo",
    "PR2 slip servo (Romano 2011)",
    "vibration",
    SOURCE,
    slip_ratio,
    Threshold("below"),
)
