import numpy as np

from figures.drawing import drawn
from holdfast_lab.trial.figures import (
    Distribution,
    draw_distributions,
)


def test_a_curve_ends_at_the_share_of_finite_values():
    values = {"a": np.array([0.0, 1.0, 2.0, np.inf]), "b": np.array([])}
    figure = drawn(draw_distributions({"slip [mm]": Distribution(values, 0.1, 10.0, 3.0)}))
    (axes,) = figure.axes
    steps = max(axes.lines, key=lambda line: len(line.get_xdata()))
    assert list(steps.get_ydata()) == [0.0, 25.0, 50.0, 75.0, 75.0]
    assert steps.get_xdata()[1] == 0.1  # a zero is drawn at the floor
    assert [3.0, 3.0] in [list(line.get_xdata()) for line in axes.lines]
