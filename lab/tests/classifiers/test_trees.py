"""Boosted trees."""

import numpy as np
import pytest

from holdfast.errors import TrainingError
from holdfast.training.classifiers import Samples
from holdfast_lab.classifiers.trees import GradientBoosting

RECIPE = GradientBoosting()


def square(n=1500, seed=0, share=1.0):
    """Stable inside a square in the middle: no line separates them. Keep `share` of the stable."""
    rng = np.random.default_rng(seed)
    features = rng.uniform(-1, 1, size=(n, 2))
    stable = (np.abs(features) < 0.7).all(axis=1)
    kept = ~stable | (rng.random(n) < share)
    return Samples(features, stable, np.arange(n) % 5).take(kept)


def fitted(given, seed=0):
    return RECIPE.fit(given, RECIPE.reference, seed)


@pytest.mark.slow
def test_they_learn_classes_that_no_line_separates():
    trees = fitted(square())
    assert trees.n_features == 2
    found = trees.probability([[0.0, 0.0], [0.5, -0.5], [0.9, 0.9], [-0.9, 0.0], [0.0, 0.95]])
    assert (found >= trees.threshold).tolist() == [True, True, False, False, False]
    test = square(seed=1)
    assert ((trees.probability(test.features) >= trees.threshold) == test.positive).mean() > 0.97


def test_nan_features_have_no_probability():
    trees = fitted(square())
    assert np.isnan(trees.probability([[np.nan, 0.0], [0.0, 0.0]])).tolist() == [True, False]
    assert np.isnan(trees.probability([[0.0, np.nan]])).all()
    assert trees.probability(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_balance_moves_the_threshold_and_not_the_probability(share):
    """Where the classes cannot be separated, the probability is the base rate throughout."""
    rng = np.random.default_rng(0)
    stable = rng.random(5000) < 0.5 * share
    given = Samples(rng.integers(2, size=(5000, 1)).astype(float), stable, np.arange(5000) % 5)
    trees = fitted(given)
    rate = stable.mean()
    assert trees.threshold == pytest.approx(rate)
    assert trees.probability([[0.0], [1.0]]) == pytest.approx(rate, abs=0.03)


def test_one_class_is_refused():
    with pytest.raises(TrainingError, match="both classes"):
        fitted(Samples(np.ones((9, 3)), np.ones(9, dtype=bool), np.zeros(9, dtype=int)))
