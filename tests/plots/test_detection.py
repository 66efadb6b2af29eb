"""The figure of estimates returns its axes, to which a user adds."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from holdfast import Model, detect
from holdfast.plots.detection import plot_detection
from holdfast.plots.style import STATE_COLOURS
from holdfast.plots.time_series import equal_runs
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def detection():
    made = synthetic_recording("grasp", 1, ("thumb", "index"))
    return detect(Model.load("builtin:noise-floor"), made)


def test_axes_that_are_given_are_drawn_on(detection):
    given = list(Figure().subplots(2))
    axes = plot_detection(detection, given)
    assert axes == given
    for panel, (finger, trace) in zip(axes, detection.fingers.items(), strict=True):
        assert panel.get_title("left") == finger
        force = np.linalg.norm(trace.force, axis=1)
        np.testing.assert_array_equal(panel.get_lines()[0].get_ydata(), force)
        runs = [run for run in equal_runs(trace.state) if trace.state[run[0]] in STATE_COLOURS]
        assert len(panel.patches) == len(runs)
    words = [text.get_text() for text in axes[0].get_legend().get_texts()]
    assert words == ["STABLE", "UNSTABLE", "NO_CONTACT"]


def test_without_axes_pyplot_makes_them(detection):
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    axes = plot_detection(detection)
    assert axes == plt.gcf().axes
    plt.close("all")


def test_the_number_of_axes_is_that_of_the_fingers(detection):
    with pytest.raises(ValueError, match="2 fingers"):
        plot_detection(detection, [Figure().subplots()])
