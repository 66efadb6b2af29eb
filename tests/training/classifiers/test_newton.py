"""Newton's method against scikit-learn at a tolerance that leaves no difference."""

import warnings

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression

from holdfast.training.classifiers.fitting import standardise
from holdfast.training.classifiers.newton import (
    Solution,
    fit_logistic,
    fit_multinomial,
)

from .two_classes import samples


def by_sklearn(features, stable, class_weights, c):
    fit = LogisticRegression(
        C=c,
        class_weight=dict(enumerate(class_weights)),
        solver="newton-cholesky",
        tol=1e-13,
        max_iter=500,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # it goes on as far as rounding lets it
        fit.fit(features, stable)
    return fit.coef_[0], fit.intercept_[0]


@pytest.mark.parametrize("c", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("class_weights", [(1.0, 1.0), (0.6, 3.0)])
@pytest.mark.parametrize("d", [1, 5, 15])
def test_the_weights_are_those_of_scikit_learn(c, class_weights, d):
    features, stable = samples(d=d, share=0.2)
    found = fit_logistic(features, stable, class_weights, c)
    weights, intercept = by_sklearn(features, stable, class_weights, c)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-7, atol=1e-9)
    assert found.intercept == pytest.approx(intercept, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("c", [1.0, 1e4])
def test_classes_that_are_apart_have_finite_weights(c):
    features, stable = samples(shift=30.0)
    found = fit_logistic(features, stable, (1.0, 1.0), c)
    weights, _ = by_sklearn(features, stable, (1.0, 1.0), c)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-4)
    assert (((features @ found.weights + found.intercept) > 0) == stable).all()


def test_one_sample_of_a_class_and_a_constant_feature():
    features, stable = samples()
    stable = np.arange(len(stable)) == 7
    features[:, 2] = 0.0
    found = fit_logistic(features, stable, (1.0, len(stable) - 1.0), 10.0)
    weights, _ = by_sklearn(features, stable, (1.0, len(stable) - 1.0), 10.0)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-5, atol=1e-8)
    assert found.weights[2] == 0.0


@pytest.mark.slow
def test_many_samples_have_a_finite_loss():
    """The product of the probabilities of 100,000 samples is far below the least number."""
    features, stable = samples(n=100_000, shift=0.1)
    found = fit_logistic(features, stable, (1.0, 1.0), 1.0)
    weights, _ = by_sklearn(features, stable, (1.0, 1.0), 1.0)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-7, atol=1e-9)


def classes_of(features, n_classes, seed=0):
    scores = features @ np.random.default_rng(seed).normal(size=(features.shape[1], n_classes))
    return (scores + np.random.default_rng(seed + 1).gumbel(size=scores.shape)).argmax(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("c", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("n_classes", [3, 5])
def test_more_classes_have_the_weights_of_scikit_learn(n_classes, c):
    features, _ = samples(n=900)
    classes = classes_of(features, n_classes)
    class_weights = np.linspace(0.5, 2.0, n_classes)
    found = fit_multinomial(features, classes, class_weights, c)
    peer = LogisticRegression(
        C=c, class_weight=dict(enumerate(class_weights)), tol=1e-12, max_iter=100_000
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        peer.fit(features, classes)
    np.testing.assert_allclose(found.weights, peer.coef_, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found.intercepts, peer.intercept_, rtol=1e-5, atol=1e-5)


def test_two_classes_are_a_case_of_more():
    """Two classes of more have half the weights v each: twice |v/2|^2 / (2 C) = |v|^2 / (4 C)."""
    features, stable = samples()
    alone = fit_logistic(features, stable, (1.0, 2.0), 2.0)
    both = fit_multinomial(features, stable.astype(np.int64), np.array([1.0, 2.0]), 1.0)
    np.testing.assert_allclose(both.weights[1] - both.weights[0], alone.weights, atol=1e-9)
    assert both.intercepts[1] - both.intercepts[0] == pytest.approx(alone.intercept)
    assert both.intercepts.sum() == pytest.approx(0.0, abs=1e-12)


def test_a_prior_is_kept_by_a_strong_penalty_and_forgotten_by_a_weak_one():
    features, stable = samples()
    prior = Solution(np.array([1.0, -2.0, 0.5, 3.0, 0.0]), 4.0)
    kept = fit_logistic(features, stable, (1.0, 1.0), 1e-12, prior)
    np.testing.assert_allclose(kept.weights, prior.weights, atol=1e-8)
    assert kept.intercept == pytest.approx(4.0)
    free = fit_logistic(features, stable, (1.0, 1.0), 1e6)
    forgotten = fit_logistic(features, stable, (1.0, 1.0), 1e6, prior)
    np.testing.assert_allclose(forgotten.weights, free.weights, atol=1e-4)
    assert prior.intercept == 4.0
    np.testing.assert_array_equal(prior.weights, [1.0, -2.0, 0.5, 3.0, 0.0])


def test_standardised_features_have_numpys_bits():
    draw = np.random.default_rng(1)
    features = draw.normal(size=(5000, 6)) * [1, 1e3, 1e-3, 5, 1, 1] + [0, 1e6, 0, 3, 7, 0.1]
    features[:, 5] = 0.1
    mean, scale, standard = standardise(features)
    np.testing.assert_array_equal(mean, features.mean(axis=0))
    np.testing.assert_array_equal(scale[:5], features.std(axis=0)[:5])
    assert scale[5] == 1.0
    np.testing.assert_array_equal(standard, (features - mean) / scale)
