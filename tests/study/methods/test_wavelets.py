import numpy as np
import pytest

from holdfast.features import haar_features
from holdfast.study.methods import METHODS
from holdfast.study.methods.wavelets import detail_energy, energy

from .build import along_normal, pressed

NAN = np.nan


def test_by_hand():
    # Windows of 4: pairs (1, 3) (3, 2), (3, 3) (2, 6), (3, 2) (6, 6).
    # E: (4 + 1) / 2, (0 + 16) / 2, (1 + 0) / 2.
    hand = pressed(along_normal([1, 3, 3, 2, 6, 6]))
    found = energy(hand, window=4)["index"]
    np.testing.assert_allclose(found[:, 0], [NAN, NAN, NAN, 2.5, 8.0, 0.5])


def test_the_deployed_window_has_seven_pairs():
    # 0, 2, 0, 2, ... : every detail is -sqrt(2) or sqrt(2), so E = 7 x 2.
    hand = pressed(along_normal([0, 2] * 10))
    found = METHODS["zhang"].features(hand)["index"][:, 0]
    assert np.isnan(found[:13]).all()
    np.testing.assert_allclose(found[13:], 14.0)


def test_shear_has_no_say():
    values = along_normal(np.arange(30.0) ** 2)
    sheared = values + np.outer(np.arange(30) % 7, [1.0, -2.0, 0.0])
    one, two = (METHODS["zhang"].features(pressed(v))["index"] for v in (values, sheared))
    np.testing.assert_allclose(one, two)


def test_energy_is_spread_and_mean_of_the_details():
    """Of the same details, E = N_w sigma^2 + (sum d)^2 / (N_w / 2): sigma leaves the mean out."""
    values = np.random.default_rng(0).normal(size=200).cumsum() + 100
    sigma = haar_features(along_normal(values), 14)[:, 5]
    steps = [(values[k - 13 : k + 1 : 2] - values[k - 12 : k + 1 : 2]) for k in range(13, 200)]
    means = np.sum(steps, axis=1) / np.sqrt(2) / 7
    np.testing.assert_allclose(detail_energy(values)[13:], 14 * sigma[13:] ** 2 + 7 * means**2)


def test_an_odd_window_is_refused():
    with pytest.raises(ValueError, match="an even window of at least 2 samples expected, 5 given"):
        detail_energy(np.ones(9), window=5)
