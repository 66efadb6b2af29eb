import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.classifiers import LinearClassifier
from holdfast.errors import ModelError

numbers = st.floats(-1e3, 1e3)
positive = st.floats(1e-2, 1e3)


def classifiers(n):
    many = st.tuples(*[numbers] * n)
    scales = st.tuples(*[positive] * n)
    return st.builds(
        LinearClassifier, many, scales, many, numbers, st.floats(1e-3, 10), st.floats(-5, 5)
    )


@given(rule=classifiers(3), seed=st.integers(0, 99))
@settings(deadline=None)  # the first one may compile
def test_weights_decision_and_probability_agree(rule, seed):
    features = np.random.default_rng(seed).normal(scale=100, size=(20, 3))
    with np.errstate(over="ignore"):
        by_decision = 1 / (1 + np.exp(-(rule.slope * rule.decision(features) + rule.offset)))
        weights = rule.weights()
        by_weights = 1 / (1 + np.exp(-(weights[0] + features @ weights[1:])))
    found = rule.probability(features)
    assert found == pytest.approx(by_decision, abs=1e-6)
    assert found == pytest.approx(by_weights, abs=1e-6)


def test_the_equation():
    rule = LinearClassifier((1.0, 2.0), (2.0, 4.0), (3.0, -1.0), 0.5, slope=2.0, offset=-0.25)
    assert rule.decision(np.array([[3.0, 6.0]])).tolist() == [0.5 + 3.0 - 1.0]
    assert rule.probability([[3.0, 6.0]])[0] == pytest.approx(1 / (1 + np.exp(-4.75)))
    assert rule.n_features == 2


def test_nan_features_have_no_probability():
    rule = LinearClassifier((0.0,), (1.0,), (1.0,), 0.0)
    assert np.isnan(rule.probability([[np.nan], [0.0]])).tolist() == [True, False]
    assert rule.probability(np.empty((0, 1))).shape == (0,)


def test_far_from_the_boundary_it_is_certain():
    rule = LinearClassifier((0.0,), (1.0,), (1.0,), 0.0)
    assert rule.probability([[1e9], [-1e9]]).tolist() == [1.0, 0.0]


@pytest.mark.parametrize("kind", [np.float32, np.int64])
def test_features_of_any_type(kind):
    rule = LinearClassifier((0.0, 1.0), (1.0, 2.0), (1.0, -1.0), 0.2)
    features = np.arange(8).reshape(4, 2)
    assert np.array_equal(rule.probability(features.astype(kind)), rule.probability(features))


@pytest.mark.parametrize("shape", [(4, 1), (4, 3), (2,), (1, 4, 2)])
@pytest.mark.parametrize("of", ["probability", "decision"])
def test_refuses_other_shapes(shape, of):
    rule = LinearClassifier((0.0, 1.0), (1.0, 2.0), (1.0, -1.0), 0.2)
    with pytest.raises(ValueError) as raised:
        getattr(rule, of)(np.zeros(shape))
    assert str(raised.value) == f"features of shape (n, 2) expected, {shape} given"


GOOD = {"mean": (0.0,), "scale": (1.0,), "coefficients": (1.0,), "intercept": 0.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean": (0.0, 1.0)},
         "2 means, 1 scales and 1 coefficients given; the same number of each expected"),
        ({"mean": (np.nan,)}, "a number of the classifier is not finite"),
        ({"coefficients": (np.inf,)}, "a number of the classifier is not finite"),
        ({"intercept": np.nan}, "a number of the classifier is not finite"),
        ({"offset": -np.inf}, "a number of the classifier is not finite"),
        ({"slope": np.nan}, "a number of the classifier is not finite"),
        ({"slope": 0.0}, "scales and slope above 0 expected"),
        ({"scale": (0.0,)}, "scales and slope above 0 expected"),
        ({"scale": (-1.0,)}, "scales and slope above 0 expected"),
        ({"scale": (1e-300,), "coefficients": (1e300,)},
         "the weights of the classifier overflow: a scale is too small"),
        ({"threshold": 1.5}, "a threshold from 0 to 1 expected, 1.5 given"),
        ({"threshold": np.nan}, "a threshold from 0 to 1 expected, nan given"),
    ],
)  # fmt: skip
def test_refusals(change, message):
    with pytest.raises(ModelError) as raised:
        LinearClassifier(**(GOOD | change))
    assert str(raised.value) == message


@given(classifiers(4))
def test_saved_and_loaded_it_is_the_same(rule):
    assert msgspec.json.decode(msgspec.json.encode(rule), type=LinearClassifier) == rule
