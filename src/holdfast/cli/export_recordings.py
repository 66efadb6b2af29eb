"""`holdfast export RECORDINGS OUT`: recordings in the formats of other tools."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from collections.abc import Iterable

    from holdfast.io import Dataset
    from holdfast.recordings import Recording


class ExportFormat(StrEnum):
    """Formats of other tools."""

    LEROBOT = "lerobot"
    FOXGLOVE = "foxglove"
    CSV = "csv"


FILE_SUFFIXES = (".csv", ".json", ".mcap", ".parquet")
"""Suffixes that a folder is not given."""


@dataclass(frozen=True)
class RecordingOptions:
    """Group of options: how recordings are exported."""

    format: Annotated[
        ExportFormat | None,
        typer.Option("--format", help="Format of exported recordings.", show_default=False),
    ] = None
    fps: Annotated[
        int | None,
        typer.Option(help="Frames per second of a LeRobot data set.", show_default="30"),
    ] = None
    model: Annotated[
        str | None,
        typer.Option(help="Model whose estimates Foxglove shows: a file or builtin:NAME."),
    ] = None


def export_recordings(
    source: Path, out: Path, options: RecordingOptions, *, force: bool, as_json: bool
) -> None:
    """Export a recording, or the recordings of a folder.

    Args:
        source: path of the recording or the folder.
        out: folder to write.
        options: format, and what belongs to it.
        force: replace existing files.
        as_json: print JSON.

    Raises:
        ValueError: the format is missing, or an option does not belong to it.
        HoldfastError: the recordings cannot be exported.
    """
    from holdfast.io import load_dataset

    _check(out, options)
    recordings = load_dataset(source)
    match options.format:
        case ExportFormat.LEROBOT:
            document = _to_lerobot(recordings, out, options.fps, force=force)
        case ExportFormat.FOXGLOVE:
            document = _to_foxglove(recordings, out, options.model, force=force)
        case _:
            document = _to_csv(recordings, out, force=force)
    if as_json:
        print_json({"out": out, "format": options.format, **document})
        return
    counts = [
        f"{n} {name.removesuffix('s') if n == 1 and name != 'fps' else name}"
        for name, n in document.items()
        if isinstance(n, int)
    ]
    print_line(f"{out}: {', '.join(counts)}")


def _check(out: Path, options: RecordingOptions) -> None:
    """Check that the options fit together."""
    if options.format is None:
        raise ValueError(f"--format: {', '.join(ExportFormat)} expected for recordings")
    for value, name, wanted in (
        (options.fps, "--fps", ExportFormat.LEROBOT),
        (options.model, "--model", ExportFormat.FOXGLOVE),
    ):
        if value is not None and options.format is not wanted:
            raise ValueError(f"{name} belongs to --format {wanted}; {options.format} given")
    if out.suffix in FILE_SUFFIXES and options.format != out.suffix[1:]:
        raise ValueError(f"{out}: a folder expected for the format {options.format}, a file given")


def _writing(recordings: "Iterable[Recording]") -> "Iterable[Recording]":
    return progress(recordings, "exporting")


def _to_lerobot(
    recordings: "Dataset", out: Path, fps: int | None, *, force: bool
) -> dict[str, Any]:
    require_extras("parquet")
    from holdfast.exporters import lerobot

    rate = lerobot.DEFAULT_FPS if fps is None else fps
    totals = lerobot.export(recordings, out, fps=rate, force=force, progress=_writing)
    return {**totals, "fps": rate}


def _to_foxglove(
    recordings: "Dataset", out: Path, model: str | None, *, force: bool
) -> dict[str, Any]:
    from holdfast.exporters import foxglove
    from holdfast.model import Model

    loaded = None if model is None else Model.load(model)
    totals = foxglove.export(recordings, out, model=loaded, force=force, progress=_writing)
    print_message(f"hint: import the layout {out / foxglove.LAYOUT_FILE} in Foxglove")
    return {**totals, "layout": out / foxglove.LAYOUT_FILE}


def _to_csv(recordings: "Dataset", out: Path, *, force: bool) -> dict[str, Any]:
    from holdfast.exporters import generic_csv

    written = generic_csv.export(recordings, out, force=force, progress=_writing)
    if written.left_out:
        print_message(f"a CSV table has no {', '.join(written.left_out)}")
    if written.sensors:
        options = " ".join(f"--sensor {text}" for text in written.sensors)
        print_message(f"hint: to import it again, give {options}")
    return {
        "tables": len(written.files),
        "files": written.files,
        "sensors": written.sensors,
        "left_out": written.left_out,
    }
