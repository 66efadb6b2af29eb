import numpy as np
import pytest

from holdfast.recordings import Tactile
from holdfast.sensors import sensor
from holdfast_lab.skin.families import family_features, finger_of

RATE = 100.0
SKIN = sensor("uskin-4x4")


def grip(seed=0, n=400, noise=1.0):
    """Counts of a pad that is pressed, released at the end, and sheared to and fro."""
    generator = np.random.default_rng(seed)
    times = np.arange(n) / RATE
    press = np.where(times < times[-1] - 0.3, 500.0, 0.0)
    course = np.stack([80 * np.sin(5 * times), 30 * np.sin(9 * times), press], axis=1)
    shares = generator.uniform(0.5, 1.5, 16)
    return course[:, None] * shares[:, None] + noise * generator.standard_normal((n, 16, 3))


def features(readings, skin=SKIN):
    times = np.arange(len(readings)) / RATE
    return family_features(finger_of(Tactile(skin, times, readings), RATE))


def test_features_have_no_unit():
    readings = grip()
    plain, scaled = features(readings), features(7.0 * readings)
    for name, values in plain.items():
        np.testing.assert_allclose(scaled[name], values, rtol=1e-6, atol=1e-9, err_msg=name)


def test_a_constant_reading_of_each_taxel_changes_nothing():
    readings = grip()
    offsets = np.random.default_rng(1).uniform(-1e3, 1e3, (16, 3))
    plain, moved = features(readings), features(readings + offsets)
    for name, values in plain.items():
        np.testing.assert_allclose(moved[name], values, rtol=1e-6, atol=1e-9, err_msg=name)


def test_all_families_are_there_and_known_after_their_windows():
    named = features(grip())
    families = {name.split(" ")[0] for name in named}
    assert families == {"A", "B", "C", "D", "txd2", "W9"}
    for name, values in named.items():
        assert values.shape == (400,), name
        assert np.isfinite(values[60:]).all(), name


def test_second_differences_of_white_noise_are_those_of_white_noise():
    readings = np.random.default_rng(2).standard_normal((4000, 16, 3))
    named = features(readings)
    for step in ("17", "33", "67", "133"):
        ratio = np.exp(np.nanmedian(named[f"txd2 log d2g/noise [{step} ms]"])) - 0.1
        assert 0.95 < ratio < 1.25  # the noise is the least of many blocks


@pytest.mark.parametrize("seconds", [0.017, 0.067])
def test_second_differences_are_those_of_a_loop(seconds):
    readings = grip(seed=3)
    finger = finger_of(Tactile(SKIN, np.arange(400) / RATE, readings), RATE)
    step = round(seconds * RATE)
    turned = np.einsum("iab,kib->kia", SKIN.rotations, readings)
    for k in (2 * step, 50, 399):
        squares = 0.0
        for i in range(16):
            second = turned[k, i] - 2 * turned[k - step, i] + turned[k - 2 * step, i]
            squares += second @ second
        shown = family_features(finger)[f"txd2 log d2g/L [{1e3 * seconds:g} ms]"][k]
        assert shown == pytest.approx(np.log(np.sqrt(squares) / finger.taxel_load[k] + 1e-3))


def test_a_common_motion_is_no_motion_of_single_taxels():
    """All taxels with one load: they follow the common motion, and nothing is opposed."""
    times = np.arange(300) / RATE
    course = np.stack([50 * times, np.zeros(300), np.where(times < 2.5, 400.0, 0.0)], axis=1)
    readings = np.repeat(course[:, None], 16, axis=1)
    readings += 1e-3 * np.random.default_rng(4).standard_normal(readings.shape)
    named = features(readings)
    assert np.nanmax(named["D log |dg - w dF|/|dF| [67 ms]"][20:240]) < np.log(0.01)
    assert np.nanmax(named["D load opposed [67 ms]"][20:240]) < 0.01
