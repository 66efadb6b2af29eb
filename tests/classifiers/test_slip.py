"""Speed rule: what it computes, and what it refuses."""

import numpy as np
import pytest
from holdfast.classifiers.slip import SlipRule, SpeedRule, add_squares, speed_of
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from holdfast.classifiers import LinearClassifier
from holdfast.errors import ModelError

RULE = SpeedRule((1.0, 2.0), (2.0, 0.5), (0.5, -1.0), (0.25, 0.0), 3.0, 40.0)
LINEAR = LinearClassifier((0.0, 0.0), (1.0, 1.0), (1.0, 1.0), 0.0)


def speed(rule, features):
    weights = rule.weights()
    value = weights[0] + features @ weights[1:]
    return speed_of(add_squares(value, features, rule.square_weights()), rule.highest)


@pytest.mark.parametrize(
    ("features", "expected"),
    [
        ([1.0, 2.0], 3.0**2),  # the means
        ([3.0, 2.0], (3.0 + 0.5 + 0.25) ** 2),
        ([1.0, 3.5], 0.0),  # z = 3 - 3
        ([1.0, 9.0], 0.0),  # z < 0
        ([21.0, 2.0], 40.0),  # the highest
        ([-99.0, -48.0], 40.0),  # squares of at most 5 deviations: 3 - 25 + 100 + 6.25
    ],
)
def test_values(features, expected):
    assert speed(RULE, np.array(features)) == pytest.approx(expected)


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2))
def test_a_speed_is_never_negative_nor_above_the_highest(features):
    assert 0 <= speed(RULE, np.array(features)) <= RULE.highest


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"mean": (1.0,)}, "1, 2, 2, 2 means, scales, coefficients and squares of the slip speed"),
        ({"scale": (0.0, 1.0)}, "scales and a highest slip speed above 0 expected"),
        ({"highest": 0.0}, "scales and a highest slip speed above 0 expected"),
        ({"highest": np.nan}, "a number of the slip speed is not finite"),
        ({"squares": (np.inf, 0.0)}, "a number of the slip speed is not finite"),
        ({"scale": (1e-320, 1.0)}, "a number of the slip speed is not finite"),
    ],
)
def test_bad_numbers_are_refused(fields, words):
    with pytest.raises(ModelError, match=words):
        replace(RULE, **fields)


def test_another_number_of_features_is_refused():
    linear = LinearClassifier((0.0,), (1.0,), (1.0,), 0.0)
    SlipRule(LINEAR, speed=RULE)
    with pytest.raises(ModelError, match="2 features of the slip speed given, the slip rule exp"):
        SlipRule(linear, speed=RULE)
