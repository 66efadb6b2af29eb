"""`holdfast export RECORDINGS OUT`: recordings in the formats of other tools."""

from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.extensions import EXPORTER_PLUGINS, ExporterOptions, flags_of
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from collections.abc import Iterable

    from holdfast.recordings import Recording

FILE_SUFFIXES = (".csv", ".json", ".mcap", ".parquet")
"""Suffixes that a folder is not given."""
CSV = "csv"
"""The format that holdfast itself has."""


@dataclass(frozen=True)
class RecordingOptions:
    """Group of options: how recordings are exported."""

    format: Annotated[
        str | None,
        typer.Option(
            "--format",
            metavar="NAME",
            help="Format of exported recordings: csv, or one of a plug-in.",
            show_default=False,
        ),
    ] = None


def export_recordings(
    source: Path,
    out: Path,
    name: str | None,
    others: ExporterOptions,
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Export a recording, or the recordings of a folder.

    Args:
        source: path of the recording or the folder.
        out: folder to write.
        name: of the format.
        others: options of the formats of plug-ins.
        force: replace existing files.
        as_json: print JSON.

    Raises:
        ValueError: the format is missing, or an option does not belong to it.
        HoldfastError: the recordings cannot be exported.
    """
    from holdfast.exporters import generic_csv
    from holdfast.io import load_dataset

    def writing(items: "Iterable[Recording]") -> "Iterable[Recording]":
        return progress(items, "exporting")

    plugin = exporter_of(out, name, others)
    recordings = load_dataset(source)
    if plugin is None:
        written = generic_csv.export(recordings, out, force=force, progress=writing)
        if written.left_out:
            print_message(f"a CSV table has no {', '.join(written.left_out)}")
        if written.sensors:
            texts = " ".join(f"--sensor {text}" for text in written.sensors)
            print_message(f"hint: to import it again, give {texts}")
        document = {
            "tables": len(written.files),
            "files": written.files,
            "sensors": written.sensors,
            "left_out": written.left_out,
        }
    else:
        options = others.of(str(name))
        document = plugin.export(recordings, out, options, force=force, progress=writing)
    if as_json:
        print_json({"out": out, "format": name, **document})
        return
    counts = [
        f"{n} {what.removesuffix('s') if n == 1 and what != 'fps' else what}"  # fps is no plural
        for what, n in document.items()
        if isinstance(n, int)  # lists of files are for JSON
    ]
    print_line(f"{out}: {', '.join(counts)}")


def exporter_of(out: Path, name: str | None, others: ExporterOptions) -> Any:  # noqa: ANN401
    """Return the plug-in of the format, None for CSV, after a check of all options.

    Raises:
        ValueError: the format is missing, `out` is no folder, or an option belongs to another
            format.
    """
    names = sorted({CSV, *EXPORTER_PLUGINS.names()})
    if name is None:
        raise ValueError(f"--format: {', '.join(names)} expected for recordings")
    plugin = None if name == CSV else EXPORTER_PLUGINS.require(name, f"the format {name}", names)
    flags = [] if plugin is None else flags_of(plugin.OPTIONS)
    for other, chosen, values in others.chosen():
        if other != name:
            foreign_flags = [
                flag
                for flag, value in zip(flags_of(values), astuple(values), strict=True)
                if flag not in flags
                and value != getattr(chosen.OPTIONS, flag[2:].replace("-", "_"))
            ]
            if foreign_flags:
                raise ValueError(f"{foreign_flags[0]} belongs to --format {other}; {name} given")
    # A table is one file of its format; all other formats write a folder.
    if out.suffix in FILE_SUFFIXES and name != out.suffix[1:]:
        raise ValueError(f"{out}: a folder expected for the format {name}, a file given")
    return plugin
