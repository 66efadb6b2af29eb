import numpy as np
import pytest

from holdfast.classifiers import Samples
from holdfast.study.methods import METHODS

from .build import pressed

FRICTION = METHODS["friction"]


def test_by_hand():
    found = FRICTION.features(pressed([[3, 4, 10], [0, -2, -6], [0, 0, 0]]))["index"]
    np.testing.assert_allclose(found, [[10, 5], [6, 2], [0, 0]])


def test_the_fit_finds_the_coefficient_of_friction():
    rng = np.random.default_rng(0)
    normal, tangential = rng.uniform(50, 1000, 4000), rng.uniform(0, 700, 4000)
    stable = 0.6 * normal - tangential > 30
    given = Samples(np.column_stack([normal, tangential]), stable, np.arange(4000) % 5)
    fitted = FRICTION.recipe.fit(given, {**FRICTION.reference, "C": 1e4}, 0)
    _, w_n, w_t = fitted.weights()
    assert w_t < 0
    assert -w_n / w_t == pytest.approx(0.6, abs=0.01)
    margins = 0.6 * normal - tangential - 30
    clear = np.abs(margins) > 10
    called = fitted.probability(given.features) >= fitted.threshold
    assert np.array_equal(called[clear], stable[clear])
