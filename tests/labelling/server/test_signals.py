import msgspec
import numpy as np
import pytest

from holdfast.detection import fingertip_force, haar_features
from holdfast.labelling.server.signals import SERIES, FingerSignals, Signals, change_points, rounded
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

RECORDING = synthetic_recording("grasp", 0, ("thumb", "index"))
N = RECORDING.modules["thumb"].n_samples


def signals_of(recording, tare=0.5):
    fingers = {name: FingerSignals(module, tare) for name, module in recording.modules.items()}
    return Signals(recording.start, recording.end, fingers)


def expected(module, tare):
    """(n, 5) signals; a tare by an interval is subtracted from all samples."""
    force = fingertip_force(module.readings, module.sensor, tare, module.times)
    return np.column_stack([np.linalg.norm(force, axis=1), force, haar_features(force)[:, 5]])


def values_of(series):
    return np.array([series[name] for name in SERIES], dtype=float).T


@pytest.mark.parametrize(
    ("tare", "offline"),
    [(0.5, (0.0, 0.5)), ("first", "first"), ("none", "none"), ((1.0, 1.2), (1.0, 1.2))],
)
def test_every_sample_is_returned_if_there_are_few(tare, offline):
    part = signals_of(RECORDING, tare).part(points=N)
    assert (part.start, part.end, part.exact) == (RECORDING.start, RECORDING.end, True)
    for name, module in RECORDING.modules.items():
        series = part.fingers[name]
        assert series["t"] == module.times.tolist()
        np.testing.assert_allclose(values_of(series), expected(module, offline), rtol=1e-5)


@pytest.mark.parametrize("points", [2, 3, 10, 100, 777])
@pytest.mark.parametrize(("start", "end"), [(0.0, 99.0), (2.0, 9.0), (3.33, 3.4), (-5.0, 1.0)])
def test_minima_and_maxima_of_neighbours(points, start, end):
    signals = signals_of(RECORDING)
    part = signals.part(start, end, points)
    exact = signals.part(start, end, N).fingers
    assert (part.start, part.end) == (start, end)
    for name, series in part.fingers.items():
        assert 0 < len(series["t"]) <= 2 * points
        assert (np.diff(series["t"]) >= 0).all()
        every = values_of(exact[name])
        if part.exact:
            np.testing.assert_array_equal(values_of(series), every)
        else:  # extremes of a few more samples at the edges
            assert (np.nanmin(values_of(series), axis=0) <= np.nanmin(every, axis=0)).all()
            assert (np.nanmax(values_of(series), axis=0) >= np.nanmax(every, axis=0)).all()


@pytest.mark.parametrize("points", [3, 50, 100, 400])
@pytest.mark.parametrize("sign", [1, -1])
def test_what_falls_is_drawn_falling_and_what_rises_rising(points, sign):
    """A hand lets go, or grips: a slope and a step, without any stick-slip."""
    times = np.arange(3000) / 150
    press = np.interp(times, [0, 5, 12, 20], [1000, 1000, 300, 250]) - 200 * (times > 15.1)
    readings = np.zeros((3000, 16, 3))
    readings[..., 2] = press[::sign, None]
    falling = Recording("falling", {"thumb": Tactile(sensor("uskin-4x4"), times, readings)})
    part = signals_of(falling, "none").part(points=points)
    assert not part.exact
    moves = sign * np.diff(part.fingers["thumb"]["F_a"])
    assert moves.max() <= 0 and moves.min() < -1000


def test_parts_have_a_sample_on_either_side():
    series = signals_of(RECORDING).part(3.001, 3.001).fingers["thumb"]
    assert series["t"][0] <= 3.001 <= series["t"][-1]
    assert len(series["t"]) in (2, 3)


