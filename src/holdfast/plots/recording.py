"""Figure of a recording over time, as figures 3 and 5 of the paper: forces, sigma, labels, slip."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from holdfast.detection import DEFAULT_WINDOW, Model, Tare
from holdfast.plots.slips import (
    DECIDED_ALPHA,
    SLIP_COLOUR,
    SlipDecisionSeries,
    draw_slip_decisions,
    draw_slip_speed,
    slip_series,
)
from holdfast.plots.style import (
    COMPONENT_COLOURS,
    FONT_SIZE,
    INK,
    PAGE_WIDTH,
    STATE_COLOURS,
    add_labels,
    add_legend,
    add_title,
    default_settings,
    literal,
    page_figure,
    style_axes,
)
from holdfast.plots.time_series import (
    FingerSeries,
    component_handles,
    draw_components,
    draw_curve,
    draw_sigma,
    finger_series,
)
from holdfast.recordings import Recording, Tactile, shown_origin

ROW_HEIGHTS = {"force": 1.75, "sigma": 0.9, "slip": 0.75, "decision": 0.75}
"""Heights of the axes of a finger [inch]."""
LEGEND_HEIGHT = 0.75
MAX_FINGERS_IN_COLUMN = 3
SHADE_ALPHA = 0.25
REST_SECONDS = 0.5
"""Time at the start from which the change of z is counted [s]."""
MAP_BOX = (0.85, 0.45, 0.15, 0.45)
"""Place of the map of the taxels, as fractions of the axes of the force."""
MARKER_LETTER_WIDTH = 0.011
"""Width of a letter of a marker, as a fraction of the width of the axes."""


@default_settings()
def plot_recording(
    recording: Recording,
    tare: Tare | None = None,
    window: int = DEFAULT_WINDOW,
    model: Model | None = None,
) -> Figure:
    """Draw forces, sigma, labels and slip of each finger over time.

    Pads (names with "/") are left out if there are fingertips.

    Args:
        recording: to draw.
        tare: how the baseline is found; by default the mean of the first 0.5 s.
        window: N_w of sigma [samples].
        model: whose decisions about slips are drawn too.

    Raises:
        ValueError: no sample lies in the interval of the tare; or the model has no slip rule.
        ModelError: the recording has other fingers or sensors than the model.
    """
    chosen = tare or Tare.parse(0.5)
    every = {name: module for name, module in recording.modules.items() if module.n_samples}
    fingers = {name: module for name, module in every.items() if "/" not in name} or every
    origin = shown_origin(recording.start)  # times of a clock are too long for an axis
    curves = {}
    for name in fingers:
        series = finger_series(recording, name, chosen, window)
        slip = series.slip and (series.slip[0] - origin, series.slip[1])
        curves[name] = series._replace(times=series.times - origin, slip=slip)
    decisions: dict[str, SlipDecisionSeries] | None = None
    if model is not None:
        if not model.has_slip_rule:
            raise ValueError(
                f"{model.name or 'the model'} has no slip rule, whose decisions to draw"
            )
        decided = slip_series(model, recording)
        decisions = {n: slips._replace(times=slips.times - origin) for n, slips in decided.items()}
    # The axes of a finger, from top to bottom.
    absent = {
        "slip": all(series.slip is None for series in curves.values()),
        "decision": decisions is None,
    }
    rows = [row for row in ROW_HEIGHTS if not absent.get(row, False)]
    n_columns = 1 if len(curves) <= MAX_FINGERS_IN_COLUMN else 2
    figure, stacks = _stacks(curves, rows, n_columns)
    for index, (name, axes) in enumerate(zip(fingers, stacks, strict=False)):
        panels = dict(zip(rows, axes, strict=True))
        _draw_finger(panels, fingers[name], curves[name], origin)
        if decisions is not None:
            draw_slip_decisions(panels.get("slip"), panels["decision"], decisions.get(name))
        _draw_markers(axes, recording, origin, named=index < n_columns)
        if index + n_columns >= len(fingers):
            label = "time [s]" if origin == 0 else f"time since {origin:.3f} s [s]"
            add_labels(axes[-1], x=label)
    for axes in stacks[len(fingers) :]:
        for axis in axes:
            axis.set_axis_off()
    figure.align_ylabels()
    tare_text = {
        "seconds": f"tare: first {chosen.seconds:g} s",
        "first": "tare: first sample",
        "none": "no tare",
        "interval": f"tare: {chosen.interval[0]:g} to {chosen.interval[1]:g} s",
    }[chosen.kind]
    title = f"{recording.name}   ({tare_text}, window of {window} samples)"
    figure.suptitle(literal(title), fontsize=FONT_SIZE + 1.5)
    states = {label.state.code: label.state for m in fingers.values() for label in m.labels}
    handles = component_handles(COMPONENT_COLOURS) + [
        Patch(facecolor=c, alpha=SHADE_ALPHA, label=states[k].value.lower().replace("_", " "))
        for k, c in STATE_COLOURS.items()
        if k in states
    ]
    if decisions is not None:
        handles.append(Patch(facecolor=SLIP_COLOUR, alpha=DECIDED_ALPHA, label="slides (decided)"))
    add_legend(figure, handles, "outside lower center")
    return figure


def _stacks(
    curves: Mapping[str, FingerSeries], rows: Sequence[str], n_columns: int
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure and the axes of each finger, from top to bottom; fingers row by row."""
    n_lines = -(-len(curves) // n_columns)
    heights = [ROW_HEIGHTS[row] for row in rows] * n_lines
    width = PAGE_WIDTH * (1 if n_columns == 1 else 1.6)
    figure = page_figure(sum(heights) + LEGEND_HEIGHT, width)
    grid = figure.subplots(
        len(heights), n_columns, sharex=True, squeeze=False, height_ratios=heights
    )
    # One time axis for all fingers, which may begin and end at different times.
    start = min(series.times[0] for series in curves.values())
    end = max(series.times[-1] for series in curves.values())
    grid[0, 0].set_xlim(start, end if end > start else start + 1)
    stacks = [
        list(grid[line * len(rows) : (line + 1) * len(rows), column])
        for line in range(n_lines)
        for column in range(n_columns)
    ]
    return figure, stacks


def _draw_finger(
    panels: Mapping[str, Axes], module: Tactile, series: FingerSeries, origin: float
) -> None:
    for row, axes in panels.items():
        # Beside decisions, labels would be a second shade on the axis of the slip.
        is_shaded = row in ("force", "sigma") or "decision" not in panels
        for label in module.labels if is_shaded else ():
            axes.axvspan(
                label.start - origin, label.end - origin, linewidth=0, edgecolor="none",
                facecolor=STATE_COLOURS[label.state.code], alpha=SHADE_ALPHA, zorder=0,
            )  # fmt: skip
        style_axes(axes)
    force, sigma = panels["force"], panels["sigma"]
    draw_curve(force, series, series.amplitude, COMPONENT_COLOURS["F_a"], 1.5)
    draw_components(force, series)
    add_title(force, series.name)
    add_labels(force, y=f"force {series.unit_label}")
    draw_sigma(sigma, series)
    add_labels(sigma, y=f"σ {series.unit_label}")
    _draw_taxels(force, module, series.amplitude)
    list(panels.values())[-1].tick_params(labelbottom=True)
    if "slip" in panels:
        draw_slip_speed(panels["slip"], series)


def _draw_taxels(axes: Axes, module: Tactile, amplitude: npt.NDArray[np.float64]) -> None:
    """Draw z of each taxel at the largest force, since the start: red above, blue below zero."""
    if module.sensor.n_taxels < 2 or len(amplitude) != module.n_samples:
        return
    normal = module.readings[..., 2].astype(np.float64)
    at = int(np.argmax(np.nan_to_num(amplitude)))
    change = normal[at] - normal[: max(1, int(module.rate * REST_SECONDS))].mean(axis=0)
    largest = float(np.abs(np.nan_to_num(change)).max()) or 1.0
    # Seen along the axis in which the sensor is thinnest.
    along = np.sort(np.argsort(np.ptp(module.sensor.positions, axis=0))[1:])
    across, up = module.sensor.positions[:, along].T
    box = axes.inset_axes(MAP_BOX)
    box.scatter(across, up, s=9, c=change, cmap="coolwarm", vmin=-largest, vmax=largest)
    box.set_title("z at the largest force", fontsize=FONT_SIZE - 2, pad=1)
    box.set_aspect("equal")
    box.margins(0.2)
    box.set_axis_off()


def _draw_markers(axes: Sequence[Axes], recording: Recording, origin: float, named: bool) -> None:
    """Draw a dotted line for each marker, with its text above where texts do not overlap."""
    left, right = axes[0].get_xlim()
    letter = MARKER_LETTER_WIDTH * (right - left)
    # Texts begin behind the title of the panel, and each behind the one before.
    free = left + letter * (len(axes[0].get_title("left")) + 4)
    for time, text in sorted(recording.markers):
        at = time - origin
        if not left <= at <= right:
            continue
        for axis in axes:
            axis.axvline(at, color=INK, linewidth=0.7, linestyle=":", zorder=3)
        if named and at >= free and at + letter * len(text) <= right:
            axes[0].annotate(
                literal(text), (at, 1), xycoords=("data", "axes fraction"), xytext=(0, 2),
                textcoords="offset points", fontsize=FONT_SIZE - 1, color=INK, ha="left",
                va="bottom",
            )  # fmt: skip
            free = at + letter * (len(text) + 2)
