"""Linear classifier of the cause of an unstable contact."""

import math

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers.fitting import standardise
from holdfast.classifiers.newton import fit_multinomial
from holdfast.compiled import joined_step
from holdfast.contact import Cause
from holdfast.errors import ModelError
from holdfast.sensors.types import Array

ALL_CAUSES = tuple(Cause)
"""Causes in the order of their codes, which begin at 1; 0 is no cause."""
SLIP_CODE = ALL_CAUSES.index(Cause.SLIP) + 1
"""Code of the cause slip."""


class CauseClassifier(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Multinomial logistic regression; its answer is the cause with the largest score.

    The score of a cause is intercept + sum_j coefficients_j (phi_j - mean_j) / scale_j. The
    detector adds the scores of the unstable samples since the contact became unstable.

    Attributes:
        causes: between which it decides.
        mean: of each feature in training.
        scale: standard deviation of each feature in training.
        coefficients: of the standardised features, for each cause.
        intercepts: one for each cause.

    Raises:
        ModelError: lengths differ, a cause is given twice, a number is not finite, or a scale is
            not above 0.
    """

    causes: tuple[Cause, ...]
    mean: tuple[float, ...]
    scale: tuple[float, ...]
    coefficients: tuple[tuple[float, ...], ...]
    intercepts: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(set(self.causes)) != len(self.causes) or len(self.causes) < 2:
            raise ModelError(f"two or more different causes expected, {list(self.causes)} given")
        lengths = {len(self.mean), len(self.scale), *map(len, self.coefficients)}
        counts = {len(self.causes), len(self.coefficients), len(self.intercepts)}
        if len(lengths) != 1 or len(counts) != 1:
            raise ModelError("the numbers of means, scales, coefficients and causes do not fit")
        if min(self.scale, default=1.0) <= 0:
            raise ModelError("scales above 0 expected for the causes")
        with np.errstate(over="ignore", invalid="ignore"):
            finite = bool(np.isfinite(self.weights()[self.codes() - 1]).all())
        if not finite:
            raise ModelError("a number of the causes is not finite")

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return len(self.mean)

    def codes(self) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
        """Return the codes of its causes."""
        return np.array([ALL_CAUSES.index(cause) + 1 for cause in self.causes])

    def weights(self) -> Array:
        """Return (n causes in all, n_features + 1) the weights of the raw features.

        The first column is the intercept; it is -infinity for causes that it does not know.
        """
        folded = np.array(self.coefficients) / np.array(self.scale)
        found = np.zeros((len(ALL_CAUSES), self.n_features + 1))
        found[:, 0] = -math.inf
        rows = self.codes() - 1
        found[rows, 0] = np.array(self.intercepts) - folded @ np.array(self.mean)
        found[rows, 1:] = folded
        return found


def fit_causes(features: Array, causes: npt.NDArray[np.str_], c: float) -> CauseClassifier:
    """Fit a classifier of causes to unstable samples; all causes weigh alike.

    Args:
        features: (n, n_features) finite.
        causes: (n,) name of the cause of each sample.
        c: inverse strength of the L2 penalty on the weights of standardised features.
    """
    names, classes, counts = np.unique(causes, return_inverse=True, return_counts=True)
    mean, scale, standardised = standardise(features)
    balanced = len(causes) / (len(names) * counts)
    solution = fit_multinomial(standardised, classes, balanced, c)
    return CauseClassifier(
        causes=tuple(map(Cause, names.tolist())),
        mean=tuple(mean.tolist()),
        scale=tuple(scale.tolist()),
        coefficients=tuple(map(tuple, solution.weights.tolist())),
        intercepts=tuple(solution.intercepts.tolist()),
    )


@joined_step
def add_scores(features: Array, weights: Array, scores: Array) -> int:
    """Add the scores of a sample to the sums. Return the code of the cause with the largest.

    Args:
        features: (n_features,) or more.
        weights: (n_causes, n_features + 1) or wider, as of `CauseClassifier.weights`.
        scores: (n_causes,) sums; is changed.
    """
    best = 0
    for cause in range(len(weights)):
        value = weights[cause, 0]
        for j in range(weights.shape[1] - 1):
            value += weights[cause, j + 1] * features[j]
        scores[cause] += value
        if scores[cause] > scores[best]:
            best = cause
    return best + 1
