from dataclasses import replace

import numpy as np
import pytest

from holdfast.detection import fingertip_force, haar_features
from holdfast.plots.recording import plot_recording
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def grasp():
    return synthetic_recording("grasp", 1, ("thumb", "index"))


def drawn(axes):
    """The longest line in each colour."""
    lines = sorted(axes.get_lines(), key=lambda line: len(line.get_xdata()))
    return {line.get_color(): line for line in lines}


def titles(figure):
    return [axes.get_title("left") for axes in figure.axes if axes.get_title("left")]


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_forces_and_sigma_are_drawn_unchanged(grasp):
    figure = plot_recording(grasp)
    assert titles(figure) == ["thumb", "index"]
    assert [axes.get_ylabel() for axes in figure.axes] == ["force [counts]", "σ [counts]"] * 2
    thumb = grasp.modules["thumb"]
    force = fingertip_force(thumb.readings, thumb.sensor, 0.5, thumb.times)
    forces = drawn(figure.axes[0])
    for axis, colour in enumerate(("#0072B2", "#E69F00", "#CC79A7")):
        np.testing.assert_array_equal(forces[colour].get_ydata(), force[:, axis])
    np.testing.assert_allclose(forces["#000000"].get_ydata(), np.linalg.norm(force, axis=1))
    sigma = drawn(figure.axes[1])["#333333"].get_ydata()
    np.testing.assert_array_equal(sigma, haar_features(force)[:, 5])


def test_slip_is_drawn_if_it_is_known(grasp):
    times = grasp.modules["thumb"].times
    truth = Truth(times, {}, {"thumb": {"slip_speed": 0.001 * times}})
    figure = plot_recording(replace(grasp, truth=truth))
    assert figure.axes[2].get_ylabel() == "slip [mm/s]"
    np.testing.assert_allclose(drawn(figure.axes[2])["#333333"].get_ydata(), times)
    assert [text.get_text() for text in figure.axes[5].texts] == ["slip not known"]


def test_a_gap_interrupts_the_curves(grasp):
    thumb = grasp.modules["thumb"]
    times = thumb.times + np.where(np.arange(thumb.n_samples) < 700, 0, 1.0)
    gapped = replace(thumb, times=times, labels=())
    figure = plot_recording(Recording("gapped", {"thumb": gapped}))
    force = drawn(figure.axes[0])["#0072B2"].get_ydata()
    assert np.isnan(force[700])
    assert np.isfinite(force[701])
    sigma = drawn(figure.axes[1])["#333333"].get_ydata()
    assert np.isnan(sigma[700:714]).all()
    assert np.isfinite(sigma[714])


@pytest.mark.parametrize("readings", [np.full((1, 5, 3), 7.0), np.full((60, 5, 3), np.nan)])
def test_recordings_without_curves_are_drawn(readings, tmp_path):
    module = Tactile(sensor("anyskin"), np.arange(len(readings)) / 100, readings, "N")
    figure = plot_recording(Recording("odd", {"finger1": module}))
    assert figure.axes[0].get_ylabel() == "force [N]"
    figure.savefig(tmp_path / "a.png")
