"""Methods on the details of the Haar window: the paper's own, Zhang's and single features.

- `LOGREG`, `SVM`: the paper's method, a linear classifier of the force and of sigma, with
  balanced classes; `LOGREG_UNWEIGHTED`, `SVM_UNWEIGHTED`: without class weights.
- `LOG_TWO`: the same idea with two features, log F_a and log sigma.
- `LOG_HAND`: the same with a third one, the largest log sigma of all fingers of the hand.
- `ENERGY`: a threshold on the energy of the details of F_a, without their mean taken out.
- `TREES`: boosted trees on the paper's six features, as an upper limit of what they hold.
- `ZHANG`: the energy of the details of the normal force.
"""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from holdfast.detection import DEFAULT_WINDOW, DEPLOYED_FEATURES, FEATURE_NAMES, haar_features
from holdfast.detection.specs import check_window
from holdfast.sensors.types import Array
from holdfast.training.classifiers import recipe
from holdfast_lab.classifiers.threshold import Threshold
from holdfast_lab.classifiers.trees import GradientBoosting
from holdfast_lab.study.methods.method import (
    FingerSignal,
    HandSignal,
    Method,
    latest_rows,
    stretchwise,
    windowed,
)

PAPER_SOURCE = "Kitouni, Khoramshahi and Perdereau: the deployed features, without m, at N_w = 14"
UNWEIGHTED_SOURCE = (
    f"{PAPER_SOURCE}; classes are not weighted, as in the toolbox that the paper used"
)
LOG_TWO_SOURCE = (
    "no paper: the two quantities of Kitouni et al., F_a and sigma at N_w = 14, on logarithmic "
    "scales, by logistic regression with balanced classes"
)
LOG_HAND_SOURCE = (
    "no paper: log F_a and log sigma of the finger at N_w = 14, and the largest log sigma of all "
    "fingers, so that a finger is judged by the whole hand too; logistic regression with balanced "
    "classes"
)
ENERGY_SOURCE = (
    "the rival of sigma in Kitouni et al.: sum d^2 of the Haar details of F_a at N_w = 14, whose "
    "mean is not taken out, and the exact best threshold"
)
TREES_SOURCE = (
    f"no paper: all six features of Kitouni et al. at N_w = {DEFAULT_WINDOW}, without a linear rule"
)
ZHANG_SOURCE = (
    "Zhang et al., IEEE Sensors Journal 16:7073, 2016, as Kitouni et al. tested it: energy of the "
    "Haar details of F_x over N_w = 14, its threshold found by a linear SVM. Zhang et al. found "
    "two thresholds by experiment, one for slip by gravity and one for disturbances; here one is "
    "fitted"
)
MIN_LOG_ARGUMENT = 1e-9
"""Smallest sigma [count or N] or energy [count^2 or N^2] that enters a logarithm."""


def paper_features(
    hand: HandSignal, names: Sequence[str] = DEPLOYED_FEATURES, window: int = DEFAULT_WINDOW
) -> dict[str, Array]:
    """Return some of the paper's features of every finger, (n, n_names).

    Args:
        hand: gives the fingers.
        names: of `FEATURE_NAMES`.
        window: N_w.
    """
    columns = [FEATURE_NAMES.index(name) for name in names]

    def of_stretch(finger: FingerSignal) -> Array:
        return np.ascontiguousarray(haar_features(finger.force, window)[:, columns])

    return stretchwise(hand, of_stretch)


def detail_energy(values: Array, window: int = DEFAULT_WINDOW) -> Array:
    r"""Return the energy of the Haar details over the window that ends at each sample.

        E = sum d^2,        d = (x_0 - x_1) / sqrt(2)

    Args:
        values: (n,) of one unbroken stretch, such as F_x [count or N].
        window: N_w, samples in the window; even, at least 2.

    Returns:
        (n,) [count^2 or N^2]; NaN without a full window.

    Raises:
        ValueError: the window is odd, or under 2.

    Example:
        >>> detail_energy(np.array([1.0, 3.0, 3.0, 2.0]), window=4).tolist()
        [nan, nan, nan, 2.5]
    """

    def of_windows(windows: Array) -> Array:
        steps = windows[:, 0::2] - windows[:, 1::2]
        return np.asarray((steps * steps).sum(axis=1, keepdims=True) / 2)

    return windowed(values, check_window(window), of_windows)[:, 0]


