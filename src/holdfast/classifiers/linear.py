"""Linear functions of standardised features and of their squares, and what heads make of them."""

import math
from typing import Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_step, joined_step
from holdfast.errors import ModelError
from holdfast.sensors.types import Array

MAX_DEVIATION = 5.0
"""Squares are of values of at most this many standard deviations: a larger one is no stronger sign
of a slip, nor of a glitch."""


class Linear(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="linear"):
    """Linear function of standardised features, with one value for each output.

    With the standardised features u_j = (phi_j - mean_j) / scale_j, output k has the value

        z_k = slope (intercept_k + sum_j weight_kj u_j + sum_j square_kj min(|u_j|, 5)^2) + offset

    A moderate jolt of the taxels is a slip, a huge one a glitch: so the squares are bounded.

    Attributes:
        mean: of each feature in training.
        scale: standard deviation of each feature in training.
        weights: of the standardised features, one row for each output.
        intercepts: one for each output.
        squares: weights of the squares, one row for each output; empty for none.
        slope: of the calibration of z.
        offset: of the calibration of z.

    Raises:
        ModelError: lengths differ, a number is not finite, a scale or the slope is not above 0, or
            the weights overflow.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[tuple[float, ...], ...]
    intercepts: tuple[float, ...]
    squares: tuple[tuple[float, ...], ...] = ()
    slope: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        rows = (self.mean, self.scale, *self.weights, *self.squares)
        if len(set(map(len, rows))) != 1:
            widths = ", ".join(str(len(row)) for row in rows)
            raise ModelError(
                f"means, scales and rows of weights and squares of {widths} features given; the "
                "same number of each expected"
            )
        heights = {len(self.weights), len(self.intercepts), len(self.squares or self.weights)}
        if len(heights) != 1 or 0 in heights:
            raise ModelError(
                f"{len(self.weights)} rows of weights, {len(self.intercepts)} intercepts and "
                f"{len(self.squares)} rows of squares given; one of each for every output expected"
            )
        if min((*self.scale, self.slope)) <= 0:
            raise ModelError("scales and slope above 0 expected")
        with np.errstate(over="ignore", invalid="ignore"):
            numbers = (*self.mean, *self.raw_weights().ravel(), *self.raw_squares().ravel())
        if not np.isfinite(numbers).all():
            raise ModelError("a number of the weights is not finite, or a scale is too small")

    @classmethod
    def of(
        cls,
        mean: Array,
        scale: Array,
        weights: Array,
        intercepts: npt.ArrayLike,
        squares: Array | None = None,
        **calibration: float,
    ) -> Self:
        """Return the function of arrays; `weights` and `squares` of one output may be (n,)."""
        rows = () if squares is None else np.atleast_2d(squares).tolist()
        return cls(
            tuple(mean.tolist()),
            tuple(scale.tolist()),
            tuple(map(tuple, np.atleast_2d(weights).tolist())),
            tuple(np.atleast_1d(intercepts).tolist()),
            tuple(map(tuple, rows)),
            **calibration,
        )

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return len(self.mean)

    @property
    def n_outputs(self) -> int:
        """Number of values that it returns."""
        return len(self.intercepts)

    @property
    def moments(self) -> tuple[Array, Array]:
        """Mean and scale of each feature, (n_features,) each."""
        return np.array(self.mean), np.array(self.scale)

    def raw_weights(self) -> Array:
        """Return (n_outputs, n_features + 1) the offset, then the weights of the raw features.

        They contain the scale and the calibration: z = w_0 + sum_j w_j phi_j, without squares.
        """
        folded = np.array(self.weights) / np.array(self.scale)
        shifts = [float(row @ np.array(self.mean)) for row in folded]
        offsets = self.slope * (np.array(self.intercepts) - shifts) + self.offset
        return np.column_stack([offsets, self.slope * folded])

    def raw_squares(self) -> Array:
        """Return (3, n_features) mean, 1 / scale and weight of the squares of the first output."""
        squares = np.array(self.squares[0]) if self.squares else np.zeros(self.n_features)
        return np.array([self.mean, 1.0 / np.array(self.scale), self.slope * squares])

    def decision(self, features: npt.ArrayLike) -> Array:
        """Return the first output of each row before calibration, without squares.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        standardised = (rows - np.array(self.mean)) / np.array(self.scale)
        return np.asarray(standardised @ np.array(self.weights[0]) + self.intercepts[0])

    def probability(self, features: npt.ArrayLike) -> Array:
        """Return 1 / (1 + exp(-z)) of each row of (n, n_features), without squares.

        It is NaN if the row has NaN.

        Raises:
            ValueError: the number of features is not `n_features`.
        """
        rows = feature_rows(features, self.n_features)
        weights = self.raw_weights()[0]
        with np.errstate(over="ignore"):  # 1 / (1 + infinity) is 0
            return np.asarray(1.0 / (1.0 + np.exp(-(weights[0] + rows @ weights[1:]))))


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


@joined_step
def add_squares(value: float, features: Array, squares: Array) -> float:
    """Return log odds with the squares of standardised features.

    Args:
        value: log odds without them.
        features: (n_features,) or more.
        squares: (3, n_features) as of `Linear.raw_squares`.
    """
    # z + sum_j q_j min(|u_j|, 5)^2, u_j = (phi_j - mean_j) / scale_j.
    for j in range(squares.shape[1]):
        deviation = abs((features[j] - squares[0, j]) * squares[1, j])
        deviation = min(deviation, MAX_DEVIATION)
        value += squares[2, j] * (deviation * deviation)
    return value


@joined_step
def add_scores(features: Array, weights: Array, scores: Array) -> int:
    """Add the scores of a sample to the sums. Return the code of the cause with the largest.

    Args:
        features: (n_features,) or more.
        weights: (n_causes, n_features + 1) or wider, as of `Linear.raw_weights`.
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


@compiled_step
def smooth(smoothed: float, value: float, gain: float) -> float:
    """Return the smoothed value after a new one; the first value starts it."""
    return value if math.isnan(smoothed) else smoothed + gain * (value - smoothed)


@compiled_step
def probability_of(log_odds: float) -> float:
    """Return 1 / (1 + exp(-log odds))."""
    return 1.0 / (1.0 + math.exp(-log_odds))


@compiled_step
def speed_of(value: float, highest: float) -> float:
    """Return the speed of a slip min(max(z, 0)^2, highest) [mm/s]."""
    root = max(value, 0.0)
    return min(root * root, highest)
