"""The linear support vector machine, by an interior-point method: to the minimum, in few passes.

The objective is that of liblinear: |v|^2 / 2 + sum_i C_i max(0, 1 - y_i v . x_i), where x_i ends
with a 1 for the intercept, y is 1 for stable and -1 for other samples, and C_i is C times the
weight of the class. With z_i = y_i x_i, slacks s_i = z_i . v - 1 + r_i and multipliers a_i, the
minimum has v = sum_i a_i z_i, a_i s_i = 0, (C_i - a_i) r_i = 0 and nothing negative. Newton's
method solves these equations with m in place of 0, while m falls (Mehrotra 1992; Ferris and
Munson 2002, for the support vector machine). A step needs one system of n_features + 1 equations,
whatever the number of samples.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.detection.heads import Linear
from holdfast.sensors.types import Array
from holdfast.training.classifiers.fitting import (
    Fitted,
    Parameters,
    Samples,
    check_classes,
    class_weights,
    logistic,
    sigmoid,
    standardise,
)
from holdfast.training.classifiers.folds import group_folds
from holdfast.training.classifiers.newton import Solution

SIGMOID_FOLDS = 5
"""Folds, by group, whose held-out decision values the sigmoid is fitted to."""


@dataclass(frozen=True)
class LinearSVM:
    """Linear SVM on standardised features: L2 penalty, hinge loss, a sigmoid for the probability.

    The loss is max(0, 1 - y z), as in MATLAB's toolbox, which the paper used. The sigmoid is
    fitted, without class weights, to decision values out of fold where the groups allow it,
    else to those of the training samples (Platt 1999).
    """

    reference: Parameters = field(default_factory=lambda: {"C": 1.0, "class_weight": "balanced"})

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """Fit the classifier to the samples, to the minimum of its loss; the seed is not used.

        Raises:
            TrainingError: the samples have only one class.
        """
        del seed
        check_classes(samples)
        mean, scale, features = standardise(samples.features)
        # Not by scikit-learn's LinearSVC: with the C of a search (up to 1e3) its coordinate descent
        # had not ended after 300,000 passes, the weights 2 to 7 % off and decisions changed.
        solution = _fit(features, samples.positive, parameters)
        values = _values_out_of_fold(samples._replace(features=features), parameters)
        if values is None:
            values = solution.decision(features)
        slope, offset = sigmoid(values, samples.positive)
        rule = Linear.of(
            mean, scale, solution.weights, solution.intercept, slope=slope, offset=offset
        )
        return Fitted(rule, logistic(offset))


def _fit(
    features: npt.NDArray[np.float64], positive: npt.NDArray[np.bool_], parameters: Parameters
) -> Solution:
    weights = class_weights(positive, parameters["class_weight"])
    return fit_svm(features, positive, weights, parameters["C"])


def _values_out_of_fold(samples: Samples, parameters: Parameters) -> npt.NDArray[np.float64] | None:
    """Compute decision values out of fold by group; None if a fold lacks a class."""
    features, positive, groups = samples
    left_out = group_folds(groups, SIGMOID_FOLDS)
    if len(left_out) < 2 or any(samples.take(~rows).one_class for rows in left_out):
        return None
    values = np.empty(len(positive))
    for rows in left_out:
        values[rows] = _fit(features[~rows], positive[~rows], parameters).decision(features[rows])
    return values


MAX_STEPS = 500
"""Usual are 15 to 45 steps; classes that are far apart, with a large C, need up to 150."""
LAST_GAP = 1e-9
"""Difference of the objective from a lower bound of it, relative, at which the search ends."""
STEP_SHARE = 0.995
"""Share of the longest step that keeps everything positive."""


class _Point(NamedTuple):
    """Weights v, and slacks s, residuals r and multipliers a of each sample; or a step of them."""

    weights: Array
    slacks: Array
    residuals: Array
    multipliers: Array

    def moved(self, step: "_Point", share: float) -> "_Point":
        """Return the point after a share of a step."""
        return _Point(*(now + share * change for now, change in zip(self, step, strict=True)))


def fit_svm(
    features: Array,
    positive: npt.NDArray[np.bool_],
    class_weights: tuple[float, float],
    c: float,
) -> Solution:
    """Fit weights and intercept of a linear support vector machine.

    Args:
        features: (n, n_features), standardised.
        positive: (n,) class.
        class_weights: weight of a sample that is not stable, and of one that is.
        c: inverse strength of the L2 penalty, which the intercept has too, as in liblinear.
    """
    columns = np.vstack([features.T, np.ones(len(features))])
    columns *= np.where(positive, 1.0, -1.0)
    limits = c * np.where(positive, class_weights[1], class_weights[0])
    ones = np.ones(len(limits))
    point = _Point(np.zeros(len(columns)), ones, ones, limits / 2)  # far from every bound
    for _ in range(MAX_STEPS):
        margins, supported = point.weights @ columns, columns @ point.multipliers
        # The dual objective is a lower bound, from any multipliers within their limits.
        objective = point.weights @ point.weights / 2 + limits @ np.maximum(0.0, 1.0 - margins)
        bound = point.multipliers.sum() - supported @ supported / 2
        if float((objective - bound) / objective) < LAST_GAP:
            break
        point = _System(columns, limits, point, margins, supported).next_point()
    return Solution(point.weights[:-1], float(point.weights[-1]))


class _System:
    """Newton's equations at a point, reduced to the equations of the weights.

    Args:
        columns: (n_features + 1, n) vectors z_i.
        limits: (n,) largest multiplier of each sample.
        point: of the step.
        margins: (n,) z_i . v.
        supported: (n_features + 1,) sum_i a_i z_i.
    """

    def __init__(
        self, columns: Array, limits: Array, point: _Point, margins: Array, supported: Array
    ) -> None:
        from scipy.linalg import cho_factor

        self.point = point
        self.upper = limits - point.multipliers
        self._columns = columns
        self._scale = 1.0 / (point.slacks / point.multipliers + point.residuals / self.upper)
        scaled = columns * np.sqrt(self._scale)
        matrix = scaled @ scaled.T
        matrix[np.diag_indices_from(matrix)] += 1.0
        self._factor = cho_factor(matrix)
        self._missing = margins + point.residuals - 1.0 - point.slacks
        self._unsupported = supported - point.weights

    def next_point(self) -> _Point:
        """Return the point after a step of predictor and corrector."""
        product = self.product()
        predicted = self.step(0.0, 0.0)
        left = self.product(predicted, self.longest(predicted))
        # The better the predicted step, the smaller the target of the corrected one (Mehrotra's
        # cube). The corrected step takes back the products that the predicted one neglects.
        target = (left / product) ** 3 * product / (2 * len(self.upper))
        corrected = self.step(
            target - predicted.multipliers * predicted.slacks,
            target + predicted.multipliers * predicted.residuals,
        )
        return self.point.moved(corrected, STEP_SHARE * self.longest(corrected))

    def step(self, lower_target: float | Array, upper_target: float | Array) -> _Point:
        """Return the step to a_i s_i = `lower_target` and (C_i - a_i) r_i = `upper_target`."""
        from scipy.linalg import cho_solve

        _, slacks, residuals, multipliers = self.point
        ahead = lower_target / multipliers - slacks
        beyond = upper_target / self.upper - residuals
        wanted = ahead - self._missing - beyond
        right = self._unsupported + self._columns @ (self._scale * wanted)
        weights = cho_solve(self._factor, right)
        multiplier_step = self._scale * (wanted - weights @ self._columns)
        return _Point(
            weights,
            ahead - slacks / multipliers * multiplier_step,
            beyond + residuals / self.upper * multiplier_step,
            multiplier_step,
        )

    def product(self, step: _Point | None = None, share: float = 0.0) -> float:
        """Return the sum of all a_i s_i and (C_i - a_i) r_i, after a share of a step."""
        point, upper = self.point, self.upper
        if step is not None:
            point, upper = point.moved(step, share), upper - share * step.multipliers
        return float(point.multipliers @ point.slacks + upper @ point.residuals)

    def longest(self, step: _Point) -> float:
        """Return the longest share of a step, at most 1, that keeps everything at least 0."""
        return 1.0 / max(
            1.0,
            float((-step.slacks / self.point.slacks).max()),
            float((-step.residuals / self.point.residuals).max()),
            float((-step.multipliers / self.point.multipliers).max()),
            float((step.multipliers / self.upper).max()),
        )