def log_energy(hand: HandSignal) -> Mapping[str, Array]:
    """Return log10 of the energy of the details of F_a of every finger, (n, 1).

    The logarithm changes no threshold. It keeps probabilities from saturating, so that those of
    several fits can be pooled for an AUC.
    """

    def of_stretch(finger: FingerSignal) -> Array:
        return np.asarray(
            np.log10(np.maximum(detail_energy(finger.amplitude), MIN_LOG_ARGUMENT))[:, None]
        )

    return stretchwise(hand, of_stretch)


def normal_energy(hand: HandSignal, window: int = DEFAULT_WINDOW) -> dict[str, Array]:
    """Return the energy of the details of F_x of every finger, (n, 1)."""
    return stretchwise(hand, lambda finger: detail_energy(finger.normal_force, window)[:, None])


def log_force_and_sigma(hand: HandSignal) -> Mapping[str, Array]:
    """Return log10 of F_a and of sigma of every finger, (n, 2)."""
    return {
        name: np.log10(np.maximum(rows, MIN_LOG_ARGUMENT))
        for name, rows in paper_features(hand, ("F_a", "sigma")).items()
    }


def log_force_and_sigmas(hand: HandSignal) -> Mapping[str, Array]:
    """Return log10 of F_a, of sigma and of the largest sigma of all fingers, (n, 3).

    Fingers without a sigma at the time are left out of the largest.
    """
    features = log_force_and_sigma(hand)
    sigmas = {name: rows[:, 1:] for name, rows in features.items()}
    # fmax, not max, because it passes over the NaN of a finger.
    return {
        name: np.hstack([
            rows, np.fmax.reduce(list(latest_rows(hand, sigmas, hand.fingers[name].times)))
        ])
        for name, rows in features.items()
    }  # fmt: skip


UNWEIGHTED = {"C": 1.0, "class_weight": None}
"""Parameters of a classifier whose classes are not weighted."""

LOGREG = Method(
    "logreg", "LogReg (the paper)", "paper", PAPER_SOURCE, paper_features, recipe("logreg")
)
LOGREG_UNWEIGHTED = Method(
    "logreg_unweighted", "LogReg, classes unweighted (the paper)", "paper", UNWEIGHTED_SOURCE,
    paper_features, recipe("logreg"), UNWEIGHTED,
)  # fmt: skip
SVM = Method("svm", "Linear SVM (the paper)", "paper", PAPER_SOURCE, paper_features, recipe("svm"))
SVM_UNWEIGHTED = Method(
    "svm_unweighted", "Linear SVM, classes unweighted (the paper)", "paper", UNWEIGHTED_SOURCE,
    paper_features, recipe("svm"), UNWEIGHTED,
)  # fmt: skip
LOG_TWO = Method(
    "log_two", "LogReg of log F_a and log sigma", "paper", LOG_TWO_SOURCE,
    log_force_and_sigma, recipe("logreg"),
)  # fmt: skip
LOG_HAND = Method(
    "log_hand", "LogReg of log F_a, log sigma and the hand's largest", "paper", LOG_HAND_SOURCE,
    log_force_and_sigmas, recipe("logreg"),
)  # fmt: skip
TREES = Method(
    "trees", "Boosted trees, 6 features", "learning", TREES_SOURCE,
    partial(paper_features, names=FEATURE_NAMES), GradientBoosting(),
)  # fmt: skip
ZHANG = Method(
    "zhang", "Haar energy of F_x (Zhang 2016)", "vibration", ZHANG_SOURCE, normal_energy,
    recipe("svm"),
)  # fmt: skip


ENERGY = Method(
    "energy", "Haar energy of F_a", "paper", ENERGY_SOURCE, log_energy, Threshold("below"),
)  # fmt: skip
