import numpy as np
import pytest
from matplotlib.colors import to_hex

from figures.drawing import drawn
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.plots.style import (
    COMPONENT_COLOURS,
    STATE_COLOURS,
)
from holdfast.plots.time_series import FingerSeries
from holdfast_lab.figures.experiment import draw_experiment, draw_forces

pytestmark = pytest.mark.slow


def series(n=200, seed=0, **options):
    rng = np.random.default_rng(seed)
    force = rng.normal(0, 100, (n, 3))
    quarter = n // 4
    phases = np.repeat(["free", "closing", "locked", ""], quarter)
    labels = np.repeat([NO_CONTACT, UNSTABLE, STABLE, UNKNOWN], quarter)
    sigma = np.abs(rng.normal(2, 0.1, n))
    sigma[:5] = np.nan
    amplitude = np.linalg.norm(force, axis=1)
    made = FingerSeries(
        "ball-1, index", 0.01 * np.arange(n), force, amplitude, amplitude / 2, sigma, labels, phases
    )
    return made._replace(**options)


def lines(axes):
    return {to_hex(line.get_color()): line.get_ydata() for line in axes.lines}


def strips(axes):
    """Colours of the bars of each strip, with their starts and ends, by name."""
    names = [label.get_text().split("\n")[0] for label in axes.get_yticklabels()]
    found = {name: set() for name in names}
    for bars in axes.collections:
        for path in bars.get_paths():
            (left, low), (right, high) = path.get_extents().get_points()
            colour = to_hex(bars.get_facecolor()[0])
            found[names[round((low + high) / 2)]].add((round(left, 6), round(right, 6), colour))
    return found


def test_predictions_are_strips_with_their_accuracy():
    given = series()
    late = np.roll(given.labels, 10)
    late[:10] = UNKNOWN
    predicted = {"LogReg": late, "SVM": given.labels}
    stable = {"LogReg": np.linspace(0, 1, 200), "SVM": np.full(200, 0.25)}
    figure = drawn(draw_experiment(given, predicted, stable, span=(0.2, 1.2)))
    first, second = (line.get_ydata() for line in figure.axes[2].lines[:2])
    assert (first[-1], set(second)) == (1.0, {0.25})
    axes = figure.axes[3]
    assert [text.get_text() for text in axes.get_yticklabels()] == [
        "label", "LogReg\n92.9 % correct", "SVM\n100.0 % correct",
    ]  # fmt: skip
    assert strips(axes)["LogReg"] == {
        (0.1, 0.6, STATE_COLOURS[NO_CONTACT]),
        (0.6, 1.1, STATE_COLOURS[UNSTABLE]),
        (1.1, 1.6, STATE_COLOURS[STABLE]),
    }
    assert axes.get_xlim() == (0.2, 1.2)


def test_long_recordings_keep_their_peaks():
    given = series(40_000)
    values = lines(drawn(draw_forces(given)).axes[0])[COMPONENT_COLOURS["F_x"].lower()]
    assert len(values) < 5000
    assert values.max() == given.force[:, 0].max()
