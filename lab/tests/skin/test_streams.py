import numpy as np
import pytest

from holdfast.model import Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast_lab.skin.situations import Marked
from holdfast_lab.skin.streams import CHANGE_TIMES, finger_streams

SKIN = sensor("uskin-4x4")
RATE = 100.0
N = 3000


def stream(readings, times=None, situations=("quiet",)):
    times = np.arange(len(readings)) / RATE if times is None else times
    module = Tactile(SKIN, times, readings)
    masks = dict.fromkeys(situations, np.ones(len(readings), dtype=bool))
    marked = Marked(Recording("a", {"thumb": module}), {"thumb": masks})
    return next(finger_streams([marked], Model.load("builtin:any")))


def noise(seed=0):
    return np.random.default_rng(seed).standard_normal((N, 16, 3))


def test_white_noise_does_not_grow_and_a_walk_grows_with_the_root_of_time():
    np.testing.assert_allclose(stream(noise()).changes, 1.0, rtol=0.03)
    lags = np.maximum(np.round(np.array(CHANGE_TIMES) * RATE), 1)
    walk = stream(np.cumsum(noise(), axis=0)).changes
    np.testing.assert_allclose(walk, np.sqrt(lags / lags[0]), rtol=0.1)


@pytest.mark.parametrize(("size", "step"), [(4.0, 1.0), (4.0, 2.0), (30.0, 5.0)])
def test_noise_is_given_in_steps_of_the_readings(size, step):
    rounded = step * np.rint(size * noise() / step)
    assert np.median(stream(rounded).noise_in_steps) == pytest.approx(size / step, rel=0.05)


def test_an_axis_that_never_changes_has_no_noise():
    readings = np.rint(4 * noise())
    readings[:, 3] = 7.0
    assert (stream(readings).noise_in_steps == 0).sum() == 3


def test_repeated_rows_and_unsteady_intervals_are_counted():
    readings = noise()[np.arange(N) // 2]
    times = (np.arange(N) + 0.4 * (np.arange(N) % 2)) / RATE
    seen = stream(readings, times)
    assert seen.repeated == pytest.approx(0.5, abs=0.01)
    assert len(np.unique(seen.intervals.round(6))) == 2


def test_a_tremor_is_seen_in_its_band_and_walking_is_not():
    times = np.arange(N) / RATE
    for rate, share in ((10.0, 1.0), (4.0, 0.0)):
        wave = 50 * np.sin(2 * np.pi * rate * times)[:, None, None] * np.ones((1, 16, 3))
        seen = stream(noise() + wave, situations=("moving",))
        assert seen.tremor == pytest.approx(share, abs=0.02)
        assert seen.motion > 2
    assert stream(noise()).tremor == pytest.approx(0.4, abs=0.1)


def test_a_hold_that_is_pushed_alone_has_no_ordinary_handling():
    seen = stream(noise(), situations=("pushed",))
    assert np.isnan([seen.activity, seen.tremor, *seen.changes]).all()
    assert not len(seen.noise_in_steps)
