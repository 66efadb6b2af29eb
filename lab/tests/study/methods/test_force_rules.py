"""Methods on the fingertip force itself, and on its vibration."""

import numpy as np
import pytest

from holdfast.sensors.xela_models import NEWTONS_PER_NORMAL_COUNT
from holdfast.training.classifiers import Samples
from holdfast.twin.uskin_readout import UskinParameters
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.methods.force_rules import (
    band_energy,
    band_pass,
    high_pass,
)

from .patch_signals import along_normal, pressed

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
    _, w_n, w_t = fitted.rule.raw_weights()[0]
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


@pytest.mark.parametrize("name", ["tangential", "slip_servo"])
def test_counts_are_nominal_newtons(name):
    newtons = np.random.default_rng(0).normal(size=(50, 3)) * 0.01
    one, two = pressed(newtons, unit="N"), pressed(newtons / 0.000729)
    features = METHODS[name].features
    np.testing.assert_allclose(features(one)["index"], features(two)["index"])


def test_force_difference_by_hand():
    hand = pressed([[0, 0, 0], [3, 4, 0], [3, 4, 12], [3, 4, 12]], rate=100.0)
    found = METHODS["difference"].features(hand)["index"]
    np.testing.assert_allclose(found[:, 0], [np.nan, 500, 1200, 0])


SERVO = METHODS["slip_servo"]
RATE = 10 * np.pi
"""At which a = 1 / (1 + 2 pi 5 / rate) = 1 / 2."""


def test_high_pass_by_hand():
    # y_0 = 0, then y_k = (y_(k-1) + x_k - x_(k-1)) / 2.
    found = high_pass(np.array([10.0, 14.0, 14.0, 6.0, 7.0]), RATE)
    np.testing.assert_allclose(found, [0, 2, 1, -3.5, -1.25])


@pytest.mark.parametrize(("frequency", "gain"), [(0.8, 0.5), (2.0, 1.0), (5.0, 0.5), (40.0, 0.0)])
def test_band_pass_lets_its_band_through(frequency, gain):
    """Half the power at the ends of the band, all of it at their geometric mean."""
    times = np.arange(6000) / 150.0
    found = band_pass(np.sin(2 * np.pi * frequency * times), 150.0)[3000:]
    assert 2 * (found**2).mean() == pytest.approx(gain, abs=0.02)


def test_the_slip_ratio_by_hand():
    # Newtons, the rate at which a = 1 / 2. |F_hp| after the step of 0.02 N is 0.01 N, and
    # 0.007 |F| is under 0.048 N; the grip does not change yet: |F_bp| < 0.18 N.
    hand = pressed(along_normal([1.0, 1.02, 1.02]), RATE, "N")
    found = SERVO.features(hand)["index"][:, 0]
    np.testing.assert_allclose(found, [0, 0.01 / 0.048, 0.005 / 0.048])


def test_a_nominal_newton_is_that_of_the_twin():
    assert UskinParameters().counts_per_newton[2] == pytest.approx(1 / NEWTONS_PER_NORMAL_COUNT)


def test_band_energy_by_hand():
    """Four samples: w = 0, 1/2, 1, 1/2, so that N sum w^2 / 2 = 3; bins at 0, 1 and 2 Hz."""
    # Less their mean of 2, times w: 0, 1, 0, -1. |X| at 1 Hz: |-1j - 1j| = 2; at 2 Hz: 0.
    found = band_energy(np.array([[2.0], [4.0], [2.0], [0.0]]), 4.0, ((1, 2), (2, 3)), 1.0)
    np.testing.assert_allclose(found, [[np.nan] * 2] * 3 + [[4 / 3, 0]], atol=1e-15)


def test_the_window_of_the_spectrum_slides():
    values = np.random.default_rng(0).normal(size=(90, 3)) * [1, 20, 3] + [0, 50, 4000]
    found = METHODS["spectrum"].features(pressed(values, 150.0))["index"]
    weights = np.hanning(31)[:30]
    for k in (29, 50, 89):
        window = values[k - 29 : k + 1]
        power = np.abs(np.fft.fft((window - window.mean(axis=0)) * weights[:, None], axis=0)) ** 2
        bins = [[1, 2], [3, 4, 5], [6, 7, 8, 9], [10, 11, 12, 13, 14], list(range(1, 15))]
        wanted = [power[b].sum() * 2 / (30 * (weights**2).sum()) for b in bins]
        np.testing.assert_allclose(10 ** found[k], wanted)
    assert np.isnan(found[:29]).all()
