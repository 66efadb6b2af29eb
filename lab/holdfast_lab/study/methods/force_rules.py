"""Methods on the fingertip force itself: friction margin, tangential change, force difference.

And on its vibration: the PR2's slip servo, and energy in spectral bands.
"""

from collections.abc import Mapping

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.signal import butter, lfilter

from holdfast.sensors.types import Array
from holdfast.training.classifiers import recipe
from holdfast_lab.classifiers.threshold import Threshold
from holdfast_lab.study.methods.method import (
    FingerSignal,
    HandSignal,
    Method,
    stretchwise,
    windowed,
)

FRICTION_SOURCE = (
    "Coulomb's law, as in Melchiorri 2000 without his torsion (his elliptic limit surface from "
    "memory, not checked): stable where mu F_n - F_t > m_0. Logistic regression on (F_n, F_t) is "
    "this line, with mu and m_0 by fit; the margin, not the ratio F_t / F_n, since the ratio is "
    "noise without contact"
)
TANGENTIAL_SOURCE = (
    "Wong and Zhu, Frontiers in Robotics and AI, 10.3389/frobt.2026.1735467, 2026 (abstract only): "
    "|T_k - T_(k-1)| / max(T_(k-1), eps) above a threshold, per finger, T the tangential part of "
    "F_tip less the tare. Own choice: eps = 0.011 N (15 counts), three times the noise; the "
    "threshold is found on the training set; a finger is engaged by the contact threshold on F_a "
    "that all methods share (there by a threshold on the normal force)"
)
DIFFERENCE_SOURCE = (
    "the derivative of the force against a threshold, as in Osborn 2013, Lee 2018 and Feng 2019 "
    "(from memory, not checked): |F_k - F_(k-1)| x rate, of the vector F_tip"
)

MIN_TANGENTIAL_FORCE = 0.011
"""eps, the smallest force that a change is divided by [N].

Three times the noise of a component of F_tip: 30 taxels of 0.9 counts each make 5 counts, and
15 counts are 0.011 N.
"""


def normal_and_tangential(hand: HandSignal) -> Mapping[str, Array]:
    """Return |F_n| and |F_t| of every finger, (n, 2).

    A linear classifier of them, w_0 + w_n F_n + w_t F_t >= 0, is the Coulomb margin
    mu F_n - F_t >= m_0 with mu = -w_n / w_t and m_0 = w_0 / w_t.
    """
    return stretchwise(
        hand, lambda f: np.column_stack([f.normal_magnitude, f.tangential_magnitude])
    )


def tangential_change(hand: HandSignal) -> Mapping[str, Array]:
    """Return |T_k - T_(k-1)| / max(T_(k-1), eps), (n, 1); NaN at the start of a stretch."""

    def of_stretch(finger: FingerSignal) -> Array:
        now = finger.tangential_magnitude
        # Cut, so that an empty stretch stays empty.
        before = np.concatenate([[np.nan], now])[: len(now)]
        smallest = MIN_TANGENTIAL_FORCE * finger.units_per_newton
        return np.asarray((np.abs(now - before) / np.maximum(before, smallest))[:, None])

    return stretchwise(hand, of_stretch)


def force_rate(hand: HandSignal) -> Mapping[str, Array]:
    """Return |F_k - F_(k-1)| x rate [count/s or N/s], (n, 1); NaN at the start of a stretch."""

    def of_stretch(finger: FingerSignal) -> Array:
        steps = np.diff(finger.force, axis=0, prepend=np.full((1, 3), np.nan))
        return np.asarray(np.linalg.norm(steps, axis=1, keepdims=True) * finger.rate)

    return stretchwise(hand, of_stretch)


FRICTION_METHOD = Method(
    "friction",
    "Coulomb friction margin",
    "friction",
    FRICTION_SOURCE,
    normal_and_tangential,
    recipe("logreg"),
)
TANGENTIAL = Method(
    "tangential",
    "Relative tangential change (Wong and Zhu 2026)",
    "differentiation",
    TANGENTIAL_SOURCE,
    tangential_change,
    Threshold("below"),
)
DIFFERENCE = Method(
    "difference",
    "Force difference",
    "differentiation",
    DIFFERENCE_SOURCE,
    force_rate,
    Threshold("below"),
)


SLIP_SERVO_SOURCE = (
    "Romano et al. 2011, with the figures of the released code: slip where "
    "|F_hp| > clip(0.007 |F|, 0.048 N, 0.2 N) and |F_bp| < 0.18 N. Ported: F is F_x in place "
    "of the sum over a pad's pressures; newtons are nominal where readings are counts (0.000729 N "
    "each), so the ratio |F_hp| / clip(...), 0 where the grip changes, is compared "
    "with a threshold found on the training set (1 in the source); the order of the band-pass, "
    "first, is our own choice. The servo is made for a held object: it does not call closing a "
    "slip"
)
HIGH_PASS = 5.0
"""Cut-off frequency of the fast force [Hz]."""
GRIP_BAND = (0.8, 5.0)
"""Band in which the force shows that the grip itself changes [Hz]."""
FORCE_FRACTION = 0.007
"""Threshold of the fast force, as a fraction of the force."""
MIN_THRESHOLD, MAX_THRESHOLD = 0.048, 0.2
"""Limits of the threshold of the fast force [N]."""
MAX_GRIP_CHANGE = 0.18
"""Force in `GRIP_BAND` from which nothing is called slip [N]."""

