"""Style that all figures share: sizes, colours, axes and legends. No screen is needed."""

import io
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from holdfast.contact import NO_CONTACT, STABLE, UNSTABLE
from holdfast.plots import COLOURS

PAGE_WIDTH = 7.2
"""Width of a figure [inch]: the text width of a page with two columns."""
FONT_SIZE = 7.5
"""Font size at that width [pt]."""
NOTEBOOK_RESOLUTION = 110
"""Resolution of a figure in a notebook [dots per inch]."""
INK = "#333333"
GREY = "#999999"
FAINT = "#e6e6e6"

MARKERS = "osD^vP"
COMPONENT_COLOURS = {"F_x": "#0072B2", "F_y": "#E69F00", "F_z": "#CC79A7", "F_a": "#000000"}
STATE_COLOURS = {STABLE: "#009e73", UNSTABLE: "#e08a3c", NO_CONTACT: "#c8c8c8"}
"""Colour of each contact state, by its code."""

PAPER = "the paper"
"""Name of the series with the paper's values; it is black and dashed in every figure."""
Dashes = Literal["-"] | tuple[float, tuple[float, ...]]
_DASHES: tuple[Dashes, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))


class SeriesStyle(NamedTuple):
    """Colour, marker and dashes of a series, named as in matplotlib's `plot`."""

    color: str
    marker: str
    linestyle: Dashes


def series_styles(names: Iterable[str]) -> dict[str, SeriesStyle]:
    """Return a style for each name, in the order of first appearance.

    Eighteen styles differ in colour, marker or dashes; then they repeat. The paper's series has a
    style of its own; the other series keep theirs.
    """
    styles: dict[str, SeriesStyle] = {}
    others = [name for name in dict.fromkeys(names) if name != PAPER]
    for k, name in enumerate(others):
        # After six series the colours repeat, with other markers and dashes.
        lap = k // len(COLOURS)
        marker = MARKERS[(k + lap) % len(MARKERS)]
        styles[name] = SeriesStyle(COLOURS[k % len(COLOURS)], marker, _DASHES[lap % len(_DASHES)])
    return styles | {PAPER: SeriesStyle("black", "x", (0, (4, 2)))}


@contextmanager
def default_settings() -> Iterator[None]:
    """Draw with matplotlib's defaults, whatever a `matplotlibrc` of the working folder has.

    Every function that draws or saves a figure has it as its decorator.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        yield


class PageFigure(Figure):
    """Figure that a notebook shows as a picture, without pyplot, which would keep it."""

    @default_settings()
    def savefig(self, *args: Any, **kwargs: Any) -> None:  # noqa: ANN401 (of matplotlib)
        """Save the figure, as matplotlib does; ticks are made only now."""
        super().savefig(*args, **kwargs)

    def _repr_png_(self) -> bytes:
        """Return the figure as a PNG file; a notebook calls it."""
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=NOTEBOOK_RESOLUTION, metadata={"Software": None})
        return file.getvalue()


def page_figure(height: float, width: float = PAGE_WIDTH) -> PageFigure:
    """Return an empty figure.

    Args:
        height: of the figure [inch].
        width: of the figure [inch]; by default the width of a page.
    """
    return PageFigure(figsize=(width, height), dpi=200, layout="constrained")


def panels(
    n: int, per_row: int, height: float, *, sharey: bool = False
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its `n` axes, `per_row` in a row, each `height` [inch] high."""
    per_row = max(1, min(n, per_row))
    n_rows = -(-max(n, 1) // per_row)
    figure = page_figure(n_rows * height + 0.35)
    grid = figure.subplots(n_rows, per_row, squeeze=False, sharey=sharey).ravel()
    for axes in grid[n:]:
        axes.remove()
    for axes in grid[:n]:
        style_axes(axes)
    return figure, list(grid[:n])


def style_axes(axes: Axes) -> None:
    """Set small letters and thin lines, and hide the top and right spines."""
    axes.tick_params(labelsize=FONT_SIZE, width=0.6, length=2.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_linewidth(0.6)
    axes.set_axisbelow(True)


def literal(name: str) -> str:
    r"""Return a name as a text that matplotlib draws as it is, not as a formula.

    Names of fingers, recordings, sensors and markers come from files of others.

    Example:
        >>> print(literal("$can$"))
        \$can\$
    """
    return name.replace("$", r"\$")


def add_title(axes: Axes, text: str) -> None:
    """Add a title above the left end of the axes; it has no formulas."""
    axes.set_title(literal(text), fontsize=FONT_SIZE + 0.5, loc="left")


def add_labels(axes: Axes, x: str | None = None, y: str | None = None) -> None:
    """Add the names of the axes, with units."""
    if x is not None:
        axes.set_xlabel(x, fontsize=FONT_SIZE)
    if y is not None:
        axes.set_ylabel(y, fontsize=FONT_SIZE)


def add_legend(
    figure: Figure,
    handles: Sequence[Artist],
    location: Literal["outside upper center", "outside lower center"] = "outside upper center",
    per_row: int = 8,
) -> None:
    """Add a legend above or below all axes."""
    if not handles:
        return
    # Lines of about equal length, not a full one and a rest.
    n_lines = -(-len(handles) // per_row)
    figure.legend(
        handles=handles, loc=location, ncols=-(-len(handles) // n_lines),
        fontsize=FONT_SIZE, frameon=False, handlelength=2.8, columnspacing=1.3, borderaxespad=0.3,
    )  # fmt: skip
