import numpy as np
import pytest

from holdfast.plots.envelope import envelope


@pytest.mark.parametrize("n", [1, 10, 4000])
def test_short_curves_stay(n):
    times, values = np.arange(n) * 1.0, np.random.default_rng(0).normal(size=n)
    got = envelope(times, values)
    assert got[0] is times
    assert got[1] is values


@pytest.mark.parametrize("n", [4001, 10_000, 123_457])
def test_no_peak_is_lost(n):
    rng = np.random.default_rng(n)
    times, values = np.arange(n) / 150, rng.normal(size=n)
    places = rng.choice(n, 5, replace=False)
    values[places] = [50, -60, 70, -80, 90]
    short_times, short_values = envelope(times, values)
    assert len(short_times) == len(short_values) == 4000
    assert set(values[places]) <= set(short_values)
    assert (np.diff(short_times) >= 0).all()
    assert (short_times[0], short_times[-1]) == (times[0], times[-1])


def test_long_stretches_of_nothing_stay_nothing():
    values = np.ones(100_000)
    values[30_000:40_000] = np.nan
    values[70_000] = np.nan
    times, short = envelope(np.arange(100_000.0), values)
    missing = times[np.isnan(short)]
    assert missing.min() >= 29_999
    assert missing.max() <= 40_000
    assert len(missing) == 400
