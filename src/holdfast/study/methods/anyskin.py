"""Three features of the shear over ten samples (the AnySkin handover demonstration)."""

from collections.abc import Mapping

import numpy as np

from holdfast.classifiers import recipe
from holdfast.sensors.types import Array
from holdfast.study.methods.method import Method
from holdfast.study.methods.signals import FingerSignal, HandSignal, stretchwise, windowed

WINDOW = 10

SOURCE = (
    "the released code of the AnySkin handover demonstration (NYU, 2024): logistic regression on "
    "three features of the last 10 samples of the shear of all taxels. Changed: the tare is taken "
    "without contact (there once the object is held), readings are not smoothed (there "
    "Savitzky-Golay, 11 samples, order 3), every sample is judged. Its rule that over 80 % of the "
    "last 10 decisions agree is left to the debouncing"
)


def shear_features(hand: HandSignal) -> Mapping[str, Array]:
    """Span, |sum| and sum of standard deviations of the shear of every finger: (n, 3)."""
    return stretchwise(hand, _of)


def three(shear: Array, window: int = WINDOW) -> Array:
    """What the demonstration looks at, over the window that ends at each sample.

    Args:
        shear: (n, n_taxels, 2) x and y of every taxel, of one unbroken stretch [count or N].
        window: samples in it.

    Returns:
        (n, 3): the largest less the smallest value of all channels and samples, the size of the
        sum of all, and the sum over channels of the standard deviation over samples; NaN where
        the window is not full.
    """
    extremes = [shear.max(axis=(1, 2)), shear.min(axis=(1, 2)), shear.sum(axis=(1, 2))]
    return np.column_stack(
        [
            windowed(np.column_stack(extremes), window, _span_and_sum),
            windowed(shear, window, _deviations),
        ]
    )


def _span_and_sum(windows: Array) -> Array:
    """From (m, 3, window) of the largest, the smallest and the sum of the samples to (m, 2)."""
    span = windows[:, 0].max(axis=1) - windows[:, 1].min(axis=1)
    return np.column_stack([span, np.abs(windows[:, 2].sum(axis=1))])


def _deviations(windows: Array) -> Array:
    """From (m, n_taxels, 2, window) to (m, 1): two passes, so that nothing drifts."""
    return np.asarray(windows.std(axis=-1).sum(axis=(1, 2))[:, None])


def _of(finger: FingerSignal) -> Array:
    return three(finger.readings[:, :, :2])


ANYSKIN = Method(
    "anyskin", "AnySkin shear features", "learning", SOURCE, shear_features, recipe("logreg")
)
