"""The interior-point method against a general solver, laws of the minimum, and hard samples."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from holdfast.training.classifiers.svm import fit_svm

from .two_classes import samples

WEIGHTS = (1.0, 1.0), (0.6, 3.0)


def signed(features, stable):
    """(n, d + 1) rows y (x, 1)."""
    return np.where(stable, 1.0, -1.0)[:, None] * np.column_stack([features, np.ones(len(stable))])


def limits(stable, class_weights, c):
    return c * np.where(stable, class_weights[1], class_weights[0])


def rule_of(features, stable, class_weights, c):
    found = fit_svm(features, stable, class_weights, c)
    return np.append(found.weights, found.intercept)


def objective(rule, rows, costs):
    return rule @ rule / 2 + costs @ np.maximum(0, 1 - rows @ rule)


def by_dual(rows, costs):
    """The same minimum from the dual problem, which has bounds only."""
    product = rows @ rows.T
    found = minimize(
        lambda a: a @ product @ a / 2 - a.sum(),
        costs / 2,
        jac=lambda a: product @ a - 1.0,
        bounds=[(0.0, c) for c in costs],
        method="L-BFGS-B",
        options={"maxiter": 50_000, "maxfun": 100_000, "ftol": 1e-15, "gtol": 1e-10},
    )
    return found.x @ rows


@pytest.mark.parametrize("c", [1e-5, 1e-2, 1.0])
@pytest.mark.parametrize("class_weights", WEIGHTS)
@pytest.mark.parametrize("d", [1, 4])
def test_the_weights_are_those_of_a_general_solver(c, class_weights, d):
    features, stable = samples(150, d)
    rows, costs = signed(features, stable), limits(stable, class_weights, c)
    found = rule_of(features, stable, class_weights, c)
    np.testing.assert_allclose(found, by_dual(rows, costs), rtol=1e-4, atol=1e-4)


def least_subgradient(rule, rows, costs):
    """The least size of a subgradient at a rule: 0 at the minimum, by a linear programme."""
    margins = rows @ rule
    at_kink = np.abs(margins - 1) < 1e-4
    fixed = rule - costs[margins < 1 - 1e-4] @ rows[margins < 1 - 1e-4]
    kinks, d = rows[at_kink] * costs[at_kink][:, None], len(rule)
    # min t: |fixed - sum_i m_i kinks_i| <= t in every part, with 0 <= m_i <= 1.
    both = np.block([[-kinks.T, -np.ones((d, 1))], [kinks.T, -np.ones((d, 1))]])
    bounds = [(0, 1)] * len(kinks) + [(0, None)]
    cost = np.append(np.zeros(len(kinks)), 1.0)
    return linprog(cost, both, np.append(-fixed, fixed), bounds=bounds).fun


@pytest.mark.parametrize("c", [1e-5, 1.0, 1e3])
@pytest.mark.parametrize("class_weights", WEIGHTS)
@pytest.mark.parametrize("d", [1, 5, 30])
def test_no_direction_descends(c, class_weights, d):
    features, stable = samples(600, d)
    rows, costs = signed(features, stable), limits(stable, class_weights, c)
    rule = rule_of(features, stable, class_weights, c)
    assert least_subgradient(rule, rows, costs) < 1e-4 * max(1.0, costs.sum() / 100)


@pytest.mark.parametrize("c", [1e-5, 1.0, 1e3])
def test_classes_that_are_apart_have_the_widest_margin(c):
    features, stable = samples(shift=30.0)
    rule = rule_of(features, stable, (1.0, 1.0), c)
    rows = signed(features, stable)
    if c >= 1.0:
        assert (rows @ rule).min() == pytest.approx(1.0, abs=1e-3)
    assert objective(rule, rows, limits(stable, (1.0, 1.0), c)) <= objective(
        1.01 * rule, rows, limits(stable, (1.0, 1.0), c)
    )


def test_the_same_samples_in_both_classes_leave_nothing_to_learn():
    features = np.tile(np.random.default_rng(0).normal(size=(50, 3)), (2, 1))
    stable = np.arange(100) < 50
    rule = rule_of(features, stable, (1.0, 1.0), 1e3)
    np.testing.assert_allclose(rule, 0.0, atol=1e-3)
