"""Legends of series: a handle for each name that some panel shows."""

from collections.abc import Collection, Iterable, Mapping

from matplotlib.lines import Line2D

from holdfast.plots.style import SeriesStyle, literal


def legend_handles(
    styles: Mapping[str, SeriesStyle], groups: Iterable[Collection[str]], *, lines: bool = True
) -> list[Line2D]:
    """Return legend handles for the names that appear in some group; they have no formulas.

    Args:
        styles: of all names.
        groups: the names that each panel shows.
        lines: whether a handle shows a line beside the marker.
    """
    shown = set().union(*groups)
    return [
        Line2D(
            [], [], color=style.color, marker=style.marker, markersize=4, linewidth=1.1,
            linestyle=style.linestyle if lines else "", label=literal(name),
        )
        for name, style in styles.items()
        if name in shown
    ]  # fmt: skip
