"""Zhang et al. 2016: the energy of the Haar details of the normal force."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import recipe
from holdfast.features.haar import check_window
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise, windowed

WINDOW = 14
SOURCE = (
    "Zhang et al., IEEE Sensors Journal 16:7073, 2016, as Kitouni et al. tested it: energy of the "
    "Haar details of F_x over N_w = 14, its threshold found by a linear SVM. Zhang's were found "
    "by experiment, one for slip by gravity, one for disturbances; here one is fitted"
)


def detail_energy(values: Array, window: int = WINDOW) -> Array:
    r"""The energy of the Haar details over the window that ends at each sample.

        E = sum d^2,        d = (x_0 - x_1) / sqrt(2)

    Args:
        values: (n,) of one unbroken stretch, such as F_x [count or N].
        window: N_w, samples in the window; even, at least 2.

    Returns:
        (n,) [count^2 or N^2]; NaN where the window is not full.

    Raises:
        ValueError: an odd window, or one under 2.

    Example:
        >>> detail_energy(np.array([1.0, 3.0, 3.0, 2.0]), window=4).tolist()
        [nan, nan, nan, 2.5]
    """

    def of(windows: Array) -> Array:
        steps = windows[:, 0::2] - windows[:, 1::2]
        return np.asarray((steps * steps).sum(axis=1, keepdims=True) / 2)

    return windowed(values, check_window(window), of)[:, 0]


def energy(hand: HandSignal, window: int = WINDOW) -> dict[str, Array]:
    """The energy of the details of the normal force, F_x, of every finger: (n, 1)."""

    def of(finger: FingerSignal) -> Array:
        return detail_energy(finger.pressing, window)[:, None]

    return stretchwise(hand, of)


def _deployed(hand: HandSignal) -> Mapping[str, Array]:
    return energy(hand)


ZHANG = Method(
    "zhang", "Haar energy of F_x (Zhang 2016)", "vibration", SOURCE, _deployed, recipe("svm")
)
