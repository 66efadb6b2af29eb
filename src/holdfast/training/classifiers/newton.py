"""Newton's method for logistic regression: a few passes over the samples.

The objective of two classes is that of scikit-learn: sum_i s_i log(1 + exp(-t_i z_i)) +
|w|^2 / (2 C), with z = w x + b, t = 1 for stable and -1 for other samples, and s the weight of a
sample's class. With a prior (w_0, b_0) the penalty is (|w - w_0|^2 + (b - b_0)^2) / (2 C). The
objective of more classes is sum_i s_i (log sum_k exp(z_ik) - z_i,class) + sum_k |w_k|^2 / (2 C).
All are strictly convex in w, so the method ends at the same weights; it goes on until no gradient
is left, where scikit-learn stops at 1e-4.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array

Evaluate = Callable[[Array, Array, Array], float]
"""Return the objective at weights, and write its gradient and its Hessian."""

MAX_ITERATIONS = 100
LAST_STEP = 1e-6
"""A step whose parts are smaller is the last: the error after it is about its square."""
PART_PRODUCTS = 1 << 18
"""Multiplications of a matrix product of a part of the samples: OpenBLAS takes one thread for so
few, and the weights do not depend on the number of threads."""
MIN_PART, MAX_PART = 64, 4096
"""Samples of a part at least, and at most: its arrays stay in the cache."""
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
        try:
            step = np.linalg.solve(hessian, gradient)
        except np.linalg.LinAlgError:
            # Classes that are far apart leave the intercept free: the shortest step.
            step = np.linalg.lstsq(hessian, gradient)[0]
        last = bool(np.abs(step).max() < LAST_STEP)
        if not last:
            limit = objective + ROUNDING_RISE * abs(objective)
            objective = evaluate(weights - step, gradient, hessian)
            # Far from the minimum a whole step may overshoot; halved, some step of it goes down.
            while objective > limit and np.abs(step).max() > MIN_STEP:
                step /= 2
                objective = evaluate(weights - step, gradient, hessian)
        weights -= step
        if last:
            break
    return weights


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
    d = features.shape[1]
    gradient[:] = 0.0
    hessian[:] = 0.0
    objective = 0.0
    for part in _parts(features):
        x, is_positive = np.ascontiguousarray(features[part].T), positive[part]
        share = np.where(is_positive, class_weights[1], class_weights[0])
        z = weights[:d] @ x + weights[d]
        margin = np.where(is_positive, z, -z)
        size = np.exp(-np.abs(z))  # of the negative one, which never overflows
        likely = 1.0 / (1.0 + size)  # probability of the sign of z
        unlikely = size * likely
        objective += float(share @ (np.maximum(-margin, 0.0) - np.log(likely)))
        wrong = np.where(margin >= 0.0, unlikely, likely)  # probability of the other class
        slope = np.where(is_positive, -share, share) * wrong
        bend = share * likely * unlikely
        gradient[:d] += x @ slope
        gradient[d] += slope.sum()
        hessian[:d, :d] += (x * bend) @ x.T
        hessian[d, :d] += x @ bend
        hessian[d, d] += bend.sum()
    hessian[:d, d] = hessian[d, :d]
    return objective + _add_penalty(penalty, prior, weights, gradient, hessian)


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

    The weights of a class: one for each feature, then its intercept. Equal shifts of all
    intercepts change no probability: the square of the sum of the intercepts is added, which is
    0 at the minimum.
    """
    n_classes, width = len(class_weights), features.shape[1] + 1
    gradient[:] = 0.0
    hessian[:] = 0.0
    blocks = hessian.reshape(n_classes, width, n_classes, width)
    objective = 0.0
    for part in _parts(features):
        x = np.vstack([features[part].T, np.ones(len(classes[part]))])
        is_class = np.arange(n_classes)[:, None] == classes[part]
        share = class_weights[classes[part]]
        z = weights.reshape(n_classes, width) @ x
        top = z.max(axis=0)  # taken off, so that no exponential overflows
        p = np.exp(z - top)  # p_k = exp(z_k) / sum_l exp(z_l)
        total = p.sum(axis=0)
        p /= total
        objective += float(share @ (np.log(total) + top - (z * is_class).sum(axis=0)))
        gradient += ((share * (p - is_class)) @ x.T).ravel()
        # Of the symmetric Hessian the lower half, which is copied after the last part.
        for k in range(n_classes):
            for m in range(k + 1):
                bend = share * p[k] * ((k == m) - p[m])
                blocks[k, :, m] += (x * bend) @ x.T
    for k in range(n_classes):
        for m in range(k):
            blocks[m, :, k] = blocks[k, :, m].T
    shift = float(weights[width - 1 :: width].sum())
    gradient[width - 1 :: width] += shift
    hessian[width - 1 :: width, width - 1 :: width] += 1.0
    penalties = _add_penalty(penalty, prior, weights, gradient, hessian)
    return objective + 0.5 * shift**2 + penalties


def _parts(features: Array) -> Iterator[slice]:
    """Return parts of the samples, one after the other."""
    n_samples = PART_PRODUCTS // (features.shape[1] + 1) ** 2
    n_samples = min(max(n_samples, MIN_PART), MAX_PART)
    for start in range(0, len(features), n_samples):
        yield slice(start, start + n_samples)


def _add_penalty(
    penalty: Array, prior: Array, weights: Array, gradient: Array, hessian: Array
) -> float:
    """Return sum_a penalty_a (w_a - prior_a)^2 / 2, and add its derivatives."""
    apart = weights - prior
    gradient += penalty * apart
    hessian[np.diag_indices(len(weights))] += penalty
    return float(0.5 * (penalty * apart) @ apart)
