"""The linear support vector machine by an interior-point method: to the minimum, in few passes.

The objective is that of liblinear: |v|^2 / 2 + sum_i C_i max(0, 1 - y_i v . x_i), where x_i ends
with a 1 for the intercept, y is 1 for stable and -1 for other samples, and C_i is C times the
weight of the class. With z_i = y_i x_i, slacks s_i = z_i . v - 1 + r_i and multipliers a_i, the
minimum has v = sum_i a_i z_i, a_i s_i = 0, (C_i - a_i) r_i = 0 and nothing negative. Newton's
method solves these equations with m in place of 0, while m falls (Mehrotra 1992; Ferris and
Munson 2002, for the support vector machine). A step needs one system of n_features + 1 equations,
whatever the number of samples.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from holdfast.classifiers.newton import Solution
from holdfast.sensors.types import Array

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


def fit_svm(
    features: Array,
    stable: npt.NDArray[np.bool_],
    class_weights: tuple[float, float],
    c: float,
) -> Solution:
    """Fit weights and intercept of a linear support vector machine.

    Args:
        features: (n, n_features), standardised.
        stable: (n,) class.
        class_weights: weight of a sample that is not stable, and of one that is.
        c: inverse strength of the L2 penalty, which the intercept has too, as in liblinear.
    """
    rows = np.column_stack([features, np.ones(len(features))])
    rows *= np.where(stable, 1.0, -1.0)[:, None]
    limits = c * np.where(stable, class_weights[1], class_weights[0])
    point = _start(rows, limits)
    for _ in range(MAX_STEPS):
        if _gap(rows, limits, point) < LAST_GAP:
            break
        point = _next(rows, limits, point)
    return Solution(point.weights[:-1], float(point.weights[-1]))


def _start(rows: Array, limits: Array) -> _Point:
    """Return a point with multipliers of half their limits."""
    multipliers = limits / 2
    weights = np.zeros(rows.shape[1])
    return _Point(weights, np.ones(len(rows)), np.ones(len(rows)), multipliers)


def _gap(rows: Array, limits: Array, point: _Point) -> float:
    """Return (objective - lower bound) / objective; the bound is the dual objective."""
    margins = rows @ point.weights
    objective = point.weights @ point.weights / 2 + limits @ np.maximum(0.0, 1.0 - margins)
    supported = point.multipliers @ rows
    bound = point.multipliers.sum() - supported @ supported / 2
    return float((objective - bound) / objective)


def _next(rows: Array, limits: Array, point: _Point) -> _Point:
    """Return the point after a step of predictor and corrector."""
    upper = limits - point.multipliers
    system = _System(rows, upper, point)
    product = float(point.multipliers @ point.slacks + upper @ point.residuals)
    predicted = system.step(0.0, 0.0)
    ahead = _moved(point, predicted, _longest(upper, point, predicted))
    left = float(ahead.multipliers @ ahead.slacks + (limits - ahead.multipliers) @ ahead.residuals)
    target = (left / product) ** 3 * product / (2 * len(rows))
    corrected = system.step(
        target - predicted.multipliers * predicted.slacks,
        target + predicted.multipliers * predicted.residuals,
    )
    return _moved(point, corrected, STEP_SHARE * _longest(upper, point, corrected))


class _System:
    """Newton's equations at a point, reduced to those of the weights."""

    def __init__(self, rows: Array, upper: Array, point: _Point) -> None:
        self._rows, self._upper, self._point = rows, upper, point
        self._scale = 1.0 / (point.slacks / point.multipliers + point.residuals / upper)
        scaled = rows * np.sqrt(self._scale)[:, None]
        matrix = scaled.T @ scaled
        matrix[np.diag_indices_from(matrix)] += 1.0
        self._factor = cho_factor(matrix)
        self._missing = rows @ point.weights + point.residuals - 1.0 - point.slacks
        self._unsupported = point.multipliers @ rows - point.weights

    def step(self, lower_target: float | Array, upper_target: float | Array) -> _Point:
        """Return the step to a_i s_i = `lower_target` and (C_i - a_i) r_i = `upper_target`."""
        _, slacks, residuals, multipliers = self._point
        ahead = lower_target / multipliers - slacks
        beyond = upper_target / self._upper - residuals
        wanted = ahead - self._missing - beyond
        right = self._unsupported + (self._scale * wanted) @ self._rows
        weights = cho_solve(self._factor, right)
        multiplier_step = self._scale * (wanted - self._rows @ weights)
        return _Point(
            weights,
            ahead - slacks / multipliers * multiplier_step,
            beyond + residuals / self._upper * multiplier_step,
            multiplier_step,
        )


def _longest(upper: Array, point: _Point, step: _Point) -> float:
    """Return the longest part of a step, at most 1, that keeps everything at least 0."""
    pairs = (
        (point.slacks, step.slacks),
        (point.residuals, step.residuals),
        (point.multipliers, step.multipliers),
        (upper, -step.multipliers),
    )
    return min(1.0, *(float((-now[d < 0] / d[d < 0]).min(initial=np.inf)) for now, d in pairs))


def _moved(point: _Point, step: _Point, share: float) -> _Point:
    return _Point(*(now + share * change for now, change in zip(point, step, strict=True)))
