"""Vibration in a band of the spectrum, over a sliding window (Fernandez et al. 2014)."""

from collections.abc import Mapping

import numpy as np
from scipy.fft import rfft, rfftfreq

from holdfast.classifiers import Threshold
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise, windowed

SECONDS = 0.2
"""Length of the window [s]: bins every 5 Hz, the lower end of the lowest band."""
BANDS = ((5.0, 15.0), (15.0, 30.0), (30.0, 50.0), (50.0, 75.0), (5.0, 75.0))
"""Candidates, each from a frequency up to another [Hz]; 75 Hz is the most that 150 Hz hold."""
FLOOR = 1e-12
"""Energy below which there is none [count^2 or N^2]: far under the noise of any sensor."""

SOURCE = (
    "after Fernandez et al. 2014 (abstract only): energy of the spectrum in a slip "
    "band against a threshold. Own choices: 0.2 s, Hann, the three axes added, five candidate "
    "bands up to 75 Hz, of which the training set picks one, and the logarithm"
)


def band_energies(hand: HandSignal) -> Mapping[str, Array]:
    """log10 of the energy in each of `BANDS`, the axes of the force added: (n, 5)."""
    return stretchwise(hand, _of)


def band_energy(
    values: Array, rate: float, bands: tuple[tuple[float, float], ...], seconds: float = SECONDS
) -> Array:
    r"""The energy in bands of the spectrum of the window that ends at each sample.

        E = 2 / (N sum_k w_k^2) x sum_(f in band) |X(f)|^2

    X is the Fourier transform of N samples less their mean, times a Hann window w. The factor
    makes E the power: A^2 / 2 for a sine of amplitude A well inside the band.

    Args:
        values: (n, n_axes) of one unbroken stretch.
        rate: samples per second [Hz].
        bands: from, and up to but without [Hz].
        seconds: length of the window [s].

    Returns:
        (n, n_bands), summed over the axes [unit^2]; NaN where the window is not full.
    """
    window = round(seconds * rate)
    weights = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(window) / window)
    frequencies = rfftfreq(window, 1 / rate)
    inside = np.array([(frequencies >= low) & (frequencies < high) for low, high in bands])

    def of(windows: Array) -> Array:
        centred = windows - windows.mean(axis=-1, keepdims=True)
        found = rfft(centred * weights, axis=-1)
        power = (found.real**2 + found.imag**2).sum(axis=1)
        return np.asarray(power @ inside.T * (2 / (window * (weights**2).sum())))

    return windowed(values, window, of)


def _of(finger: FingerSignal) -> Array:
    return np.log10(band_energy(finger.force, finger.rate, BANDS) + FLOOR)


SPECTRUM = Method(
    "spectrum",
    "FFT band energy (Fernandez 2014)",
    "vibration",
    SOURCE,
    band_energies,
    Threshold("below"),
)
