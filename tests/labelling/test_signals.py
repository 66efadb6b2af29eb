import msgspec
import numpy as np
import pytest

from holdfast.features import fingertip_force, haar_features
from holdfast.labelling.signals import SERIES, Signals, rounded
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

RECORDING = synthetic_recording("grasp", 0, ("thumb", "index"))
N = RECORDING.modules["thumb"].n_samples


def expected(module, tare):
    """(n, 5) the naive way; the tare by an interval counts for all samples."""
    force = fingertip_force(module.readings, module.sensor, tare, module.times)
    return np.column_stack([np.linalg.norm(force, axis=1), force, haar_features(force)[:, 5]])


def values_of(series):
    return np.array([series[name] for name in SERIES], dtype=float).T


@pytest.mark.parametrize(
    ("tare", "offline"),
    [(0.5, (0.0, 0.5)), ("first", "first"), ("none", "none"), ((1.0, 1.2), (1.0, 1.2))],
)
def test_every_sample_is_told_where_there_are_few(tare, offline):
    drawn = Signals(RECORDING, tare).draw(points=N)
    assert (drawn.start, drawn.end, drawn.exact) == (RECORDING.start, RECORDING.end, True)
    for name, module in RECORDING.modules.items():
        series = drawn.fingers[name]
        assert series["t"] == module.times.tolist()
        np.testing.assert_allclose(values_of(series), expected(module, offline), rtol=1e-5)


@pytest.mark.parametrize("points", [2, 3, 10, 100, 777])
@pytest.mark.parametrize(("start", "end"), [(0.0, 99.0), (2.0, 9.0), (3.33, 3.4), (-5.0, 1.0)])
def test_the_least_and_the_most_of_each_few(points, start, end):
    signals = Signals(RECORDING)
    drawn = signals.draw(start, end, points)
    exact = signals.draw(start, end, N).fingers
    assert (drawn.start, drawn.end) == (start, end)
    for name, series in drawn.fingers.items():
        assert 0 < len(series["t"]) <= 2 * points
        assert (np.diff(series["t"]) >= 0).all()
        every = values_of(exact[name])
        if drawn.exact:
            np.testing.assert_array_equal(values_of(series), every)
        else:  # extremes of a few more samples at the edges
            assert (np.nanmin(values_of(series), axis=0) <= np.nanmin(every, axis=0)).all()
            assert (np.nanmax(values_of(series), axis=0) >= np.nanmax(every, axis=0)).all()
            assert (values_of(series)[::2] <= values_of(series)[1::2]).sum() > 0


def test_pairs_hold_every_sample_between_them():
    drawn = Signals(RECORDING).draw(points=100).fingers["thumb"]
    exact = Signals(RECORDING).draw(points=N).fingers["thumb"]
    begins = np.array(drawn["t"][::2])
    bins = np.searchsorted(begins, exact["t"], side="right") - 1
    low, high = np.array(drawn["F_x"][::2]), np.array(drawn["F_x"][1::2])
    values = np.array(exact["F_x"])
    for k in range(len(begins)):
        assert low[k] == values[bins == k].min()
        assert high[k] == values[bins == k].max()


def test_parts_have_a_sample_on_either_side():
    series = Signals(RECORDING).draw(3.001, 3.001).fingers["thumb"]
    assert series["t"][0] <= 3.001 <= series["t"][-1]
    assert len(series["t"]) in (2, 3)


def test_what_is_not_known_is_null_and_gaps_are_shown():
    module = RECORDING.modules["thumb"]
    readings = module.readings.astype(float)
    readings[300] = np.nan
    keep = np.ones(N, dtype=bool)
    keep[600:660] = False
    gappy = Tactile(module.sensor, module.times[keep], readings[keep])
    drawn = Signals(Recording("gappy", {"thumb": gappy})).draw(points=N)
    series = drawn.fingers["thumb"]
    assert len(series["t"]) == N - 60 + 1
    assert series["F_a"][:3] == pytest.approx([0, 0, 0], abs=1e3)
    told = msgspec.json.decode(msgspec.json.encode(drawn))["fingers"]["thumb"]
    assert told["F_a"][300] is told["F_a"][600] is told["sigma"][0] is None
    assert series["t"][600] == pytest.approx((600 - 0.5 + 30) / 150)
    assert None not in told["F_a"][:300]
    coarse = Signals(Recording("gappy", {"thumb": gappy})).draw(points=50).fingers["thumb"]
    assert np.isfinite(values_of(coarse)[:, 0]).all()


def test_modules_without_samples_and_without_sense():
    tip = sensor("uskin-4x4")
    silent = Tactile(tip, np.empty(0), np.empty((0, 16, 3)))
    blind = Tactile(tip, np.arange(10) / 100, np.full((10, 16, 3), np.nan))
    signals = Signals(Recording("odd", {"silent": silent, "blind": blind}))
    drawn = signals.draw().fingers
    assert drawn["silent"]["t"] == drawn["silent"]["F_a"] == []
    assert np.isnan(drawn["blind"]["F_a"]).all()
    assert signals.draw(5.0, 6.0).exact


@pytest.mark.parametrize(
    ("start", "end", "points", "text"),
    [
        (2.0, 1.0, 100, r"^a part ends after its start; \[2\.0, 1\.0\] s given$"),
        (float("nan"), 1.0, 100, r"^a part ends after its start"),
        (0.0, float("inf"), 100, r"^a part ends after its start"),
        (0.0, 1.0, 1, r"^2 to 10000 points expected, 1 given$"),
        (0.0, 1.0, 10**6, r"^2 to 10000 points expected, 1e\+06 given$"),
    ],
)
def test_parts_that_make_no_sense(start, end, points, text):
    with pytest.raises(ValueError, match=text):
        Signals(RECORDING).draw(start, end, points)


def test_tares_that_find_nothing():
    with pytest.raises(ValueError, match=r"^tare .*: no finite sample in that time$"):
        Signals(RECORDING, (50.0, 60.0))
    with pytest.raises(ValueError, match=r"^tare: seconds above 0"):
        Signals(RECORDING, "soon")


def test_rounding_keeps_six_digits():
    generator = np.random.default_rng(0)
    values = generator.normal(size=1000) * 10.0 ** generator.integers(-20, 20, 1000)
    np.testing.assert_allclose(rounded(values), values, rtol=1e-5)
    usual = generator.normal(size=1000) * 10.0 ** generator.integers(-3, 7, 1000)
    assert all(len(repr(value)) <= 14 for value in rounded(usual).tolist())
    odd = np.array([np.nan, 0.0, np.inf, -np.inf])
    np.testing.assert_array_equal(rounded(odd), odd)
