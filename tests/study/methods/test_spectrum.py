import numpy as np
import pytest

from holdfast.study.methods import METHODS
from holdfast.study.methods.spectrum import BANDS, band_energy

from .build import pressed


def sine(frequency, amplitude, n=100, rate=150.0):
    return amplitude * np.sin(2 * np.pi * frequency * np.arange(n) / rate + 0.3)[:, None]


def test_by_hand():
    """Four samples: w = 0, 1/2, 1, 1/2, so that N sum w^2 / 2 = 3; bins at 0, 1 and 2 Hz."""
    # Less their mean of 2, times w: 0, 1, 0, -1. |X| at 1 Hz: |-1j - 1j| = 2; at 2 Hz: 0.
    found = band_energy(np.array([[2.0], [4.0], [2.0], [0.0]]), 4.0, ((1, 2), (2, 3)), 1.0)
    np.testing.assert_allclose(found, [[np.nan] * 2] * 3 + [[4 / 3, 0]], atol=1e-15)


@pytest.mark.parametrize("amplitude", [1.0, 30.0])
def test_a_sine_inside_a_band_shows_its_power_there_and_nowhere_else(amplitude):
    found = band_energy(sine(40.0, amplitude), 150.0, BANDS)[29:]
    power = amplitude**2 / 2
    np.testing.assert_allclose(found / power, [[0, 0, 1, 0, 1]] * 71, atol=1e-12)


def test_the_window_slides():
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


def test_a_constant_force_is_finite():
    found = METHODS["spectrum"].features(pressed(np.full((60, 3), 7.0), 150.0))["index"]
    np.testing.assert_allclose(found[29:], -12, atol=0.01)


def test_bands_above_what_a_slow_sensor_holds_are_empty():
    noise = np.random.default_rng(0).normal(size=(60, 3))
    found = METHODS["spectrum"].features(pressed(noise, 60.0))["index"][20:]
    assert (found[:, 3] == -12).all()
    assert (found[:, :2] > -6).all()
