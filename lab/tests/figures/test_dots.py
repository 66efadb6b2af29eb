from figures.drawing import drawn
from holdfast_lab.figures.dots import IntervalEstimate, draw_dots


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
    dots = {
        line.get_ydata()[0]: line.get_xdata()[0] for line in left.lines if line.get_marker() == "o"
    }
    assert (dots[2], dots[3]) == (90.0, 92.0)
    bars = [path.vertices[:, 0].tolist() for each in left.collections for path in each.get_paths()]
    assert [88.0, 91.0] in bars
    assert {line.get_ydata()[0] for line in right.lines} == {0, 2}
