import io

import numpy as np

from holdfast_lab.figures.dots import IntervalEstimate, draw_dots, draw_groups


def drawn(figure):
    """Drawing causes most warnings; they are errors here."""
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


def test_dots_are_sorted_by_the_first_panel():
    figure = drawn(
        draw_dots(
            {
                "by recording": {
                    "a": IntervalEstimate(90.0, 88.0, 91.0),
                    "b": IntervalEstimate(92.0),
                    "c": IntervalEstimate(None),
                },
                "by object": {"a": IntervalEstimate(80.0), "d": IntervalEstimate(85.0)},
            },
            strong={"b"},
        )
    )
    left, right = figure.axes
    names = [label.get_text() for label in left.get_yticklabels()]
    assert names == ["d", "c", "a", "b"]
    assert [label.get_fontweight() for label in left.get_yticklabels()][-1] == "bold"
    dots = {
        line.get_ydata()[0]: line.get_xdata()[0] for line in left.lines if line.get_marker() == "o"
    }
    assert (dots[2], dots[3]) == (90.0, 92.0)
    bars = [path.vertices[:, 0].tolist() for each in left.collections for path in each.get_paths()]
    assert [88.0, 91.0] in bars
    assert {line.get_ydata()[0] for line in right.lines} == {0, 2}


def test_groups_are_side_by_side():
    values = {"low": IntervalEstimate(5.0, 4.0, 6.0), "high": IntervalEstimate(9.0)}
    figure = drawn(
        draw_groups({"force": {"a": values, "b": {"high": IntervalEstimate(1.0)}}}, "wrong [%]")
    )
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_xticklabels()] == ["low", "high"]
    first, second = (line for line in axes.lines if line.get_linestyle() == "None")
    np.testing.assert_array_equal(np.round(first.get_xdata()), [0, 1])
    np.testing.assert_array_equal(first.get_ydata(), [5.0, 9.0])
    assert round(second.get_xdata()[0]) == 1 and second.get_xdata()[0] > first.get_xdata()[1]
    assert axes.get_ylabel() == "wrong [%]"
