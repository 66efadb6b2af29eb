import numpy as np
import pytest

from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast_lab.skin.readout import readout_figures
from holdfast_lab.skin.situations import Marked

SKIN = sensor("uskin-4x4")
N = 20000


def marked(readings, mask=None):
    module = Tactile(SKIN, np.arange(len(readings)) / 100, readings)
    mask = np.ones(len(readings), dtype=bool) if mask is None else mask
    return [Marked(Recording("a", {"thumb": module}), {"thumb": {"quiet": mask}})]


def noise(seed=0, shape=(N, 16, 3)):
    return np.random.default_rng(seed).standard_normal(shape)


def test_white_noise():
    figures = readout_figures(marked(noise() * [1.0, 1.0, 2.0]), "quiet")
    assert figures.n_fingers == 1
    np.testing.assert_allclose(figures.by_lag, [1, 1, 1, 1], rtol=0.02)
    assert figures.second == pytest.approx(np.sqrt(3), rel=0.02)
    assert figures.normal == pytest.approx(2.0, rel=0.02)
    np.testing.assert_allclose(figures.neighbours, 0.0, atol=0.02)
    assert figures.repeated == figures.stale == 0


def test_averaged_noise_grows_with_the_root_of_the_lag():
    white = np.cumsum(noise(), axis=0)
    figures = readout_figures(marked((white[4:] - white[:-4]) / 4), "quiet")
    np.testing.assert_allclose(figures.by_lag, [1, 2**0.5, 2, 2], rtol=0.03)
    assert figures.second == pytest.approx(np.sqrt(2), rel=0.03)


def test_neighbours_that_move_together_are_correlated():
    together = noise(1, (N, 1, 3)) * [1.0, 0.0, 3.0]
    figures = readout_figures(marked(noise() + together), "quiet")
    np.testing.assert_allclose(figures.neighbours, [0.5, 0.0, 0.9], atol=0.03)


def test_taxels_that_are_read_together_are_correlated():
    place = np.arange(16) % 8
    readings = noise() + noise(2, (N, 8, 3))[:, place]
    figures = readout_figures(marked(readings), "quiet")
    np.testing.assert_allclose(figures.in_turn, [0.0, 0.5], atol=0.03)
    assert abs(figures.neighbours[0]) < 0.03


def test_repeats_of_samples_and_of_single_taxels_are_counted_apart():
    readings = noise()
    readings[1::2, 3] = readings[::2, 3]  # one taxel of 16, in every second sample
    readings[5::10] = readings[4::10]  # a tenth of all samples
    figures = readout_figures(marked(readings), "quiet")
    assert figures.repeated == pytest.approx(0.1, abs=1e-3)
    assert figures.stale == pytest.approx(0.4 / 0.9 / 16, abs=1e-3)


def test_only_long_parts_of_the_situation_are_used():
    mask = np.zeros(N, dtype=bool)
    mask[10:20] = True
    assert readout_figures(marked(noise(), mask), "quiet") is None
    assert readout_figures(marked(noise()), "moving") is None
    mask[1000:5000] = True
    readings = noise()
    readings[~mask] *= 100.0
    assert readout_figures(marked(readings, mask), "quiet").second == pytest.approx(1.73, rel=0.03)
