"""The choice of parameters on the grid."""

import numpy as np
import pytest

from holdfast.training.classifiers import Samples, recipe
from holdfast.training.parameter_grid import GRID, choose_parameters
from holdfast.training.splits import inner_folds

pytestmark = pytest.mark.slow


def blobs(seed=0, n=240, n_groups=6):
    """Two overlapping clouds; groups are shifted against each other."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(n_groups), n // n_groups)
    stable = rng.random(n) < 0.4
    features = (
        rng.normal(size=(n, 3)) + 0.8 * stable[:, None] + rng.normal(size=(n_groups, 3))[groups]
    )
    return Samples(features, stable, groups)


def chosen(name, samples):
    return choose_parameters(samples, inner_folds(samples, 3, 0), recipe(name), 0)


def slow_loss(name, parameters, samples):
    """Return the loss by its definition, sample by sample."""
    losses = []
    for held in inner_folds(samples, 3, 0):
        fit = recipe(name).fit(samples.take(~held), parameters, 0)
        for row, stable in zip(samples.features[held], samples.positive[held], strict=True):
            (p,) = fit.probability(row[None])
            wrong = (p >= fit.threshold) != stable
            losses.append(wrong if name == "svm" else -np.log(p if stable else 1 - p))
    return np.mean(losses)


@pytest.mark.parametrize("name", ["logreg", "svm"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_best_of_the_grid_is_taken(name, seed):
    samples = blobs(seed)
    losses = [slow_loss(name, parameters, samples) for parameters in GRID]
    assert len(set(losses)) > 3
    assert chosen(name, samples) == GRID[int(np.argmin(losses))]


def test_the_reference_setting_is_on_the_grid():
    assert recipe("logreg").reference in GRID
    assert recipe("svm").reference in GRID


def test_no_fit_sees_the_group_that_it_is_scored_on():
    fitted = []

    class Spy:
        reference = GRID[0]

        def fit(self, samples, parameters, seed):
            fitted.append(samples)
            return recipe("logreg").fit(samples, parameters, seed)

    samples = blobs()
    choose_parameters(samples, inner_folds(samples, 3, 0), Spy(), 0)
    every = set(range(6))
    left_out = [every - set(part.groups) for part in fitted]
    assert [len(groups) for groups in left_out] == [2] * 3 * len(GRID)
    assert set.union(*left_out[:3]) == every
