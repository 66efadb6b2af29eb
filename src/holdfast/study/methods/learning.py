"""Learning methods from publications: AnySkin's shear, James & Lepora, Grover's network."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import recipe
from holdfast.classifiers.tcn import TemporalConvolution
from holdfast.errors import TrainingError
from holdfast.features.kernel import GAP_LIMIT_PERIODS
from holdfast.sensors.types import Array
from holdfast.study.methods.method import (
    HAND,
    FingerSignal,
    HandSignal,
    Method,
    stretchwise,
    windowed,
)

ANYSKIN_SOURCE = (
    "the released code of the AnySkin handover demonstration (NYU, 2024): logistic regression on "
    "three features of the last 10 samples of the shear of all taxels. Changed: the tare is taken "
    "without contact (there once the object is held), readings are not smoothed (there "
    "Savitzky-Golay, 11 samples, order 3), every sample is evaluated. Its rule that over 80 % of "
    "the last 10 decisions agree is left to the debouncing"
)
SHEAR_WINDOW = 10
"""Samples in the window of the AnySkin features."""

JAMES_LEPORA_SOURCE = (
    "James & Lepora 2020 (arXiv 2010.01928), by its abstract: differences of taxel readings in "
    "place of those of the pins of optical fingertips; classifiers and training are the paper's"
)

GROVER_SOURCE = (
    "Grover et al. 2022, by the released configuration: the network and its "
    "training, but the three axes of the fingertip force in place of six barometers, no "
    "augmentation, and few epochs"
)
N_STEPS = 100
"""Time steps of the network's window."""
STEP = 0.01
"""Time between two steps [s]: the window is one second at 100 Hz."""


def shear_features(hand: HandSignal) -> Mapping[str, Array]:
    """Return the AnySkin features of every finger, (n, 3), see `shear_statistics`."""
    return stretchwise(hand, lambda finger: shear_statistics(finger.readings[:, :, :2]))


def shear_statistics(shear: Array, window: int = SHEAR_WINDOW) -> Array:
    """Return three features of the shear over the window that ends at each sample.

    Args:
        shear: (n, n_taxels, 2) x and y of every taxel, of one unbroken stretch [count or N].
        window: samples in the window.

    Returns:
        (n, 3): the largest minus the smallest value of all channels and samples; the magnitude
        of the sum of all; the sum over channels of the standard deviation over samples. NaN
        without a full window.
    """
    extremes = [shear.max(axis=(1, 2)), shear.min(axis=(1, 2)), shear.sum(axis=(1, 2))]
    return np.column_stack(
        [
            windowed(np.column_stack(extremes), window, _span_and_sum),
            windowed(shear, window, _sum_of_deviations),
        ]
    )


def _span_and_sum(windows: Array) -> Array:
    """From (m, 3, window) largest, smallest and sum of the samples to (m, 2)."""
    span = windows[:, 0].max(axis=1) - windows[:, 1].min(axis=1)
    return np.column_stack([span, np.abs(windows[:, 2].sum(axis=1))])


def _sum_of_deviations(windows: Array) -> Array:
    """From (m, n_taxels, 2, window) to (m, 1), in two passes to avoid rounding errors."""
    return np.asarray(windows.std(axis=-1).sum(axis=(1, 2))[:, None])


def taxel_differences(hand: HandSignal) -> dict[str, Array]:
    """Return x_k - x_(k-1) of every taxel and axis of every finger, (n, 3 n_taxels).

    NaN at the start of a stretch. James & Lepora use optical sensors and the differences of the
    positions of their pins; here they are differences of taxel readings.
    """
    return stretchwise(hand, _taxel_differences)


def hand_differences(hand: HandSignal) -> dict[str, Array]:
    """Return the taxel differences of all fingers side by side, at the times of the first.

    Another finger contributes its last sample that is not later. If that is more than three
    sample periods old, its values are NaN.

    Raises:
        TrainingError: fewer than two fingers.
    """
    if len(hand.fingers) < 2:
        raise TrainingError(
            "the global classifier of James & Lepora needs at least two fingers, "
            f"{len(hand.fingers)} given ({', '.join(hand.fingers) or 'none'})"
        )
    times = next(iter(hand.fingers.values())).times
    max_age = GAP_LIMIT_PERIODS / hand.rate
    parts = [
        _latest_rows(hand.fingers[name].times, rows, times, max_age)
        for name, rows in taxel_differences(hand).items()
    ]
    return {HAND: np.hstack(parts)}


def _taxel_differences(finger: FingerSignal) -> Array:
    flat = finger.readings.reshape(len(finger.times), 3 * finger.sensor.n_taxels)
    return np.diff(flat, axis=0, prepend=np.full((1, flat.shape[1]), np.nan))


def _latest_rows(source: Array, rows: Array, times: Array, max_age: float) -> Array:
    """Return the latest row at each of `times`; NaN if it is older than `max_age` [s]."""
    last: npt.NDArray[np.intp] = np.searchsorted(source, times, side="right") - 1
    known = (last >= 0) & (times - source[last] <= max_age)
    return np.where(known[:, None], rows[last], np.nan)


def last_second(hand: HandSignal) -> dict[str, Array]:
    """Return the force of every finger over the last second, oldest step first, (n, 300).

    Steps are 0.01 s apart at any rate, interpolated linearly between samples; the last step is
    the sample itself. The result is float32 because it is large. NaN in the first second of a
    stretch.
    """
    return {name: rows.astype(np.float32) for name, rows in stretchwise(hand, _steps).items()}


def _steps(finger: FingerSignal) -> Array:
    """Return the steps of the second that ends at each sample: x y z of one after the other."""
    found = np.full((len(finger.times), N_STEPS, 3), np.nan)
    first = finger.times[:1] + (N_STEPS - 1) * STEP - 0.5 / finger.rate
    full = finger.times >= first
    at = finger.times[full, None] - STEP * np.arange(N_STEPS)[::-1]
    if full.any():
        for axis in range(3):
            found[full, :, axis] = np.interp(at, finger.times, finger.force[:, axis])
    return found.reshape(len(found), 3 * N_STEPS)


def _james_lepora(scope: str, classifier: str, title: str) -> Method:
    return Method(
        f"jl_{scope}_{classifier}",
        f"{title}, {scope} (James & Lepora)",
        "learning",
        JAMES_LEPORA_SOURCE,
        hand_differences if scope == "global" else taxel_differences,
        recipe(classifier),
        whole_hand=scope == "global",
    )


ANYSKIN = Method(
    "anyskin", "AnySkin shear features", "learning", ANYSKIN_SOURCE, shear_features,
    recipe("logreg"),
)  # fmt: skip
JAMES_LEPORA = tuple(
    _james_lepora(scope, classifier, title)
    for scope in ("local", "global")
    for classifier, title in (("logreg", "LogReg"), ("svm", "Linear SVM"))
)
"""Of single fingers (local) and of whole hands (global)."""
TCN = Method(
    "tcn",
    "TCN (Grover et al.)",
    "learning",
    GROVER_SOURCE,
    last_second,
    TemporalConvolution(),
)
