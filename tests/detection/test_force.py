import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.detection import Tare, fingertip_force
from holdfast.detection import features as force
from holdfast.detection.features import rest_amplitude, tared_force
from holdfast.errors import RecordingError
from holdfast.recordings import Tactile
from holdfast.sensors import sensor

from . import naive_features as naive

CURVED = sensor("uskin-curved")
PERIOD = 1 / CURVED.rate


def readings(n, seed=0, which=CURVED):
    return np.random.default_rng(seed).integers(20_000, 40_000, size=(n, which.n_taxels, 3))


def by_loop(values, tare, times=None, which=CURVED):
    period = 1 / which.rate
    times = np.arange(len(values)) * period if times is None else times
    baseline, first = naive.first_mean(values, times, tare, period)
    rows = [naive.force(sample, baseline, which.rotations) for sample in values]
    return np.array([[np.nan] * 3] * first + rows[first:]), first


@pytest.mark.parametrize("name", ["uskin-curved", "uskin-4x4", "gtac", "papillarray"])
@pytest.mark.parametrize("kind", [np.float64, np.float32, np.uint16])
def test_equals_the_loop(name, kind):
    which = sensor(name)
    n = int(0.5 * which.rate)
    values = readings(n + 12, which=which).astype(kind)
    expected, first = by_loop(values, 0.5, which=which)
    assert first == n
    found = fingertip_force(values, which)
    assert np.allclose(found, expected, rtol=1e-12, atol=1e-6, equal_nan=True)


def test_first():
    values = readings(5)
    found = fingertip_force(values, CURVED, "first")
    assert (found[0] == 0).all()
    expected = [naive.force(sample, values[0], CURVED.rotations) for sample in values]
    assert np.allclose(found, expected, rtol=1e-12, atol=1e-6)


def test_none():
    values = readings(5)
    expected = [naive.force(v, np.zeros((30, 3)), CURVED.rotations) for v in values]
    assert np.allclose(fingertip_force(values, CURVED, "none"), expected, rtol=1e-12)


@pytest.mark.parametrize("given", ["0.1:0.2", (0.1, 0.2)])
def test_interval(given):
    values = readings(60)
    times = np.arange(60) * PERIOD
    inside = (times >= 0.1) & (times < 0.2)
    baseline = values[inside].mean(axis=0)
    expected = [naive.force(sample, baseline, CURVED.rotations) for sample in values]
    found = fingertip_force(values, CURVED, given)
    assert np.allclose(found, expected, rtol=1e-12, atol=1e-6)


@pytest.mark.parametrize("n", [0, 10])
def test_an_interval_without_samples_is_refused(n):
    with pytest.raises(ValueError, match="5:6"):
        fingertip_force(readings(n), CURVED, (5.0, 6.0))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_no_part_of_the_tare(bad):
    values = readings(100).astype(float)
    values[:3, 4, 1] = values[50, 0, 0] = values[90, 29, 2] = bad
    expected, first = by_loop(values, 0.5)
    assert first == 78  # half a second from the first finite sample
    expected[90] = np.nan
    found = fingertip_force(values, CURVED)
    assert np.allclose(found, expected, rtol=1e-12, atol=1e-6, equal_nan=True)


def test_first_is_the_first_finite_sample():
    values = readings(6).astype(float)
    values[0, 0, 0] = np.nan
    found = fingertip_force(values, CURVED, "first")
    assert np.isnan(found[0]).all()
    assert (found[1] == 0).all()


def test_no_finite_sample_at_all():
    with pytest.raises(ValueError, match=r"0.5"):
        fingertip_force(np.full((100, 30, 3), np.nan), CURVED)


def test_a_tare_shorter_than_a_period_takes_one_sample():
    values = readings(4)
    found = fingertip_force(values, CURVED, 1e-4)
    assert np.isnan(found[0]).all()
    assert np.array_equal(found[1:], fingertip_force(values, CURVED, "first")[1:])


@pytest.mark.parametrize("tare", ["first", "none"])
def test_no_finite_sample_gives_no_force(tare):
    assert np.isnan(fingertip_force(np.full((9, 30, 3), np.nan), CURVED, tare)).all()


@given(k=st.integers(1, 119), tare=st.sampled_from([0.1, 0.5, "first", "none"]))
def test_the_future_changes_nothing(k, tare):
    values = readings(120).astype(float)
    later = values.copy()
    later[k:] += 500.0
    found = fingertip_force(values, CURVED, tare)[:k]
    assert np.array_equal(fingertip_force(later, CURVED, tare)[:k], found, equal_nan=True)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((9, 24, 3), "uskin-curved"),
        ((9, 30, 2), "uskin-curved"),
        ((30, 3), "uskin-curved"),
    ],
)
def test_refuses_other_shapes(shape, message):
    with pytest.raises(RecordingError, match=message):
        fingertip_force(np.zeros(shape), CURVED)


@pytest.mark.parametrize("n", [8, 10])
def test_refuses_other_times(n):
    with pytest.raises(RecordingError, match="times"):
        fingertip_force(readings(9), CURVED, times=np.arange(n))


def module(values, which=CURVED, times=None):
    times = np.arange(len(values)) / which.rate if times is None else times
    return Tactile(which, times, values)


@pytest.mark.parametrize("tare", [0.5, "first", "none", (0.1, 0.4)])
@pytest.mark.parametrize("kind", [np.uint16, np.float32])
def test_a_module_has_the_same_force_in_blocks(tare, kind, monkeypatch):
    monkeypatch.setattr(force, "BLOCK_SAMPLES", 7)
    made = module(readings(100).astype(kind))
    found = tared_force(made, tare)
    expected = fingertip_force(made.readings, CURVED, tare)
    assert np.array_equal(found.force, expected, equal_nan=True)
    assert found.first == np.flatnonzero(np.isfinite(expected[:, 0]))[0]
    assert np.array_equal(found.amplitude, np.linalg.norm(expected, axis=1), equal_nan=True)


def test_the_rate_says_how_many_samples_a_tare_takes():
    made = module(readings(100), times=np.arange(100) / 100)
    assert tared_force(made, 0.105).first == 11  # up to half a period of 150 Hz before 0.105 s
    assert tared_force(made, 0.105, rate=50.0).first == 10
    assert tared_force(made, 0.101, rate=1000.0).first == 11


def test_the_offline_baseline_holds_for_the_samples_before_it_too():
    values = readings(100).astype(float)
    values[:2, 0, 0] = np.nan
    found = tared_force(module(values), 0.5, offline=True)
    live = tared_force(module(values), 0.5)
    assert np.array_equal(found.baseline, live.baseline)
    assert (found.first, live.first) == (0, 77)
    assert np.isnan(found.force[:2]).all()
    assert np.isfinite(found.force[2:]).all()
    assert np.array_equal(found.force[77:], live.force[77:])


def test_amplitude_at_rest():
    values = readings(100).astype(float)
    values[3, 0, 0] = np.nan
    found = rest_amplitude(module(values), Tare.parse(0.5), CURVED.rate)
    baseline = np.delete(values[:75], 3, axis=0).mean(axis=0)
    loop = [np.linalg.norm(naive.force(v, baseline, CURVED.rotations)) for v in values[:75]]
    assert np.allclose(found, np.delete(loop, 3), rtol=1e-12, atol=1e-6)
