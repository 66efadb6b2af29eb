"""Newton's method for logistic regression, compiled: a few passes over the samples.

The objective of two classes is that of scikit-learn: sum_i s_i log(1 + exp(-t_i z_i)) +
|w|^2 / (2 C), with z = w x + b, t = 1 for stable and -1 for other samples, and s the weight of a
sample's class. With a prior (w_0, b_0) the penalty is (|w - w_0|^2 + (b - b_0)^2) / (2 C). The
objective of more classes is sum_i s_i (log sum_k exp(z_ik) - z_i,class) + sum_k |w_k|^2 / (2 C).
All are strictly convex in w, so the method ends at the same weights; it goes on until no gradient
is left, where scikit-learn stops at 1e-4.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.sensors.types import Array

Evaluate = Callable[[Array, Array, Array], float]
"""Return the objective at weights, and write its gradient and its Hessian."""

MAX_ITERATIONS = 100
LAST_STEP = 1e-6
"""A step whose parts are smaller is the last: the error after it is about its square."""
MIN_PRODUCT = 1e-100
"""Product of probabilities from which on its logarithm is taken, far above the least number."""
ROUNDING_RISE = 1e-14
"""Relative rise of the objective that is rounding; a step with a larger rise is halved."""
MIN_STEP = 1e-12
"""A step whose parts are smaller is not halved further."""


class Solution(NamedTuple):
    """Weights of the features and intercept."""

    weights: Array
    intercept: float

    def decision(self, features: Array) -> Array:
        """Return w x + b of (n, n_features)."""
        return features @ self.weights + self.intercept


class MultinomialSolution(NamedTuple):
    """Weights (n_classes, n_features) of the features, and intercepts (n_classes,)."""

    weights: Array
    intercepts: Array


def fit_logistic(
    features: Array,
    positive: npt.NDArray[np.bool_],
    class_weights: tuple[float, float],
    c: float,
    prior: Solution | None = None,
) -> Solution:
    """Fit weights and intercept of two classes.

    Args:
        features: (n, n_features), standardised.
        positive: (n,) class.
        class_weights: weight of a sample that is not stable, and of one that is.
        c: inverse strength of the L2 penalty.
        prior: towards which weights and intercept are drawn, and where the search begins; without
            it the weights are drawn towards zero, and the intercept has no penalty.
    """
    total = float(np.where(positive, class_weights[1], class_weights[0]).sum())
    penalty = np.full(features.shape[1] + 1, 1.0 / (c * total))
    if prior is None:
        penalty[-1] = 0.0
        start = np.zeros(len(penalty))
    else:
        start = np.append(prior.weights, prior.intercept)
    shares = (class_weights[0] / total, class_weights[1] / total)

    def evaluate(weights: Array, gradient: Array, hessian: Array) -> float:
        samples = (features, positive, shares)
        return _evaluate(*samples, penalty, start, weights, gradient, hessian)

    weights = _minimise(evaluate, start)
    return Solution(weights[:-1], float(weights[-1]))


def fit_multinomial(
    features: Array, classes: npt.NDArray[np.int64], class_weights: Array, c: float
) -> MultinomialSolution:
    """Fit weights and intercepts of three or more classes.

    Args:
        features: (n, n_features), standardised.
        classes: (n,) index of the class of each sample.
        class_weights: (n_classes,) weight of a sample of each class.
        c: inverse strength of the L2 penalty; the intercepts have none, and the sum 0.
    """
    total = float(class_weights[classes].sum())
    n_classes, n_weights = len(class_weights), features.shape[1] + 1
    penalty = np.full((n_classes, n_weights), 1.0 / (c * total))
    penalty[:, -1] = 0.0
    start = np.zeros(penalty.size)

    def evaluate(weights: Array, gradient: Array, hessian: Array) -> float:
        samples = (features, classes, class_weights / total)
        return _evaluate_multinomial(*samples, penalty.ravel(), start, weights, gradient, hessian)

    weights = _minimise(evaluate, start).reshape(n_classes, n_weights)
    return MultinomialSolution(weights[:, :-1], weights[:, -1])


def _minimise(evaluate: Evaluate, start: Array) -> Array:
    """Return the weights with the least objective, from a start."""
    weights, gradient = start.copy(), np.empty(len(start))
    hessian = np.empty((len(start), len(start)))
    objective = evaluate(weights, gradient, hessian)
    for _ in range(MAX_ITERATIONS):
        step = _step(hessian, gradient)
        last = bool(np.abs(step).max() < LAST_STEP)
        if not last:
            limit = objective + ROUNDING_RISE * abs(objective)
            objective = evaluate(weights - step, gradient, hessian)
            while objective > limit and np.abs(step).max() > MIN_STEP:
                step /= 2
                objective = evaluate(weights - step, gradient, hessian)
        weights -= step
        if last:
            break
    return weights


def _step(hessian: Array, gradient: Array) -> Array:
    """Return Newton's step; the shortest where the classes leave the intercept free."""
    try:
        return np.asarray(np.linalg.solve(hessian, gradient))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(hessian, gradient)[0])


