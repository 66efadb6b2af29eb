"""Tests that every recipe passes, and tests of each recipe."""

import numpy as np
import pytest
from sklearn.linear_model import LogisticRegression
from sklearn.svm import LinearSVC

from holdfast.errors import TrainingError
from holdfast.training.classifiers import RECIPES, Samples, recipe
from holdfast.training.classifiers.fitting import standardise

WEIGHTS = ["balanced", None]


def samples(n=2000, share=0.5, seed=0, overlap=1.0):
    """Two clouds far from zero, of unlike spread; `share` of the samples are stable."""
    rng = np.random.default_rng(seed)
    stable = rng.random(n) < share
    clouds = rng.normal(size=(n, 3)) * overlap + np.where(stable, 0.7, -0.7)[:, None] * [1, 1, 0]
    return Samples(clouds * [100.0, 0.01, 3.0] + [5000.0, 1.0, 0.0], stable, np.arange(n) % 6)


def parameters(name, weight):
    return {**RECIPES[name].reference, "class_weight": weight}


@pytest.fixture(params=sorted(RECIPES))
def name(request):
    return request.param


def test_an_unknown_name():
    with pytest.raises(ValueError, match="'forest'"):
        recipe("forest")


def test_the_reference_setting(name):
    assert dict(recipe(name).reference) == {"C": 1.0, "class_weight": "balanced"}


@pytest.mark.parametrize("n_stable", [0, 9])
def test_one_class_is_refused(name, n_stable):
    given = Samples(np.ones((9, 3)), np.full(9, n_stable > 0), np.zeros(9, dtype=int))
    with pytest.raises(TrainingError, match="labelled"):
        recipe(name).fit(given, recipe(name).reference, 0)


def test_it_learns(name):
    train, test = samples(seed=0), samples(seed=1)
    fitted = recipe(name).fit(train, recipe(name).reference, 0)
    right = (fitted.probability(test.features) >= fitted.threshold) == test.positive
    assert right.mean() > 0.8


@pytest.mark.slow
def test_units_do_not_matter(name):
    given = samples()
    scaled = given._replace(features=given.features * [1e-3, 1e3, 1.0] + [7.0, 0.0, -2.0])
    one, two = (recipe(name).fit(s, recipe(name).reference, 0) for s in (given, scaled))
    assert one.probability(given.features) == pytest.approx(
        two.probability(scaled.features), abs=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("weight", WEIGHTS)
@pytest.mark.parametrize("share", [0.15, 0.85])
def test_probabilities_are_calibrated(name, weight, share):
    train, test = samples(6000, share, seed=0), samples(6000, share, seed=1)
    fitted = recipe(name).fit(train, parameters(name, weight), 0)
    found = fitted.probability(test.features)
    for low, high in ((0.0, 0.1), (0.1, 0.3), (0.3, 0.7), (0.7, 0.9), (0.9, 1.0)):
        inside = (found >= low) & (found < high)
        if inside.sum() > 200:
            assert test.positive[inside].mean() == pytest.approx(found[inside].mean(), abs=0.08)


@pytest.mark.parametrize("weight", WEIGHTS)
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_logistic_regression_decides_as_scikit_learn(weight, share):
    given = samples(share=share)
    fitted = recipe("logreg").fit(given, parameters("logreg", weight), 0)
    _, _, features = standardise(given.features)
    peer = LogisticRegression(C=1.0, class_weight=weight, tol=1e-10, max_iter=1000)
    peer.fit(features, given.positive)
    decision = peer.decision_function(features)
    assert fitted.rule.decision(given.features) == pytest.approx(decision, abs=1e-3)
    clear = np.abs(decision) > 1e-3
    stable = fitted.probability(given.features) >= fitted.threshold
    assert np.array_equal(stable[clear], peer.predict(features)[clear])


def test_logistic_regression_without_weights_equals_scikit_learn():
    given = samples(share=0.2)
    fitted = recipe("logreg").fit(given, parameters("logreg", None), 0)
    assert (fitted.rule.slope, fitted.rule.offset, fitted.threshold) == (1.0, 0.0, 0.5)


@pytest.mark.parametrize("weight", WEIGHTS)
def test_svm_decides_as_scikit_learn(weight):
    given = samples(share=0.2)
    fitted = recipe("svm").fit(given, parameters("svm", weight), 0)
    _, _, features = standardise(given.features)
    peer = LinearSVC(
        loss="hinge", class_weight=weight, tol=1e-8, max_iter=1_000_000, random_state=1
    )
    decision = peer.fit(features, given.positive).decision_function(features)
    assert fitted.rule.decision(given.features) == pytest.approx(decision, abs=0.05)
    clear = np.abs(decision) > 0.05
    stable = fitted.probability(given.features) >= fitted.threshold
    assert np.array_equal(stable[clear], peer.predict(features)[clear])


@pytest.mark.parametrize("groups", [np.zeros(200, dtype=int), None])
def test_svm_calibrates_where_groups_allow_nothing_else(groups):
    given = samples(200, seed=4)
    groups = given.positive.astype(int) if groups is None else groups
    fitted = recipe("svm").fit(given._replace(groups=groups), RECIPES["svm"].reference, 0)
    assert fitted.probability(given.features).mean() == pytest.approx(
        given.positive.mean(), abs=0.02
    )


def test_svm_probability_rises_with_the_decision_even_where_there_is_nothing_to_learn():
    rng = np.random.default_rng(0)
    given = Samples(rng.normal(size=(300, 2)), rng.random(300) < 0.4, np.arange(300) % 5)
    fitted = recipe("svm").fit(given, RECIPES["svm"].reference, 0)
    assert fitted.rule.slope > 0
    assert fitted.probability(given.features).mean() == pytest.approx(
        given.positive.mean(), abs=0.05
    )
