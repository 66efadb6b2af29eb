import io

import numpy as np

from holdfast_lab.figures.dots import IntervalEstimate
from holdfast_lab.trial.figures import (
    Distribution,
    TradeOff,
    draw_distributions,
    draw_trade_offs,
)


def drawn(figure):
    """Drawing causes most warnings; they are errors here."""
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


def test_a_curve_ends_at_the_share_of_finite_values():
    values = {"a": np.array([0.0, 1.0, 2.0, np.inf]), "b": np.array([])}
    figure = drawn(draw_distributions({"slip [mm]": Distribution(values, 0.1, 10.0, 3.0)}))
    (axes,) = figure.axes
    steps = max(axes.lines, key=lambda line: len(line.get_xdata()))
    assert list(steps.get_ydata()) == [0.0, 25.0, 50.0, 75.0, 75.0]
    assert steps.get_xdata()[1] == 0.1  # a zero is drawn at the floor
    assert [3.0, 3.0] in [list(line.get_xdata()) for line in axes.lines]


def test_a_trade_off_has_both_intervals():
    one = TradeOff(IntervalEstimate(1.4, 1.3, 1.5), IntervalEstimate(20.0, 10.0, 30.0))
    none = TradeOff(IntervalEstimate(None), IntervalEstimate(20.0))
    figure = drawn(draw_trade_offs({"all": {"a": one, "b": none}}, "x", "y", (1.5, 5.0)))
    (axes,) = figure.axes
    segments = [path.vertices.tolist() for each in axes.collections for path in each.get_paths()]
    assert [[1.3, 20.0], [1.5, 20.0]] in segments
    assert [[1.4, 10.0], [1.4, 30.0]] in segments
    assert len(axes.lines) == 1
