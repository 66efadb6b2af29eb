"""Figure of the estimates of a recording: force and state of each finger over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from holdfast.contact import ContactState
from holdfast.detection import Detection
from holdfast.plots.style import (
    COMPONENT_COLOURS,
    FONT_SIZE,
    PAGE_WIDTH,
    STATE_COLOURS,
    PageFigure,
    add_labels,
    add_title,
    default_settings,
    page_figure,
    style_axes,
)
from holdfast.plots.time_series import draw_line, equal_spans
from holdfast.recordings import shown_origin

FINGER_HEIGHT = 1.5
"""Height of the axes of a finger [inch]."""
STATE_ALPHA = 0.35
STATES = tuple(ContactState)


@default_settings()
def figure_of_detection(detection: Detection) -> Figure:
    """Return a figure with what `plot_detection` draws, without a screen."""
    n = len(detection.fingers)
    figure = page_figure(n * FINGER_HEIGHT + 0.4)
    plot_detection(detection, list(figure.subplots(n, sharex=True, squeeze=False)[:, 0]))
    return figure


@default_settings()
def plot_detection(detection: Detection, axes: Sequence[Axes] | None = None) -> list[Axes]:
    """Draw |F_tip| of each finger over time, on the colours of its states; UNKNOWN has none.

    Args:
        detection: as `detect` returns it.
        axes: one for each finger; by default a new figure of pyplot, which a notebook shows.

    Returns:
        The axes, one for each finger, to add lines and texts to.

    Raises:
        ValueError: there are not as many axes as fingers.
    """
    if axes is None:
        from matplotlib import pyplot as plt

        n = len(detection.fingers)
        size = PAGE_WIDTH, n * FINGER_HEIGHT + 0.4
        figure = plt.figure(figsize=size, layout="constrained", FigureClass=PageFigure)
        axes = list(figure.subplots(n, sharex=True, squeeze=False)[:, 0])
    if len(axes) != len(detection.fingers):
        raise ValueError(
            f"one axes for each of {len(detection.fingers)} fingers expected, {len(axes)} given"
        )
    origin = shown_origin(float(detection.times[0]))
    for panel, (finger, trace) in zip(axes, detection.fingers.items(), strict=True):
        times = trace.times - origin
        for first, start, end in equal_spans(times, trace.state):
            if colour := STATE_COLOURS.get(int(trace.state[first])):
                panel.axvspan(start, end, facecolor=colour, alpha=STATE_ALPHA, linewidth=0)
        draw_line(panel, times, np.linalg.norm(trace.force, axis=1), COMPONENT_COLOURS["F_a"])
        style_axes(panel)
        add_title(panel, finger)
        add_labels(panel, y="force [unit of the readings]")
    add_labels(axes[-1], x="time [s]" if origin == 0 else f"time since {origin:.3f} s [s]")
    handles = [
        Patch(facecolor=colour, alpha=STATE_ALPHA, label=STATES[code])
        for code, colour in STATE_COLOURS.items()
    ]
    axes[0].legend(handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=3,
                   fontsize=FONT_SIZE, frameon=False)  # fmt: skip
    return list(axes)
