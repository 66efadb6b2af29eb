"""Interfaces and functions that all recipes share: samples, classifiers, calibration."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from holdfast.detection.heads import Linear
from holdfast.errors import TrainingError

Parameters = Mapping[str, Any]

MIN_SLOPE = 1e-6
"""Minimum slope of a sigmoid: its probability rises, but is nearly the base rate."""


class Samples(NamedTuple):
    """Training samples of one classifier.

    Attributes:
        features: (n, n_features) finite.
        positive: (n,) True in the class that is counted: of a head, what it answers yes to.
        groups: (n,) index of the recording, or object, of each sample.
    """

    features: npt.NDArray[np.float64]
    positive: npt.NDArray[np.bool_]
    groups: npt.NDArray[np.int64]

    def take(self, rows: npt.NDArray[np.bool_]) -> "Samples":
        """Return the samples where `rows` is True."""
        return Samples(self.features[rows], self.positive[rows], self.groups[rows])

    @property
    def one_class(self) -> bool:
        """Whether all labels are the same, or there are no samples."""
        return not self.positive.any() or bool(self.positive.all())


class Fitted(NamedTuple):
    """Classifier of two classes that a model file can store.

    Attributes:
        rule: of its probability.
        threshold: probability from which on a sample is of class 1.
    """

    rule: Linear
    threshold: float = 0.5

    @property
    def n_features(self) -> int:
        """Number of features of its input."""
        return self.rule.n_features

    def probability(self, features: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the probability of class 1 of each row of (n, n_features); NaN if it has NaN."""
        return self.rule.probability(features)


class Recipe(Protocol):
    """Way of fitting a classifier that a model file can store."""

    @property
    def reference(self) -> Parameters:
        """Reference parameters."""
        ...

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """Fit a classifier with a calibrated probability to the samples."""
        ...


def standardise(features: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Return mean and scale of each feature, and the features standardised by them."""
    # einsum sums as `sum(axis=0)` does, in a quarter of the time
    rows = np.ascontiguousarray(features, dtype=np.float64)
    mean = np.einsum("ij->j", rows) / len(rows)
    standard = rows - mean
    scale = np.sqrt(np.einsum("ij,ij->j", standard, standard) / len(rows))
    constant = [(column == column[0]).all() for column in rows.T]
    scale[constant] = 1.0  # rounding can give a spread of 1e-17
    standard /= scale
    return mean, scale, standard


def check_classes(samples: Samples) -> None:
    """Check that the samples have both classes.

    Raises:
        TrainingError: they have only one class.
    """
    if samples.one_class:
        n_positive = int(samples.positive.sum())
        n_negative = len(samples.positive) - n_positive
        raise TrainingError(
            f"{n_positive} samples labelled stable and {n_negative} labelled not stable given; "
            "both classes are needed to train"
        )


def class_ratio(positive: npt.NDArray[np.bool_]) -> float:
    """Return n_0 / n_1, the factor by which balanced classes multiply the odds of stability."""
    n_positive = int(positive.sum())
    return (len(positive) - n_positive) / n_positive


def class_weights(positive: npt.NDArray[np.bool_], class_weight: str | None) -> tuple[float, float]:
    """Return the weight of a sample that is not stable, and of one that is.

    Args:
        positive: (n,) class.
        class_weight: `balanced` for n / (2 n_0) and n / (2 n_1); None for 1 and 1.
    """
    if class_weight != "balanced":
        return 1.0, 1.0
    n, n_positive = len(positive), int(positive.sum())
    return n / (2 * (n - n_positive)), n / (2 * n_positive)


def logistic(value: float) -> float:
    """Return 1 / (1 + exp(-value)), by the exponential of the C library; at least 1e-308."""
    return 1.0 / (1.0 + math.exp(min(-value, 709.0)))


def sigmoid(
    values: npt.NDArray[np.float64], positive: npt.NDArray[np.bool_]
) -> tuple[float, float]:
    """Fit a logistic function of the values to the classes; return its slope and offset.

    The slope is above 0. If the fitted slope is not, the offset follows from the base rate. The fit
    is scikit-learn's, which the SVM needs anyway: Newton's method goes on for longer, and would
    change the slope of every SVM by about 0.05 %.
    """
    from sklearn.linear_model import LogisticRegression

    # Divided by their spread, so that the penalty of C is small whatever the scale of the values.
    spread = float(values.std()) or 1.0
    fit = LogisticRegression(C=1e6, max_iter=1000).fit(values[:, None] / spread, positive)
    slope = float(fit.coef_[0, 0]) / spread
    if slope < MIN_SLOPE:
        return MIN_SLOPE, -float(np.log(class_ratio(positive)))
    return slope, float(fit.intercept_[0])
