"""Logistic regression between the prior and the samples."""

import msgspec
import numpy as np
import pytest
from scipy.optimize import approx_fprime
from sklearn.linear_model import LogisticRegression

from holdfast.detection import Linear
from holdfast.errors import TrainingError
from holdfast.training.classifiers.logreg import CALIBRATION, NONE, WEIGHTS, Adapted

from .test_recipes import samples

PRIOR = Linear(
    mean=(5010.0, 1.01, 0.3),
    scale=(90.0, 0.02, 2.0),
    weights=((0.2, -0.4, 1.5),),
    intercepts=(0.6,),
)
UNLIKE = msgspec.structs.replace(PRIOR, slope=2.5, offset=-0.7)
"""A calibration of its own."""
THRESHOLDS = {PRIOR: 0.5, UNLIKE: 0.2}

GIVEN = samples(600, share=0.3)


def adapted(C, given=GIVEN, prior=PRIOR, change=WEIGHTS):
    fitted = Adapted(prior, THRESHOLDS.get(prior, 0.5)).fit(given, {"change": change, "C": C}, 0)
    assert fitted.threshold == THRESHOLDS.get(prior, 0.5)
    return fitted.rule


def decided(rule, given=GIVEN, threshold=0.5):
    return rule.probability(given.features) >= threshold


def rule_of(rule):
    return np.array([*rule.intercepts, *rule.weights[0]])


def loss(v, rows, stable, known, C):
    """The loss of the docstring, written out."""
    signs = np.where(stable, 1.0, -1.0)
    return ((v - known) ** 2).sum() / 2 + C * np.log1p(np.exp(-signs * (rows @ v))).sum()


@pytest.mark.parametrize("C", [1e-4, 0.7, 100.0])
@pytest.mark.parametrize("prior", [PRIOR, UNLIKE])
def test_the_weights_have_the_least_loss_of_the_docstring(prior, C):
    scaled = (GIVEN.features - np.array(prior.mean)) / np.array(prior.scale)
    rows = np.column_stack([np.ones(len(scaled)), scaled])
    known = prior.slope * rule_of(prior)
    known[0] += prior.offset
    given = (rows, GIVEN.positive, known, C)
    found = rule_of(adapted(C, prior=prior))
    slope = approx_fprime(found, lambda v: loss(v, *given), 1e-6)
    assert slope == pytest.approx(np.zeros(4), abs=2e-3 * (1 + C))
    for step in 1e-3 * np.vstack([np.eye(4), -np.eye(4)]):
        assert loss(found + step, *given) > loss(found, *given)


def test_without_a_change_the_prior_is_returned():
    assert adapted(1.0, prior=UNLIKE, change=NONE) == UNLIKE
    one_class = GIVEN._replace(positive=np.ones(600, dtype=bool))
    assert adapted(1.0, one_class, UNLIKE, NONE) == UNLIKE


def test_the_calibration_is_that_of_scikit_learn_on_the_log_odds():
    p = UNLIKE.probability(GIVEN.features)
    odds = np.log(p / (1 - p))[:, None]
    peer = LogisticRegression(C=1e6, tol=1e-10, max_iter=1000).fit(odds, GIVEN.positive)
    found = adapted(1e6, prior=UNLIKE, change=CALIBRATION)
    expected = peer.predict_proba(odds)[:, 1]
    assert found.probability(GIVEN.features) == pytest.approx(expected, abs=1e-4)
    assert found.weights == UNLIKE.weights


def test_a_prior_that_is_upside_down_loses_its_slope():
    """A calibration does not turn the order of the samples round."""
    flipped = msgspec.structs.replace(PRIOR, weights=((-0.2, 0.4, -1.5),))
    given = samples(600, share=0.3)
    other = given._replace(positive=~decided(flipped, given))
    found = adapted(1e3, other, flipped, CALIBRATION)
    assert found.slope == pytest.approx(1e-6)


@pytest.mark.parametrize("prior", [PRIOR, UNLIKE])
def test_with_a_large_c_it_equals_scikit_learn(prior):
    scaled = (GIVEN.features - np.array(prior.mean)) / np.array(prior.scale)
    peer = LogisticRegression(C=1e6, tol=1e-10, max_iter=1000)
    peer.fit(scaled, GIVEN.positive)
    found = adapted(1e6, prior=prior)
    expected = [peer.intercept_[0], *peer.coef_[0]]
    assert rule_of(found) == pytest.approx(expected, abs=1e-4)
    assert (found.mean, found.scale) == (prior.mean, prior.scale)


@pytest.mark.parametrize("stable", [True, False])
def test_one_class_is_refused(stable):
    given = GIVEN._replace(positive=np.full(600, stable))
    with pytest.raises(TrainingError, match="labelled"):
        adapted(1.0, given)


def test_another_number_of_features_is_refused():
    with pytest.raises(ValueError, match="3 expected"):
        adapted(1.0, GIVEN._replace(features=GIVEN.features[:, :2]))
