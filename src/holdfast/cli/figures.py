"""Figures that verbs write: PNG, SVG or PDF by the suffix, whole or not at all."""

from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.console import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".pdf", ".png", ".svg")


def refuse_plot(plot: Path, force: bool) -> None:
    """Does nothing where a figure may be written there.

    Raises:
        ValueError: another suffix.
        OutputError: it exists and `force` is not given, or its folder does not exist.
    """
    from holdfast.files import refuse_overwrite

    if plot.suffix.lower() not in SUFFIXES:
        raise ValueError(f"a plot ends in {', '.join(SUFFIXES)}; {plot.name!r} given")
    refuse_overwrite(plot, force=force)


def save_plot(figure: "Figure", plot: Path, force: bool) -> None:
    """Writes the figure, and says so."""
    from holdfast.files import whole_file

    with whole_file(plot, force=force) as part:
        figure.savefig(part)
    say(f"{plot} written")
