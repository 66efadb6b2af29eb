"""Newton's method against scikit-learn at a tolerance that leaves no difference."""

import warnings

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import LogisticRegression

from holdfast.classifiers.fitting import standardise
from holdfast.classifiers.newton import fit_weights


def samples(n=600, d=5, shift=1.0, share=0.5, seed=0):
    draw = np.random.default_rng(seed)
    stable = draw.random(n) < share
    features = draw.normal(size=(n, d)) @ draw.normal(size=(d, d))
    features += shift * stable[:, None] * draw.normal(size=d)
    return standardise(features)[2], stable


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
    found = fit_weights(features, stable, class_weights, c)
    weights, intercept = by_sklearn(features, stable, class_weights, c)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-7, atol=1e-9)
    assert found.intercept == pytest.approx(intercept, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("c", [1.0, 1e4])
def test_classes_that_are_apart_have_finite_weights(c):
    features, stable = samples(shift=30.0)
    found = fit_weights(features, stable, (1.0, 1.0), c)
    weights, _ = by_sklearn(features, stable, (1.0, 1.0), c)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-4)
    assert (((features @ found.weights + found.intercept) > 0) == stable).all()


def test_one_sample_of_a_class_and_a_constant_feature():
    features, stable = samples()
    stable = np.arange(len(stable)) == 7
    features[:, 2] = 0.0
    found = fit_weights(features, stable, (1.0, len(stable) - 1.0), 10.0)
    weights, _ = by_sklearn(features, stable, (1.0, len(stable) - 1.0), 10.0)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-5, atol=1e-8)
    assert found.weights[2] == 0.0


def test_many_samples_have_a_finite_loss():
    """The product of the probabilities of 100,000 samples is far below the least number."""
    features, stable = samples(n=100_000, shift=0.1)
    found = fit_weights(features, stable, (1.0, 1.0), 1.0)
    weights, _ = by_sklearn(features, stable, (1.0, 1.0), 1.0)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-7, atol=1e-9)


def test_standardised_features_have_numpys_bits():
    draw = np.random.default_rng(1)
    features = draw.normal(size=(5000, 6)) * [1, 1e3, 1e-3, 5, 1, 1] + [0, 1e6, 0, 3, 7, 0.1]
    features[:, 5] = 0.1
    mean, scale, standard = standardise(features)
    np.testing.assert_array_equal(mean, features.mean(axis=0))
    np.testing.assert_array_equal(scale[:5], features.std(axis=0)[:5])
    assert scale[5] == 1.0
    np.testing.assert_array_equal(standard, (features - mean) / scale)
