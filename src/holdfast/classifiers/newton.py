"""Newton's method for logistic regression, compiled: a few passes over the samples.

The objective is that of scikit-learn: sum_i s_i log(1 + exp(-t_i z_i)) + |w|^2 / (2 C), with
z = w x + b, t = 1 for stable and -1 for other samples, and s the weight of a sample's class. It
is strictly convex in w, so the method ends at the same weights; it goes on until no gradient is
left, where scikit-learn stops at 1e-4.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled

Array = npt.NDArray[np.float64]

MAX_ITERATIONS = 100
LAST_STEP = 1e-6
"""A step whose parts are smaller is the last: the error after it is about its square."""
MIN_PRODUCT = 1e-100
"""Product of probabilities from which on its logarithm is taken, far above the least number."""
ROUNDING = 1e-14
"""Relative rise of the objective that is rounding; a step with a larger rise is halved."""
MIN_STEP = 1e-12
"""A step whose parts are smaller is not halved further."""


class Solution(NamedTuple):
    """Weights of the features and intercept."""

    weights: Array
    intercept: float


def fit_weights(
    features: Array, stable: npt.NDArray[np.bool_], class_weights: tuple[float, float], c: float
) -> Solution:
    """Fit weights and intercept.

    Args:
        features: (n, n_features), standardised.
        stable: (n,) class.
        class_weights: weight of a sample that is not stable, and of one that is.
        c: inverse strength of the L2 penalty; the intercept has none.
    """
    n_weights = features.shape[1] + 1
    total = float(np.where(stable, class_weights[1], class_weights[0]).sum())
    penalty = np.full(n_weights, 1.0 / (c * total))
    penalty[-1] = 0.0
    given = (features, stable, (class_weights[0] / total, class_weights[1] / total), penalty)
    weights, gradient = np.zeros(n_weights), np.empty(n_weights)
    hessian = np.empty((n_weights, n_weights))
    objective: float = _evaluate(*given, weights, gradient, hessian)
    for _ in range(MAX_ITERATIONS):
        step = _step(hessian, gradient)
        last = bool(np.abs(step).max() < LAST_STEP)
        if not last:
            limit = objective + ROUNDING * abs(objective)
            objective = _evaluate(*given, weights - step, gradient, hessian)
            while objective > limit and np.abs(step).max() > MIN_STEP:
                step /= 2
                objective = _evaluate(*given, weights - step, gradient, hessian)
        weights -= step
        if last:
            break
    return Solution(weights[:-1], float(weights[-1]))


def _step(hessian: Array, gradient: Array) -> Array:
    """Return Newton's step; the shortest where the classes leave the intercept free."""
    try:
        return np.asarray(np.linalg.solve(hessian, gradient))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(hessian, gradient)[0])


@compiled
def _evaluate(
    features: Array,
    stable: npt.NDArray[np.bool_],
    class_weights: tuple[float, float],
    penalty: Array,
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
        kind = 1 if stable[i] else 0
        size = math.exp(-abs(z))
        likely = 1.0 / (1.0 + size)  # probability of the sign of z
        products[kind] *= likely
        if products[kind] < MIN_PRODUCT:
            losses[kind] -= math.log(products[kind])
            products[kind] = 1.0
        if (z >= 0.0) != stable[i]:
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
    for a in range(d + 1):
        objective += 0.5 * penalty[a] * weights[a] ** 2
        gradient[a] += penalty[a] * weights[a]
        hessian[a, a] += penalty[a]
        for b in range(a):
            hessian[b, a] = hessian[a, b]
    return objective
