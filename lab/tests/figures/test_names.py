"""Names of others in figures: they are drawn as they are, never as formulas."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.text import Text

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import summarise
from holdfast.plots.evaluation import draw_evaluation
from holdfast.plots.recording import plot_recording
from holdfast.plots.sensors import plot_hand, plot_sensor
from holdfast.plots.time_series import FingerSeries
from holdfast.sensors import Hand, hand, sensor
from holdfast.synthetic import synthetic_recording
from holdfast_lab.figures.curves import draw_reliability
from holdfast_lab.figures.dots import IntervalEstimate, draw_dots, draw_groups
from holdfast_lab.figures.experiment import draw_experiment, draw_forces
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.figures import draw_courses
from plots.test_evaluation import example_decisions

pytestmark = pytest.mark.slow

NAME = r"$\bad{$"
"""As a formula, it is an error."""
ESTIMATES = {NAME: IntervalEstimate(1.0, 0.5, 1.5), "other": IntervalEstimate(2.0)}
COURSE = TrialCourse([0.0, 1.0, 2.0], [1.0] * 3, [1.0] * 3, [0.0] * 3)


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


def recording():
    made = synthetic_recording(NAME, 1, (NAME, "index"))
    return plot_recording(replace(made, markers=((made.start + 6.0, NAME),)))


def evaluation():
    first, *others = example_decisions(2, names=(NAME, "index"))
    decisions = [replace(first, name=NAME), *others]
    return draw_evaluation(summarise(decisions, n_resamples=10), decisions)


def flat_map():
    given = hand("allegro-uskin")
    modules = {name.replace("thumb", NAME): module for name, module in given.modules.items()}
    return plot_hand(Hand(NAME, modules))


@pytest.mark.parametrize(
    ("draw", "n_names"),
    [
        (recording, 3),
        (evaluation, 2),
        (flat_map, 2),
        (lambda: plot_sensor(replace(sensor("anyskin"), name=NAME)), 1),
        (lambda: draw_forces(series(name=NAME)), 1),
        (lambda: draw_experiment(series(), {NAME: series().labels}, {}), 1),
        (lambda: draw_dots({"x": ESTIMATES}, {NAME}), 1),
        (lambda: draw_groups({"x": {NAME: ESTIMATES}}, "y"), 2),
        (lambda: draw_reliability({NAME: np.array([[0.5, 0.5, 10.0]])}), 1),
        (lambda: draw_courses({NAME: COURSE}), 1),
    ],
)
def test_a_name_with_two_dollars_is_drawn(draw, n_names):
    figure = draw()
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    texts = [text.get_text().replace(r"\$", "$") for text in figure.findobj(Text)]
    assert sum(NAME in text for text in texts) >= n_names
