import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.detection import Linear
from holdfast.errors import ModelError
from holdfast.training.head_fits import MAX_DEVIATION

numbers = st.floats(-1e3, 1e3)
positive = st.floats(1e-2, 1e3)


def classifiers(n):
    many = st.tuples(*[numbers] * n)
    scales = st.tuples(*[positive] * n)
    rows, intercepts, none = st.tuples(many), st.tuples(numbers), st.just(())
    slope, offset = st.floats(1e-3, 10), st.floats(-5, 5)
    return st.builds(Linear, many, scales, rows, intercepts, none, slope, offset)


@given(rule=classifiers(3), seed=st.integers(0, 99))
def test_weights_decision_and_probability_agree(rule, seed):
    features = np.random.default_rng(seed).normal(scale=100, size=(20, 3))
    with np.errstate(over="ignore"):
        by_decision = 1 / (1 + np.exp(-(rule.slope * rule.decision(features) + rule.offset)))
        weights = rule.raw_weights()[0]
        by_weights = 1 / (1 + np.exp(-(weights[0] + features @ weights[1:])))
    found = rule.probability(features)
    assert found == pytest.approx(by_decision, abs=1e-6)
    assert found == pytest.approx(by_weights, abs=1e-6)


def test_the_equation():
    rule = Linear((1.0, 2.0), (2.0, 4.0), ((3.0, -1.0),), (0.5,), slope=2.0, offset=-0.25)
    assert rule.decision(np.array([[3.0, 6.0]])).tolist() == [0.5 + 3.0 - 1.0]
    assert rule.probability([[3.0, 6.0]])[0] == pytest.approx(1 / (1 + np.exp(-4.75)))
    assert rule.n_features == 2


def test_nan_features_have_no_probability():
    rule = Linear((0.0,), (1.0,), ((1.0,),), (0.0,))
    assert np.isnan(rule.probability([[np.nan], [0.0]])).tolist() == [True, False]
    assert rule.probability(np.empty((0, 1))).shape == (0,)


def test_far_from_the_boundary_it_is_certain():
    rule = Linear((0.0,), (1.0,), ((1.0,),), (0.0,))
    assert rule.probability([[1e9], [-1e9]]).tolist() == [1.0, 0.0]


@pytest.mark.parametrize("shape", [(4, 1), (4, 3), (2,), (1, 4, 2)])
@pytest.mark.parametrize("of", ["probability", "decision"])
def test_refuses_other_shapes(shape, of):
    rule = Linear((0.0, 1.0), (1.0, 2.0), ((1.0, -1.0),), (0.2,))
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        getattr(rule, of)(np.zeros(shape))


GOOD = {"mean": (0.0,), "scale": (1.0,), "weights": ((1.0,),), "intercepts": (0.0,)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mean": (0.0, 1.0)}, "2, 1, 1 features"),
        ({"weights": ((1.0,), (1.0, 2.0)), "intercepts": (0.0, 0.0)}, "1, 1, 1, 2 features"),
        ({"squares": ((1.0, 2.0),)}, "1, 1, 1, 2 features"),
        ({"intercepts": (0.0, 0.0)}, "2 intercepts"),
        ({"squares": ((1.0,), (2.0,))}, "2 rows of squares"),
        ({"weights": (), "intercepts": ()}, "0 rows of weights"),
        ({"mean": (np.nan,)}, "not finite"),
        ({"weights": ((np.inf,),)}, "not finite"),
        ({"intercepts": (np.nan,)}, "not finite"),
        ({"squares": ((np.nan,),)}, "not finite"),
        ({"squares": ((1e308,),), "slope": 1e3}, "not finite"),
        ({"squares": ((0.0,),), "scale": (1e-320,), "weights": ((0.0,),)}, "not finite"),
        ({"offset": -np.inf}, "not finite"),
        ({"slope": np.nan}, "not finite"),
        ({"slope": 0.0}, "slope"),
        ({"scale": (0.0,)}, "scale"),
        ({"scale": (-1.0,)}, "scale"),
        ({"scale": (1e-300,), "weights": ((1e300,),)}, "not finite"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ModelError, match=message):
        Linear(**(GOOD | change))


@given(classifiers(4))
def test_saved_and_loaded_it_is_the_same(rule):
    assert msgspec.json.decode(msgspec.json.encode(rule), type=Linear) == rule


def test_arrays_of_one_output_and_of_several():
    mean, scale, rows = np.array([1.0, 2.0]), np.array([2.0, 4.0]), np.array([[3.0, -1.0], [0, 1]])
    one = Linear.of(mean, scale, rows[0], 0.5, rows[1], slope=2.0)
    assert one == Linear((1.0, 2.0), (2.0, 4.0), ((3.0, -1.0),), (0.5,), ((0.0, 1.0),), slope=2.0)
    two = Linear.of(mean, scale, rows, [0.5, 0.25])
    assert (two.n_features, two.n_outputs) == (2, 2)
    expected = (np.array([[7.0, 8.0]]) - mean) / scale @ rows.T + [0.5, 0.25]
    raw = two.raw_weights()
    assert raw[:, 0] + raw[:, 1:] @ [7.0, 8.0] == pytest.approx(expected[0])


def test_squares_by_hand():
    rule = Linear((1.0, -2.0), (4.0, 9.0), ((0.0, 0.0),), (0.0,), ((0.3, -0.2),), slope=0.4)
    assert Linear(rule.mean, rule.scale, rule.weights, (0.0,)).raw_squares()[2].tolist() == [0, 0]
    phi = np.array([3.0, -900.0])
    u = (phi - np.array(rule.mean)) / np.array(rule.scale)
    assert abs(u[1]) > 5
    expected = rule.slope * np.array(rule.squares[0]) @ np.minimum(np.abs(u), 5.0) ** 2
    mean, inverse, weights = rule.raw_squares()
    found = weights @ np.minimum(np.abs((phi - mean) * inverse), MAX_DEVIATION) ** 2
    assert found == pytest.approx(expected)
