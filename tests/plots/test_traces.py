import io
import subprocess
import sys

import numpy as np
import pytest
from matplotlib.colors import to_hex

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Phase
from holdfast.features import Tare
from holdfast.plots.curves import Curve, draw_alarms, draw_lines, draw_reliability
from holdfast.plots.dots import IntervalEstimate, draw_dots, draw_groups
from holdfast.plots.recording import COMPONENT_COLOURS
from holdfast.plots.style import PAPER, styles_of
from holdfast.plots.traces import (
    PHASE_COLOURS,
    STATE_COLOURS,
    Trace,
    draw_experiment,
    draw_features,
    draw_forces,
    runs,
    trace_of,
)
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import sensor


def trace(n=200, seed=0, **options):
    rng = np.random.default_rng(seed)
    force = rng.normal(0, 100, (n, 3))
    quarter = n // 4
    phases = np.repeat(["free", "closing", "locked", ""], quarter)
    labels = np.repeat([NO_CONTACT, UNSTABLE, STABLE, UNKNOWN], quarter)
    sigma = np.abs(rng.normal(2, 0.1, n))
    sigma[:5] = np.nan
    amplitude = np.linalg.norm(force, axis=1)
    made = Trace(
        "ball-1, index", 0.01 * np.arange(n), force, amplitude, amplitude / 2, sigma, labels, phases
    )
    return made._replace(**options)


def drawn(figure):
    """Drawing is where most warnings come from; they are errors here."""
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure


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


def test_forces_are_those_given():
    given = trace()
    axes = drawn(draw_forces(given)).axes[0]
    for column, name in enumerate(("F_x", "F_y", "F_z")):
        values = lines(axes)[COMPONENT_COLOURS[name].lower()]
        np.testing.assert_array_equal(values, given.force[:, column])
    assert axes.get_ylabel() == "fingertip force [counts]"
    assert axes.get_xlabel() == "time [s]"


def test_phases_are_shaded_from_their_first_sample_to_the_next():
    axes = drawn(draw_forces(trace())).axes[0]
    spans = [
        (patch.get_x(), patch.get_x() + patch.get_width(), to_hex(patch.get_facecolor()))
        for patch in axes.patches
    ]
    expected = [(0, 0.5, Phase.FREE), (0.5, 1, Phase.CLOSING), (1, 1.5, Phase.LOCKED)]
    assert len(spans) == 3
    for span, (start, end, phase) in zip(spans, expected, strict=True):
        assert span[:2] == pytest.approx((start, end))
        assert span[2] == PHASE_COLOURS[phase]
    assert [text.get_text() for text in axes.texts] == ["free", "closing", "locked"]


def test_a_narrow_phase_is_named_in_the_legend_alone():
    phases = np.array(["locked"] * 195 + ["slipping"] * 5)
    figure = drawn(draw_forces(trace(phases=phases)))
    assert [text.get_text() for text in figure.axes[0].texts] == ["locked"]
    told = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
    assert {"locked", "slipping"} <= told


def test_features_are_those_given():
    given = trace(unit="N")
    forces, amplitude, sigma, labels = drawn(draw_features(given)).axes
    np.testing.assert_array_equal(amplitude.lines[0].get_ydata(), given.amplitude)
    np.testing.assert_array_equal(amplitude.lines[1].get_ydata(), given.mean)
    np.testing.assert_array_equal(sigma.lines[0].get_ydata(), given.sigma)
    assert forces.get_ylabel() == "$F_{tip}$ [N]"
    assert strips(labels) == {
        "label": {
            (0.0, 0.5, STATE_COLOURS[NO_CONTACT]),
            (0.5, 1.0, STATE_COLOURS[UNSTABLE]),
            (1.0, 1.5, STATE_COLOURS[STABLE]),
        }
    }


def test_predictions_are_drawn_below_each_other_with_their_share_right():
    given = trace()
    late = np.roll(given.labels, 10)
    late[:10] = UNKNOWN
    figure = drawn(draw_experiment(given, {"LogReg": late, "SVM": given.labels}, span=(0.2, 1.2)))
    axes = figure.axes[2]
    assert [text.get_text() for text in axes.get_yticklabels()] == [
        "label", "LogReg\n92.9 % right", "SVM\n100.0 % right",
    ]  # fmt: skip
    assert strips(axes)["LogReg"] == {
        (0.1, 0.6, STATE_COLOURS[NO_CONTACT]),
        (0.6, 1.1, STATE_COLOURS[UNSTABLE]),
        (1.1, 1.6, STATE_COLOURS[STABLE]),
    }
    assert axes.get_xlim() == (0.2, 1.2)


def test_sigma_with_high_peaks_has_a_logarithmic_axis():
    given = trace()
    peak = given.sigma.copy()
    peak[100] = 1000.0
    assert drawn(draw_features(given)).axes[2].get_yscale() == "linear"
    assert drawn(draw_features(given._replace(sigma=peak))).axes[2].get_yscale() == "log"


@pytest.mark.parametrize("n", [0, 4])
def test_a_trace_of_nothing_is_drawn(n):
    given = trace(n)
    for figure in (draw_forces(given), draw_features(given), draw_experiment(given, {})):
        drawn(figure)


