import numpy as np
import pytest

from holdfast.study.methods import METHODS
from holdfast.study.methods.tangential import EPSILON

from .build import pressed


def test_by_hand():
    # T in newtons: 1, 1.5, 0.3, 0, 0.022; the last is relative to eps = 0.011 N.
    hand = pressed([[1, 0, 9], [0, 1.5, 2], [0.3, 0, 2], [0, 0, 5], [0, -0.022, 5]], unit="N")
    found = METHODS["tangential"].features(hand)["index"]
    np.testing.assert_allclose(found[:, 0], [np.nan, 0.5, 0.8, 1, 2])


def test_eps_is_three_times_the_noise_of_thirty_taxels():
    counts = 3 * np.sqrt(30) * 0.9
    assert counts * 0.000729 == pytest.approx(EPSILON, rel=0.03)


def test_counts_are_nominal_newtons():
    newtons = np.random.default_rng(0).normal(size=(50, 3)) * 0.01
    one, two = pressed(newtons, unit="N"), pressed(newtons / 0.000729)
    features = METHODS["tangential"].features
    np.testing.assert_allclose(features(one)["index"], features(two)["index"])
