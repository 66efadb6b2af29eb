"""Methods on the details of the Haar window: the paper's own, Zhang's and single features.

- `LOGREG`, `SVM`: the paper's method, a linear classifier of the force and of sigma, with
  balanced classes; `LOGREG_UNWEIGHTED`, `SVM_UNWEIGHTED`: without class weights.
- `LOG_TWO`: the same idea with two features, log F_a and log sigma.
- `LOG_HAND`: the same with a third one, the largest log sigma of all fingers of the hand.
- `ENERGY`: a threshold on the energy of the details of F_a, without their mean taken out.
- `TREES`: boosted trees on the paper's six features, as an upper limit of what they hold.
- `ZHANG`: the energy of the details of the normal force.
- `CUTS`: one feature and one threshold, sigma against energies.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter

import numpy as np

from holdfast.classifiers import recipe
from holdfast.features import DEFAULT_WINDOW, DEPLOYED_FEATURES, FEATURE_NAMES, haar_features
from holdfast.features.haar import check_window
from holdfast.sensors.types import Array
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
CUTS_SOURCE = "for one question of the study: the exact best threshold on one feature, N_w = 14"

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


def detail_sigma(values: Array, window: int = DEFAULT_WINDOW) -> Array:
    r"""Return the paper's sigma of the Haar details over the window that ends at each sample.

        sigma = sqrt(sum (d - mean d)^2 / N_w),        d = (x_0 - x_1) / sqrt(2)

    Args:
        values: (n,) of one unbroken stretch, such as F_a [count or N].
        window: N_w, samples in the window; even.

    Returns:
        (n,) [count or N]; NaN without a full window.

    Example:
        >>> detail_sigma(np.array([1.0, 3.0, 3.0, 2.0]), window=4).round(3).tolist()
        [nan, nan, nan, 0.75]
    """

    def of_windows(windows: Array) -> Array:
        details = (windows[:, 0::2] - windows[:, 1::2]) / np.sqrt(2)
        centred = details - details.mean(axis=1, keepdims=True)
        return np.asarray(np.sqrt((centred**2).sum(axis=1, keepdims=True) / window))

    return windowed(values, window, of_windows)[:, 0]


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
    own = log_force_and_sigma(hand)
    sigmas = {name: rows[:, 1:] for name, rows in own.items()}
    # fmax, not max, because it passes over the NaN of a finger.
    return {
        name: np.hstack([
            rows, np.fmax.reduce(list(latest_rows(hand, sigmas, hand.fingers[name].times)))
        ])
        for name, rows in own.items()
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


def log_feature(
    signal: Callable[[FingerSignal], Array], measure: Callable[[Array], Array], hand: HandSignal
) -> Mapping[str, Array]:
    """Return log10 of a measure of a signal of every finger, (n, 1).

    The logarithm changes no threshold. It keeps probabilities from saturating, so that those of
    several fits can be pooled for an AUC.
    """
    return stretchwise(
        hand,
        lambda finger: np.log10(np.maximum(measure(signal(finger)), MIN_LOG_ARGUMENT))[:, None],
    )


ENERGY = Method(
    "energy", "Haar energy of F_a", "paper", ENERGY_SOURCE,
    partial(log_feature, attrgetter("amplitude"), detail_energy), Threshold("below"),
)  # fmt: skip
CUTS = {
    name: Method(
        name,
        title,
        "vibration",
        CUTS_SOURCE,
        partial(log_feature, attrgetter(signal), measure),
        Threshold("below"),
    )
    for name, title, signal, measure in (
        ("sigma_cut", "sigma of F_a", "amplitude", detail_sigma),
        ("energy_cut", "energy of F_a", "amplitude", detail_energy),
        ("energy_x_cut", "energy of F_x (Zhang)", "normal_force", detail_energy),
    )
}
"""Methods of one feature and one threshold, by name.

The paper states that sigma, the standard deviation of the details, measures instability better
than their energy, because noise adds to the energy. Both are computed here from the same window
of the same signal, so that nothing else differs.
"""
