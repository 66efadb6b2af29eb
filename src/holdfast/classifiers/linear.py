"""Linear classifier of standardised features, with a calibrated probability."""

import math

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_step, joined_step
from holdfast.errors import ModelError
from holdfast.sensors.types import Array


class LinearClassifier(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="linear"):
    """Linear classifier, as fitted by logistic regression and the linear SVM.

    The decision value is z = intercept + sum_j coefficients_j (phi_j - mean_j) / scale_j, the
    probability of stability p = 1 / (1 + exp(-(slope z + offset))). A contact is stable if
    p >= threshold.

    Attributes:
        mean: of each feature in training.
        scale: standard deviation of each feature in training.
        coefficients: of the standardised features.
        intercept: of the decision value.
        slope: of the calibration.
        offset: of the calibration.
        threshold: probability from which on a contact is stable.

    Raises:
        ModelError: lengths differ, a number is not finite, a scale or the slope is not above 0, the
            weights overflow, or the threshold is not from 0 to 1.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    coefficients: tuple[float, ...]
    intercept: float
    slope: float = 1.0
    offset: float = 0.0
    threshold: float = 0.5

    def __post_init__(self) -> None:
        lengths = {len(self.mean), len(self.scale), len(self.coefficients)}
        if len(lengths) != 1:
            raise ModelError(
                f"{len(self.mean)} means, {len(self.scale)} scales and "
                f"{len(self.coefficients)} coefficients given; the same number of each expected"
            )
        numbers = (*self.mean, *self.scale, *self.coefficients, self.intercept, self.offset)
        if not all(math.isfinite(number) for number in (*numbers, self.slope)):
            raise ModelError("a number of the classifier is not finite")
        if min((*self.scale, self.slope), default=1.0) <= 0:
            raise ModelError("scales and slope above 0 expected")
        with np.errstate(over="ignore", invalid="ignore"):
            if not np.isfinite(self.weights()).all():
                raise ModelError("the weights of the classifier overflow: a scale is too small")
        if not 0 <= self.threshold <= 1:
            raise ModelError(f"a threshold from 0 to 1 expected, {self.threshold} given")

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return len(self.mean)

    def weights(self) -> Array:
        """Return the weights of the raw features: first the offset, then one weight per feature.

        They contain the scale and the calibration: p = logistic(w_0 + sum_j w_j phi_j).
        """
        folded = np.array(self.coefficients) / np.array(self.scale)
        intercept = self.intercept - float(folded @ np.array(self.mean))
        return np.concatenate([[self.slope * intercept + self.offset], self.slope * folded])

    def decision(self, features: npt.ArrayLike) -> Array:
        """Return the uncalibrated decision value z of each row of (n, n_features).

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        standardised = (rows - np.array(self.mean)) / np.array(self.scale)
        return np.asarray(standardised @ np.array(self.coefficients) + self.intercept)

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return the probability of stability of each row of (n, n_features); NaN if it has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        probabilities = np.empty(len(rows))
        _probabilities(rows, self.weights(), probabilities)
        return probabilities


def feature_rows(features: npt.ArrayLike, n_features: int) -> Array:
    """Return the features as contiguous (n, n_features) float64.

    Raises:
        ValueError: the number of features is not `n_features`.
    """
    rows = np.ascontiguousarray(features, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != n_features:
        raise ValueError(f"features of shape (n, {n_features}) expected, {rows.shape} given")
    return rows


@compiled_step
def log_odds(features: Array, weights: Array) -> float:
    """Return the weighted sum w_0 + sum_j w_j phi_j, for offline and live detection."""
    value = weights[0]
    for j in range(len(weights) - 1):
        value += weights[j + 1] * features[j]
    return float(value)


@joined_step
def linear_probability(features: Array, weights: Array) -> float:
    """Return the logistic function of the weighted sum, for offline and live detection."""
    return 1.0 / (1.0 + math.exp(-log_odds(features, weights)))


@compiled_step
def _probabilities(features: Array, weights: Array, out: Array) -> None:
    for k in range(len(features)):
        out[k] = linear_probability(features[k], weights)
