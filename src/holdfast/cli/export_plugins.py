"""Formats of other tools for `holdfast export`: LeRobot and Foxglove."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.terminal.console import print_message
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.io import Dataset


@dataclass(frozen=True)
class LeRobotOptions:
    """Options of LeRobot data sets."""

    fps: Annotated[
        int | None,
        typer.Option(help="Frames per second of a LeRobot data set.", show_default="30"),
    ] = None


@dataclass(frozen=True)
class FoxgloveOptions:
    """Options of files for Foxglove."""

    model: Annotated[
        str | None,
        typer.Option(help="Model whose estimates Foxglove shows: a file or builtin:NAME."),
    ] = None


class LeRobot:
    """LeRobot data sets (v3.0)."""

    OPTIONS = LeRobotOptions()

    @staticmethod
    def export(
        recordings: "Dataset",
        out: Path,
        options: LeRobotOptions,
        *,
        force: bool,
        progress: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """Write a data set, and return what it has."""
        require_extras("parquet")
        from holdfast.exporters import lerobot

        rate = lerobot.DEFAULT_FPS if options.fps is None else options.fps
        totals = lerobot.export(recordings, out, fps=rate, force=force, progress=progress)
        return {**totals, "fps": rate}


class Foxglove:
    """MCAP files with plots, states, a log and an arrow for each taxel, and a layout for them."""

    OPTIONS = FoxgloveOptions()

    @staticmethod
    def export(
        recordings: "Dataset",
        out: Path,
        options: FoxgloveOptions,
        *,
        force: bool,
        progress: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """Write the files, and return what they have."""
        from holdfast.exporters import foxglove
        from holdfast.model import Model

        loaded = None if options.model is None else Model.load(options.model)
        totals = foxglove.export(recordings, out, model=loaded, force=force, progress=progress)
        print_message(f"hint: import the layout {out / foxglove.LAYOUT_FILE} in Foxglove")
        return {**totals, "layout": out / foxglove.LAYOUT_FILE}
