"""The look of the study's figures: one page wide, colours for all eyes, no screen needed."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Literal, NamedTuple

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from holdfast.plots.evaluation import COLOURS, MARKERS

WIDTH = 7.2
"""Of every figure [inch]: the text width of a page in two columns."""
SMALL = 7.5
"""Size of letters at that width [pt]."""
INK = "#222222"
GREY = "#999999"
FAINT = "#e6e6e6"
PAPER = "the paper"
"""A series of this name is what the paper prints: drawn black and dashed everywhere."""
Dashes = Literal["-"] | tuple[float, tuple[float, ...]]
_DASHES: tuple[Dashes, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))


class SeriesStyle(NamedTuple):
    """How a series looks in every panel, as matplotlib's `plot` takes it."""

    color: str
    marker: str
    linestyle: Dashes


def styles_of(names: Iterable[str]) -> dict[str, SeriesStyle]:
    """A look for each name: by its place in the order of first appearance, the paper's apart.

    Eighteen looks differ in colour, mark or dashes; then they come again.
    """
    styles: dict[str, SeriesStyle] = {}
    others = [name for name in dict.fromkeys(names) if name != PAPER]
    for k, name in enumerate(others):
        lap = k // len(COLOURS)
        marker = MARKERS[(k + lap) % len(MARKERS)]
        styles[name] = SeriesStyle(COLOURS[k % len(COLOURS)], marker, _DASHES[lap % len(_DASHES)])
    return styles | {PAPER: SeriesStyle("black", "x", (0, (4, 2)))}


def sheet(height: float) -> Figure:
    """An empty figure as wide as a page.

    Args:
        height: [inch].
    """
    return Figure(figsize=(WIDTH, height), dpi=160, layout="constrained")


def panels(
    n: int, per_row: int, height: float, *, sharey: bool = False
) -> tuple[Figure, list[Axes]]:
    """A figure of `n` axes, `per_row` beside each other, each `height` [inch] high."""
    per_row = max(1, min(n, per_row))
    n_rows = -(-max(n, 1) // per_row)
    figure = sheet(n_rows * height + 0.35)
    grid = figure.subplots(n_rows, per_row, squeeze=False, sharey=sharey).ravel()
    for axes in grid[n:]:
        axes.remove()
    for axes in grid[:n]:
        tidy(axes)
    return figure, list(grid[:n])


def tidy(axes: Axes) -> None:
    """Small letters, thin lines, two spines."""
    axes.tick_params(labelsize=SMALL, width=0.6, length=2.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_linewidth(0.6)
    axes.set_axisbelow(True)


def add_title(axes: Axes, text: str) -> None:
    """A small title above the left end."""
    axes.set_title(text, fontsize=SMALL + 0.5, loc="left")


def add_labels(axes: Axes, x: str | None = None, y: str | None = None) -> None:
    """Names of the axes, with units."""
    if x is not None:
        axes.set_xlabel(x, fontsize=SMALL)
    if y is not None:
        axes.set_ylabel(y, fontsize=SMALL)


def add_legend(
    figure: Figure,
    handles: Sequence[Artist],
    place: Literal["outside upper center", "outside lower center"] = "outside upper center",
    per_row: int = 8,
) -> None:
    """A legend above all axes, or below."""
    if not handles:
        return
    n_lines = -(-len(handles) // per_row)
    figure.legend(
        handles=handles, loc=place, ncols=-(-len(handles) // n_lines),
        fontsize=SMALL, frameon=False, handlelength=2.8, columnspacing=1.3, borderaxespad=0.3,
    )  # fmt: skip


def handles_of(
    styles: Mapping[str, SeriesStyle], groups: Iterable[Collection[str]], *, lines: bool = True
) -> list[Line2D]:
    """Handles of a legend for the names that some panel shows."""
    seen = set().union(*groups)
    return [
        Line2D(
            [], [], color=style.color, marker=style.marker, markersize=4, linewidth=1.1,
            linestyle=style.linestyle if lines else "", label=name,
        )
        for name, style in styles.items()
        if name in seen
    ]  # fmt: skip