def test_a_trace_without_labels_and_phases_is_drawn():
    given = trace(labels=np.zeros(200, dtype=int), phases=np.full(200, ""))
    axes = drawn(draw_experiment(given, {"SVM": given.labels})).axes[2]
    assert axes.get_yticklabels()[1].get_text() == "SVM\nno label"


def test_long_recordings_keep_their_peaks():
    given = trace(40_000)
    values = lines(drawn(draw_forces(given)).axes[0])[COMPONENT_COLOURS["F_x"].lower()]
    assert len(values) < 5000
    assert values.max() == given.force[:, 0].max()


def test_trace_of_a_recording():
    grid = sensor("uskin-4x4")
    times = 0.01 * np.arange(100)
    readings = np.zeros((100, grid.n_taxels, 3))
    readings[50:, :, 2] = 10.0
    label = Label(0.5, 0.9, "STABLE")
    truth = Truth(times[::2], {"phase": np.repeat(["free", "locked"], 25)})
    module = Tactile(grid, times, readings, labels=(label,))
    found = trace_of(Recording("one", {"index": module}, truth=truth), "index", Tare.parse("0.2"))
    assert found.name == "one, index"
    assert np.isnan(found.sigma[:20]).all() and found.sigma[49:70].max() > 0
    np.testing.assert_allclose(found.amplitude[50:], 10.0 * grid.n_taxels)
    np.testing.assert_array_equal(found.phases, np.repeat(["free", "locked"], 50))
    np.testing.assert_array_equal(np.flatnonzero(found.labels == STABLE), np.arange(50, 90))


def test_runs():
    assert list(runs(np.array([]))) == []
    assert list(runs(np.array(["a", "b", "b"]))) == [(0, 1), (1, 3)]


X = np.array([4.0, 8.0, 14.0])


def test_lines_bands_and_the_papers():
    curve = Curve(X, np.array([90.0, 91, 92]), np.array([89.0, 90, 91]), np.array([91.0, 92, 93]))
    figure = drawn(
        draw_lines(
            {"Acc [%]": {"ours": curve, PAPER: Curve(X, X + 80)}, "FNR [%]": {"b": curve}}, "N_w"
        )
    )
    axes = figure.axes[0]
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), curve.y)
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), X + 80)
    assert axes.lines[1].get_color() == "black"
    (band,) = axes.collections
    assert {91.0, 93.0} <= set(band.get_paths()[0].vertices[:, 1])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["4", "8", "14"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("N_w", "Acc [%]")
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert told == ["ours", "b", PAPER]


def test_lines_over_many_values_on_a_logarithmic_axis():
    x = np.geomspace(0.01, 100, 30)
    axes = drawn(draw_lines({"y": {"a": Curve(x, x)}}, "x", log=True)).axes[0]
    assert axes.get_xscale() == "log"
    assert "0.01" in [label.get_text() for label in axes.get_xticklabels()]


def test_alarms_without_a_false_one_stand_at_zero():
    curve = Curve(np.array([0.0, 0.5, 10.0]), np.array([np.inf, 40.0, 5.0]), chosen=1)
    axes = drawn(draw_alarms({"missed [%]": {"a": curve}}, bar=1.0)).axes[0]
    line = next(each for each in axes.lines if len(each.get_xdata()) == 3)
    floor = line.get_xdata()[0]
    assert 0 < floor < 0.5
    assert axes.xaxis.get_major_formatter()(floor, 0) == "0"
    np.testing.assert_array_equal(line.get_ydata(), [np.nan, 40.0, 5.0])
    (chosen,) = (each for each in axes.lines if np.shape(each.get_xdata()) == (1,))
    assert (chosen.get_xdata()[0], chosen.get_ydata()[0]) == (0.5, 40.0)


def test_alarms_of_nothing():
    drawn(draw_alarms({}))
    drawn(draw_alarms({"missed": {}}))
    drawn(draw_alarms({"missed": {"a": Curve(np.zeros(2), np.zeros(2))}}))


def test_reliability():
    table = np.array([[0.1, 0.2, 30], [0.9, 0.8, 10]])
    figure = drawn(draw_reliability({"a": table, "b": np.empty((0, 3))}, {"a": "Brier 0.1"}))
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), table[:, 1])
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), [75.0, 25.0])
    told = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert told == ["a, Brier 0.1", "b"]


def test_dots_are_sorted_by_the_first_panel():
    figure = drawn(
        draw_dots(
            {
                "by recording": {
                    "a": IntervalEstimate(90.0, 88.0, 91.0, 95.0),
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
    assert [line.get_xdata()[0] for line in left.lines if line.get_marker() == "D"] == [95.0]
    bars = [path.vertices[:, 0].tolist() for each in left.collections for path in each.get_paths()]
    assert [88.0, 91.0] in bars
    assert {line.get_ydata()[0] for line in right.lines} == {0, 2}


def test_groups_stand_in_their_place():
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


def test_eighteen_methods_look_different():
    styles = styles_of(f"method {k}" for k in range(18))
    assert len(set(styles.values())) == 19  # and the paper's
    assert styles_of(["a", PAPER, "b"])["b"] == styles_of(["a", "b"])["b"]


def test_no_global_state_is_touched():
    """pyplot keeps every figure that it makes until somebody closes it."""
    program = (
        "import sys; from holdfast.plots import curves, dots, traces\n"
        "curves.draw_lines({}, 'x'); dots.draw_dots({})\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