def test_unknown_values_are_null_and_gaps_are_shown():
    module = RECORDING.modules["thumb"]
    readings = module.readings.astype(float)
    readings[300] = np.nan
    keep = np.ones(N, dtype=bool)
    keep[600:660] = False
    gappy = Tactile(module.sensor, module.times[keep], readings[keep])
    part = signals_of(Recording("gappy", {"thumb": gappy})).part(points=N)
    series = part.fingers["thumb"]
    assert len(series["t"]) == N - 60 + 1
    assert series["F_a"][:3] == pytest.approx([0, 0, 0], abs=1e3)
    decoded = msgspec.json.decode(msgspec.json.encode(part))["fingers"]["thumb"]
    assert decoded["F_a"][300] is decoded["F_a"][600] is decoded["sigma"][0] is None
    assert series["t"][600] == pytest.approx((600 - 0.5 + 30) / 150)
    assert None not in decoded["F_a"][:300]
    coarse = signals_of(Recording("gappy", {"thumb": gappy})).part(points=50).fingers["thumb"]
    assert np.isfinite(values_of(coarse)[:, 0]).all()


def test_modules_without_a_finite_sample():
    tip = sensor("uskin-4x4")
    silent = Tactile(tip, np.empty(0), np.empty((0, 16, 3)))
    blind = Tactile(tip, np.arange(10) / 100, np.full((10, 16, 3), np.nan))
    signals = signals_of(Recording("odd", {"silent": silent, "blind": blind}))
    part = signals.part().fingers
    assert part["silent"]["t"] == part["silent"]["F_a"] == []
    assert np.isnan(part["blind"]["F_a"]).all()
    assert signals.part(5.0, 6.0).exact


@pytest.mark.parametrize(
    ("start", "end", "points", "text"),
    [
        (2.0, 1.0, 100, "an end after the start"),
        (float("nan"), 1.0, 100, "an end after the start"),
        (0.0, float("inf"), 100, "an end after the start"),
        (0.0, 1.0, 1, "points"),
        (0.0, 1.0, 10**6, "points"),
    ],
)
def test_invalid_parts_are_rejected(start, end, points, text):
    with pytest.raises(ValueError, match=text):
        signals_of(RECORDING).part(start, end, points)


def test_a_tare_without_samples_is_rejected():
    for tare in ((50.0, 60.0), "soon"):
        with pytest.raises(ValueError, match=r"^tare"):
            signals_of(RECORDING, tare)


def test_rounding_keeps_six_digits():
    generator = np.random.default_rng(0)
    values = generator.normal(size=1000) * 10.0 ** generator.integers(-20, 20, 1000)
    np.testing.assert_allclose(rounded(values), values, rtol=1e-5)
    usual = generator.normal(size=1000) * 10.0 ** generator.integers(-3, 7, 1000)
    assert all(len(repr(value)) <= 14 for value in rounded(usual).tolist())
    odd = np.array([np.nan, 0.0, np.inf, -np.inf])
    np.testing.assert_array_equal(rounded(odd), odd)


PERIOD = 1 / 150


def force_of(amplitude, noise=0.0, seed=0):
    generator = np.random.default_rng(seed)
    force = np.outer(amplitude, [0.9, 0.3, -0.3])
    return force + generator.normal(0.0, noise, force.shape) if noise else force


def grasp():
    """Closing from 2 to 3 s, a push from 5 to 5.3 s, let go from 8 to 8.4 s."""
    times = np.arange(1500) * PERIOD
    corners = ([0, 2, 3, 5, 5.15, 5.3, 8, 8.4, 10], [0, 0, 100, 100, 140, 100, 100, 0, 0])
    return times, np.interp(times, *corners)


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_changes_are_found_where_they_are(noise):
    times, amplitude = grasp()
    found = change_points(times, force_of(amplitude, noise), PERIOD)
    for corner in (2, 3, 5, 5.3, 8, 8.4):
        assert np.abs(found - corner).min() <= 0.04, corner
    assert len(found) <= 8


def test_a_steady_force_has_none():
    times = np.arange(9000) * PERIOD
    assert len(change_points(times, force_of(np.full(9000, 50.0), 1.0), PERIOD)) <= 3
    assert len(change_points(times, force_of(np.full(9000, 50.0)), PERIOD)) == 0
    assert len(change_points(times, force_of(np.zeros(9000)), PERIOD)) == 0


def test_unknown_forces_are_left_out():
    times, amplitude = grasp()
    force = force_of(amplitude)
    force[:75] = np.nan
    found = change_points(times, force, PERIOD)
    assert np.abs(found - 2).min() <= 0.04
    assert len(change_points(times, np.full_like(force, np.nan), PERIOD)) == 0
    assert len(change_points(times[:3], force[-3:], PERIOD)) == 0