@compiled
def _evaluate(
    features: Array,
    positive: npt.NDArray[np.bool_],
    class_weights: tuple[float, float],
    penalty: Array,
    prior: Array,
    weights: Array,
    gradient: Array,
    hessian: Array,
) -> float:
    """Return the objective, and write its gradient and its Hessian (n_weights, n_weights)."""
    n, d = features.shape
    gradient[:] = 0.0
    hessian[:] = 0.0
    losses = np.zeros(2)
    products = np.ones(2)  # of probabilities; one logarithm for many of them
    for i in range(n):
        z = weights[d]
        for a in range(d):
            z += weights[a] * features[i, a]
        kind = 1 if positive[i] else 0
        size = math.exp(-abs(z))
        likely = 1.0 / (1.0 + size)  # probability of the sign of z
        products[kind] *= likely
        if products[kind] < MIN_PRODUCT:
            losses[kind] -= math.log(products[kind])
            products[kind] = 1.0
        if (z >= 0.0) != positive[i]:
            losses[kind] += abs(z)
        slope = class_weights[kind] * ((likely if z >= 0.0 else size * likely) - kind)
        bend = class_weights[kind] * likely * (size * likely)
        for a in range(d):
            gradient[a] += slope * features[i, a]
            scaled = bend * features[i, a]
            for b in range(a + 1):
                hessian[a, b] += scaled * features[i, b]
            hessian[d, a] += scaled
        gradient[d] += slope
        hessian[d, d] += bend
    objective = 0.0
    for kind in range(2):
        objective += class_weights[kind] * (losses[kind] - math.log(products[kind]))
    return _add_penalty(objective, penalty, prior, weights, gradient, hessian)


@compiled
def _evaluate_multinomial(
    features: Array,
    classes: npt.NDArray[np.int64],
    class_weights: Array,
    penalty: Array,
    prior: Array,
    weights: Array,
    gradient: Array,
    hessian: Array,
) -> float:
    """Return the objective, and write its gradient and its Hessian (n_weights, n_weights).

    The weights of a class are those of the features, then its intercept. Equal shifts of all
    intercepts change no probability: the square of the sum of the intercepts is added, which is
    0 at the minimum.
    """
    n, d = features.shape
    n_classes, width = len(class_weights), d + 1
    gradient[:] = 0.0
    hessian[:] = 0.0
    objective, row, p = 0.0, np.ones(width), np.empty(n_classes)
    for i in range(n):
        row[:d] = features[i]
        for k in range(n_classes):  # z_k, then p_k = exp(z_k) / sum_l exp(z_l)
            p[k] = (row * weights[k * width : (k + 1) * width]).sum()
        top, own, share = p.max(), p[classes[i]], class_weights[classes[i]]
        p[:] = np.exp(p - top)
        total = p.sum()
        p /= total
        objective += share * (math.log(total) + top - own)
        for k in range(n_classes):
            slope = share * (p[k] - (1.0 if k == classes[i] else 0.0))
            for a in range(width):
                gradient[k * width + a] += slope * row[a]
            for m in range(k + 1):
                bend = share * p[k] * ((1.0 if k == m else 0.0) - p[m])
                for a in range(width):
                    for b in range(a + 1 if k == m else width):
                        hessian[k * width + a, m * width + b] += bend * row[a] * row[b]
    shift = weights[d::width].sum()
    objective += 0.5 * shift**2
    gradient[d::width] += shift
    hessian[d::width, d::width] += 1.0
    return _add_penalty(objective, penalty, prior, weights, gradient, hessian)


@compiled
def _add_penalty(
    objective: float, penalty: Array, prior: Array, weights: Array, gradient: Array, hessian: Array
) -> float:
    """Add sum_a penalty_a (w_a - prior_a)^2 / 2, and mirror the Hessian's lower triangle."""
    for a in range(len(weights)):
        objective += 0.5 * penalty[a] * (weights[a] - prior[a]) ** 2
        gradient[a] += penalty[a] * (weights[a] - prior[a])
        hessian[a, a] += penalty[a]
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return objective
