"""Methods on the fingertip force itself."""

import numpy as np
import pytest

from holdfast.classifiers import Samples
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.methods.force_rules import MIN_TANGENTIAL_FORCE

from .patch_signals import pressed

FRICTION = METHODS["friction"]


def test_friction_by_hand():
    found = FRICTION.features(pressed([[3, 4, 10], [0, -2, -6], [0, 0, 0]]))["index"]
    np.testing.assert_allclose(found, [[10, 5], [6, 2], [0, 0]])


def test_the_fit_finds_the_coefficient_of_friction():
    rng = np.random.default_rng(0)
    normal, tangential = rng.uniform(50, 1000, 4000), rng.uniform(0, 700, 4000)
    stable = 0.6 * normal - tangential > 30
    given = Samples(np.column_stack([normal, tangential]), stable, np.arange(4000) % 5)
    fitted = FRICTION.recipe.fit(given, {**FRICTION.reference, "C": 1e4}, 0)
    _, w_n, w_t = fitted.linear.raw_weights()[0]
    assert w_t < 0
    assert -w_n / w_t == pytest.approx(0.6, abs=0.01)
    margins = 0.6 * normal - tangential - 30
    clear = np.abs(margins) > 10
    called = fitted.probability(given.features) >= fitted.threshold
    assert np.array_equal(called[clear], stable[clear])


def test_tangential_change_by_hand():
    # T in newtons: 1, 1.5, 0.3, 0, 0.022; the last is relative to eps = 0.011 N.
    hand = pressed([[1, 0, 9], [0, 1.5, 2], [0.3, 0, 2], [0, 0, 5], [0, -0.022, 5]], unit="N")
    found = METHODS["tangential"].features(hand)["index"]
    np.testing.assert_allclose(found[:, 0], [np.nan, 0.5, 0.8, 1, 2])


def test_eps_is_three_times_the_noise_of_thirty_taxels():
    counts = 3 * np.sqrt(30) * 0.9
    assert counts * 0.000729 == pytest.approx(MIN_TANGENTIAL_FORCE, rel=0.03)


def test_counts_are_nominal_newtons():
    newtons = np.random.default_rng(0).normal(size=(50, 3)) * 0.01
    one, two = pressed(newtons, unit="N"), pressed(newtons / 0.000729)
    features = METHODS["tangential"].features
    np.testing.assert_allclose(features(one)["index"], features(two)["index"])


def test_force_difference_by_hand():
    hand = pressed([[0, 0, 0], [3, 4, 0], [3, 4, 12], [3, 4, 12]], rate=100.0)
    found = METHODS["difference"].features(hand)["index"]
    np.testing.assert_allclose(found[:, 0], [np.nan, 500, 1200, 0])
