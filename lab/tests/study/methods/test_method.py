"""Signals of a hand, stretches and windows."""

import numpy as np
import pytest

from holdfast_lab.study.methods.method import stretchwise, windowed

from .patch_signals import pressed


def last_and_first(windows):
    return np.column_stack([windows[..., -1], windows[..., 0]])


@pytest.mark.parametrize("n", [0, 1, 2, 3, 6])
def test_windows_end_at_their_sample(n):
    found = windowed(np.arange(1.0, n + 1), 3, last_and_first)
    wanted = [[k, k - 2] if k >= 3 else [np.nan] * 2 for k in range(1, n + 1)]
    np.testing.assert_array_equal(found, np.reshape(wanted, (n, 2)))


def test_features_restart_at_each_stretch():
    values = np.ones((8, 3)) * np.arange(8)[:, None]
    values[3] = np.nan
    times = np.arange(8) / 100.0 + np.where(np.arange(8) >= 6, 0.1, 0.0)
    hand = pressed(values, times=times)
    found = stretchwise(hand, lambda finger: finger.force.cumsum(axis=0)[:, :1])
    wanted = [0, 1, 3, np.nan, 4, 9, 6, 13]
    np.testing.assert_array_equal(found["index"][:, 0], wanted)


@pytest.mark.parametrize(("unit", "newton"), [("N", 1.0), ("count", 1 / 0.000729)])
def test_a_newton_in_the_unit_of_the_readings(unit, newton):
    finger = pressed([[0, 0, 0]], unit=unit).fingers["index"]
    assert finger.units_per_newton == pytest.approx(newton)
