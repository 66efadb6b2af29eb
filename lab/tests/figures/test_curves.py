import numpy as np

from figures.drawing import drawn
from holdfast.plots.style import PAPER
from holdfast_lab.figures.curves import PlottedCurve, draw_alarms, draw_lines

X = np.array([4.0, 8.0, 14.0])


def test_lines_have_bands_and_the_paper_is_black():
    curve = PlottedCurve(
        X, np.array([90.0, 91, 92]), np.array([89.0, 90, 91]), np.array([91.0, 92, 93])
    )
    figure = drawn(
        draw_lines(
            {"Acc [%]": {"ours": curve, PAPER: PlottedCurve(X, X + 80)}, "FNR [%]": {"b": curve}},
            "N_w",
            per_row=2,
        )
    )
    axes = figure.axes[0]
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), curve.y)
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), X + 80)
    assert axes.lines[1].get_color() == "black"
    (band,) = axes.collections
    assert {91.0, 93.0} <= set(band.get_paths()[0].vertices[:, 1])


def test_a_rate_of_zero_false_alarms_is_marked_zero():
    curve = PlottedCurve(np.array([0.0, 0.5, 10.0]), np.array([np.inf, 40.0, 5.0]), chosen=1)
    axes = drawn(draw_alarms({"missed [%]": {"a": curve}}, bar=1.0)).axes[0]
    line = next(each for each in axes.lines if len(each.get_xdata()) == 3)
    floor = line.get_xdata()[0]
    assert 0 < floor < 0.5
    assert axes.xaxis.get_major_formatter()(floor, 0) == "0"
    np.testing.assert_array_equal(line.get_ydata(), [np.nan, 40.0, 5.0])
    (chosen,) = (each for each in axes.lines if np.shape(each.get_xdata()) == (1,))
    assert (chosen.get_xdata()[0], chosen.get_ydata()[0]) == (0.5, 40.0)
