import numpy as np
import pytest

from holdfast.contact import STABLE
from holdfast.detection import Tare
from holdfast.plots.time_series import envelope, equal_runs, finger_series
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import sensor


@pytest.mark.parametrize("n", [1, 10, 4000])
def test_short_curves_are_unchanged(n):
    times, values = np.arange(n) * 1.0, np.random.default_rng(0).normal(size=n)
    got = envelope(times, values)
    assert got[0] is times
    assert got[1] is values


@pytest.mark.parametrize("n", [4001, 10_000, 123_457])
def test_no_peak_is_lost(n):
    rng = np.random.default_rng(n)
    times, values = np.arange(n) / 150, rng.normal(size=n)
    indices = rng.choice(n, 5, replace=False)
    values[indices] = [50, -60, 70, -80, 90]
    short_times, short_values = envelope(times, values)
    assert len(short_times) == len(short_values) == 4000
    assert set(values[indices]) <= set(short_values)
    assert (np.diff(short_times) >= 0).all()
    assert (short_times[0], short_times[-1]) == (times[0], times[-1])


@pytest.mark.parametrize("sign", [1, -1])
def test_what_falls_is_drawn_falling_and_what_rises_rising(sign):
    values = sign * np.interp(np.arange(20_000), [0, 9_000, 12_000, 20_000], [9, 8, 1, 0])
    values[15_001:] -= sign * 5.0
    values[::3] = np.nan
    _, short = envelope(np.arange(20_000.0), values, 1000)
    assert (sign * np.diff(short)).max() <= 0
    assert (sign * np.diff(short)).min() <= -5


def test_long_stretches_of_nan_stay_nan():
    values = np.ones(100_000)
    values[30_000:40_000] = np.nan
    values[70_000] = np.nan
    times, short = envelope(np.arange(100_000.0), values)
    missing = times[np.isnan(short)]
    assert missing.min() >= 29_999
    assert missing.max() <= 40_000
    assert len(missing) == 400


def test_series_of_a_recording():
    grid = sensor("uskin-4x4")
    times = 0.01 * np.arange(100)
    readings = np.zeros((100, grid.n_taxels, 3))
    readings[50:, :, 2] = 10.0
    label = Label(0.5, 0.9, "STABLE")
    truth = Truth(times[::2], {"phase": np.repeat(["free", "locked"], 25)})
    module = Tactile(grid, times, readings, labels=(label,))
    found = finger_series(
        Recording("one", {"index": module}, truth=truth), "index", Tare.parse("0.2")
    )
    assert found.name == "index"
    assert np.isnan(found.sigma[:20]).all() and found.sigma[49:70].max() > 0
    np.testing.assert_allclose(found.amplitude[50:], 10.0 * grid.n_taxels)
    np.testing.assert_array_equal(found.phases, np.repeat(["free", "locked"], 50))
    np.testing.assert_array_equal(np.flatnonzero(found.labels == STABLE), np.arange(50, 90))


def test_equal_runs():
    assert list(equal_runs(np.array([]))) == []
    assert list(equal_runs(np.array(["a", "b", "b"]))) == [(0, 1), (1, 3)]
