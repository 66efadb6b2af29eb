"""One feature and one cut: the paper's instability beside energies, everything else equal.

The paper holds that the standard deviation of the Haar details, sigma, tells instability better
than their energy, because noise adds to the energy. Both are taken here from the same window of
the same signal, and on a log scale: no cut changes by that, and probabilities do not saturate,
so that those of several fits can be pooled for an AUC.
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from holdfast.classifiers import Threshold
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.paper import WINDOW
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise, windowed
from holdfast.study.methods.wavelets import detail_energy

LEAST = 1e-9
"""Under it there is nothing [count or N, and their squares]."""
SOURCE = "for one question of the study: the exact best cut on one feature, N_w = 14"


def detail_sigma(values: Array, window: int = WINDOW) -> Array:
    r"""The paper's sigma of the Haar details over the window that ends at each sample.

        sigma = sqrt(sum (d - mean d)^2 / N_w),        d = (x_0 - x_1) / sqrt(2)

    Args:
        values: (n,) of one unbroken stretch, such as F_a [count or N].
        window: N_w, samples in the window; even.

    Returns:
        (n,) [count or N]; NaN where the window is not full.

    Example:
        >>> detail_sigma(np.array([1.0, 3.0, 3.0, 2.0]), window=4).round(3).tolist()
        [nan, nan, nan, 0.75]
    """

    def of(windows: Array) -> Array:
        details = (windows[:, 0::2] - windows[:, 1::2]) / np.sqrt(2)
        centred = details - details.mean(axis=1, keepdims=True)
        return np.asarray(np.sqrt((centred**2).sum(axis=1, keepdims=True) / window))

    return windowed(values, window, of)[:, 0]


def _amplitude(finger: FingerSignal) -> Array:
    return finger.amplitude


def _pressing(finger: FingerSignal) -> Array:
    return finger.pressing


def _features(
    signal: Callable[[FingerSignal], Array], measure: Callable[[Array], Array], hand: HandSignal
) -> Mapping[str, Array]:
    return stretchwise(
        hand, lambda finger: np.log10(np.maximum(measure(signal(finger)), LEAST))[:, None]
    )


CUTS = {
    name: Method(
        name, title, "vibration", SOURCE, partial(_features, signal, measure), Threshold("below")
    )
    for name, title, signal, measure in (
        ("sigma_cut", "sigma of F_a", _amplitude, detail_sigma),
        ("energy_cut", "energy of F_a", _amplitude, detail_energy),
        ("energy_x_cut", "energy of F_x (Zhang)", _pressing, detail_energy),
    )
}
"""Methods of one feature, by name."""