SPECTRUM_SOURCE = (
    "after Fernandez et al. 2014 (abstract only): energy of the spectrum in a slip "
    "band against a threshold. Own choices: 0.2 s, Hann, the three axes added, five candidate "
    "bands up to 75 Hz, of which the training set picks one, and the logarithm"
)
SPECTRUM_WINDOW = 0.2
"""Length of the window of the spectrum [s]: bins every 5 Hz, the start of the lowest band."""
BANDS = ((5.0, 15.0), (15.0, 30.0), (30.0, 50.0), (50.0, 75.0), (5.0, 75.0))
"""Candidate bands [Hz]; 75 Hz is half of the usual rate of 150 Hz."""
MIN_ENERGY = 1e-12
"""Energy added before the logarithm [count^2 or N^2]: far below the noise of any sensor."""


def slip_ratio(hand: HandSignal) -> Mapping[str, Array]:
    """Return the fast force over its threshold, (n, 1); 0 where the grip changes.

    |F_hp| / clip(0.007 |F|, 0.048 N, 0.2 N) where |F_bp| < 0.18 N.
    """

    def of_stretch(finger: FingerSignal) -> Array:
        force, newton = finger.normal_force, finger.units_per_newton
        threshold = np.clip(
            FORCE_FRACTION * np.abs(force), MIN_THRESHOLD * newton, MAX_THRESHOLD * newton
        )
        steady = np.abs(band_pass(force, finger.rate)) < MAX_GRIP_CHANGE * newton
        ratio = np.abs(high_pass(force, finger.rate)) / threshold
        return np.asarray((ratio * steady)[:, None])

    return stretchwise(hand, of_stretch)


def high_pass(values: Array, rate: float, frequency: float = HIGH_PASS) -> Array:
    """Return the first-order high-pass y_k = a (y_(k-1) + x_k - x_(k-1)), from rest at 0.

    The filter is linear: filtering the sum over a pad equals summing the filtered values.

    Args:
        values: (n,) of one unbroken stretch.
        rate: samples per second [Hz].
        frequency: f, by which a = 1 / (1 + 2 pi f / rate) [Hz].

    Returns:
        (n,), in the unit of the values.
    """
    # The first value is taken off, so that a force that lasts is no step at the start.
    a = 1.0 / (1.0 + 2.0 * np.pi * frequency / rate)
    return np.asarray(lfilter([a, -a], [1.0, -a], values - values[:1]))


def band_pass(values: Array, rate: float, band: tuple[float, float] = GRIP_BAND) -> Array:
    """Return the part of (n,) values in a band [Hz]: first-order Butterworth, causal, from 0."""
    numerator, denominator = butter(1, band, "bandpass", fs=rate)
    return np.asarray(lfilter(numerator, denominator, values - values[:1]))


def band_energies(hand: HandSignal) -> Mapping[str, Array]:
    """Return log10 of the energy of the force in each of `BANDS`, axes added, (n, 5)."""
    return stretchwise(hand, lambda f: np.log10(band_energy(f.force, f.rate, BANDS) + MIN_ENERGY))


def band_energy(
    values: Array,
    rate: float,
    bands: tuple[tuple[float, float], ...],
    seconds: float = SPECTRUM_WINDOW,
) -> Array:
    r"""Return the energy in bands of the spectrum of the window that ends at each sample.

        E = 2 / (N sum_k w_k^2) x sum_(f in band) |X(f)|^2

    X is the Fourier transform of N samples less their mean, times a Hann window w. The factor
    makes E the power: A^2 / 2 for a sine of amplitude A well inside the band.

    Args:
        values: (n, n_axes) of one unbroken stretch.
        rate: samples per second [Hz].
        bands: lower limit (included) and upper limit (excluded) of each [Hz].
        seconds: length of the window [s].

    Returns:
        (n, n_bands), summed over the axes [unit^2]; NaN without a full window.
    """
    window = round(seconds * rate)
    weights = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(window) / window)
    frequencies = rfftfreq(window, 1 / rate)
    inside = np.array([(frequencies >= low) & (frequencies < high) for low, high in bands])

    def of_windows(windows: Array) -> Array:
        # The window would spread the mean, the grip itself, over the lowest bins.
        centred = windows - windows.mean(axis=-1, keepdims=True)
        spectrum = rfft(centred * weights, axis=-1)
        power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
        return np.asarray(power @ inside.T * (2 / (window * (weights**2).sum())))

    return windowed(values, window, of_windows)


SLIP_SERVO = Method(
    "slip_servo",
    "PR2 slip servo (Romano 2011)",
    "vibration",
    SLIP_SERVO_SOURCE,
    slip_ratio,
    Threshold("below"),
)
SPECTRUM = Method(
    "spectrum",
    "FFT band energy (Fernandez 2014)",
    "vibration",
    SPECTRUM_SOURCE,
    band_energies,
    Threshold("below"),
)
