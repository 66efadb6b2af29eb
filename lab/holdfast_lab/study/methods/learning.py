"""Learning methods from publications: AnySkin's shear, James & Lepora."""

from collections.abc import Mapping

import numpy as np

from holdfast.errors import TrainingError
from holdfast.sensors.types import Array
from holdfast.training.classifiers import recipe
from holdfast_lab.study.methods.method import (
    HAND,
    FingerSignal,
    HandSignal,
    Method,
    latest_rows,
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
    "James & Lepora 2020 (arXiv 2010.01928). Of the publication only the abstract could be read, "
    "which names support vector machines and no features. That there are classifiers of a finger "
    "(local) and of a hand (global), and logistic regression, is from Kitouni et al.; the idea of "
    "the features, the motion of the pins of an optical fingertip between two images, is from "
    "memory, not checked. Ported: magnitude and direction of the change of the shear of every "
    "taxel over 1/60 s, and their spread over the fingertip. These features and the time between "
    "two images are our own choice; classifiers and training are those of Kitouni et al"
)
MOTION_STEP = 1 / 60
"""Time over which a motion of taxels is measured [s]: between two images of a usual camera."""
SUMMARY_FEATURES = 6
"""Features of the motion of a whole fingertip, see `taxel_motion`."""


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

    def span_and_sum(windows: Array) -> Array:
        """From (m, 3, window) largest, smallest and sum of the samples to (m, 2)."""
        span = windows[:, 0].max(axis=1) - windows[:, 1].min(axis=1)
        return np.column_stack([span, np.abs(windows[:, 2].sum(axis=1))])

    def sum_of_deviations(windows: Array) -> Array:
        """From (m, n_taxels, 2, window) to (m, 1), in two passes to avoid rounding errors."""
        return np.asarray(windows.std(axis=-1).sum(axis=(1, 2))[:, None])

    # Reduced over the channels first: the windows then hold 3 numbers a sample, not all taxels.
    extremes = [shear.max(axis=(1, 2)), shear.min(axis=(1, 2)), shear.sum(axis=(1, 2))]
    return np.column_stack(
        [
            windowed(np.column_stack(extremes), window, span_and_sum),
            windowed(shear, window, sum_of_deviations),
        ]
    )


def taxel_motion(hand: HandSignal) -> dict[str, Array]:
    """Return magnitudes and directions of the motion of the taxels of every finger.

    The motion of a taxel is the change of its two tangential readings over `MOTION_STEP`. James
    & Lepora use optical sensors and the motion of their pins; here the shear of a taxel stands
    for the displacement of a pin.

    Returns:
        (n, 6 + n_taxels): mean and standard deviation of the magnitudes over the fingertip;
        magnitude of the mean motion; its direction, as cosine and sine; the circular spread of
        the directions from 0 (all alike) to 1; then the magnitude of every taxel. Magnitudes
        are in the unit of the readings. NaN until `MOTION_STEP` after the start of a stretch.
    """

    def of_stretch(finger: FingerSignal) -> Array:
        n_samples = max(1, round(MOTION_STEP * finger.rate))
        features = np.full((len(finger.times), SUMMARY_FEATURES + finger.sensor.n_taxels), np.nan)
        shear = finger.readings[:, :, :2]
        if len(shear) > n_samples:
            features[n_samples:] = motion_features(shear[n_samples:] - shear[:-n_samples])
        return features

    return stretchwise(hand, of_stretch)


def hand_motion(hand: HandSignal) -> dict[str, Array]:
    """Return the taxel motions of all fingers side by side, at the times of the first.

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
    return {HAND: np.hstack(list(latest_rows(hand, taxel_motion(hand), times)))}


def motion_features(motion: Array) -> Array:
    """Return the features of (n, n_taxels, 2) motions, see `taxel_motion`.

    The circular spread is 1 - R, where R is the length of the mean of the unit vectors of the
    directions. A taxel that does not move has no direction; if none moves, the spread is 1.

    Example:
        >>> motion_features(np.array([[[3.0, 4.0], [3.0, 4.0]]])).round(2).tolist()
        [[5.0, 0.0, 5.0, 0.6, 0.8, 0.0, 5.0, 5.0]]
    """
    magnitudes = np.linalg.norm(motion, axis=2)
    mean_motion = motion.mean(axis=1)
    common = np.linalg.norm(mean_motion, axis=1)
    direction = _unit(mean_motion, common)
    units = _unit(motion, magnitudes)
    n_moving = np.maximum((magnitudes > 0).sum(axis=1), 1)
    spread = 1.0 - np.linalg.norm(units.sum(axis=1), axis=1) / n_moving
    summary = [magnitudes.mean(axis=1), magnitudes.std(axis=1), common, *direction.T, spread]
    return np.column_stack([*summary, magnitudes])


def _unit(vectors: Array, lengths: Array) -> Array:
    """Return vectors of length 1; 0 for a vector of length 0."""
    return vectors / np.where(lengths > 0, lengths, 1.0)[..., None]


ANYSKIN = Method(
    "anyskin", "AnySkin shear features", "learning", ANYSKIN_SOURCE, shear_features,
    recipe("logreg"),
)  # fmt: skip
JAMES_LEPORA = tuple(
    Method(
        f"jl_{scope}_{classifier}",
        f"{title}, {scope} (James & Lepora)",
        "learning",
        JAMES_LEPORA_SOURCE,
        hand_motion if scope == "global" else taxel_motion,
        recipe(classifier),
        whole_hand=scope == "global",
    )
    for scope in ("local", "global")
    for classifier, title in (("logreg", "LogReg"), ("svm", "Linear SVM"))
)
"""Of single fingers (local) and of whole hands (global)."""
