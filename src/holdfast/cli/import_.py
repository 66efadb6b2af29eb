"""`holdfast import`: recordings from other formats, and from files that were cut off."""

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.csv_options import CsvOptions, report_findings
from holdfast.cli.options import RARE, EngineOptions, ForceOption, JsonOption
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_table
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.import_tasks import ImportResult, ImportTask


class RecordingFormat(StrEnum):
    """File formats in which recordings are written."""

    PARQUET = "parquet"
    MCAP = "mcap"


@dataclass(frozen=True)
class FormatOptions:
    """Group of options: formats of the input and of the recordings."""

    data_format: Annotated[
        str | None,
        typer.Option("--format", help="Format of the input; detected from the content by default."),
    ] = None
    no_labels: Annotated[
        bool, typer.Option("--no-labels", help="Do not import the labels of the input.")
    ] = False
    no_limit: Annotated[
        bool,
        typer.Option(
            "--no-limit",
            help="Read files of your own that take more than 1 GiB of memory, or 120 s.",
        ),
        RARE,
    ] = False
    suffix: Annotated[
        RecordingFormat | None,
        typer.Option(
            help="Format of the recordings to write.",
            show_default="parquet; mcap without the extra parquet",
        ),
    ] = None

    def task(self, out: Path, layout: CsvOptions, *, force: bool) -> "ImportTask":
        """Return how each part of the input is imported.

        Raises:
            ValueError: a module has two sensors, or a sensor or the layout is not valid.
        """
        from holdfast.import_tasks import ImportTask

        task = ImportTask(
            out, self.data_format, layout.sensors(), layout.layout, accept=layout.accept,
            labels=not self.no_labels, force=force, limited=not self.no_limit,
        )  # fmt: skip
        # Without the option, the task chooses the format by what is installed.
        return task if self.suffix is None else replace(task, suffix=self.suffix)


def import_(
    path: Annotated[Path, typer.Argument(help="File or folder to import.")],
    out: Annotated[
        Path, typer.Argument(help="Folder for the recordings; it is created if missing.")
    ],
    options: FormatOptions,
    layout: CsvOptions,
    parallel: EngineOptions,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""Import recordings from other formats.

    Formats: those of docs/importing.md, and recordings of holdfast itself. From an .mcap file that
    was cut off, everything up to the cut is recovered. Write OUT/NAME.parquet for each recording.
    If one of them fails, none is written.

    A file of any other logger needs its sensor. What its names and shapes say is read at once. For
    what they do not say, a command is proposed that says it; --accept takes it as it stands
    (docs/importing.md).

    Example:
      holdfast import data/uskin_pick_move real/
      holdfast import log.csv real/ --format xela-log --no-labels
      holdfast import press.csv real/ --sensor sensor.json
      holdfast import press.csv real/ --sensor anyskin \
        --columns time=t:ms,taxels=2..16
      holdfast import cut.mcap recovered/
    """
    from holdfast.import_tasks import import_all

    engine, task = parallel.start(), options.task(out, layout, force=force)
    result = import_all(path, task, engine, notify=print_message, steps=progress)
    print_imported(result, {}, as_json=as_json)


def print_imported(result: "ImportResult", facts: dict[str, Any], *, as_json: bool) -> None:
    """Print a table of the recordings, their findings, and the hint of the format.

    With `as_json`, the `facts` of the source precede the fields of the JSON document.
    """
    document = result.document()
    if as_json:
        print_json(facts | document)
    else:
        rows = [
            (x["name"], len(x["modules"]), x["n_samples"], f"{x['duration']:.2f}", x["n_labels"])
            for x in document["recordings"]
        ]
        print_table(("recording", "modules", "samples", "duration [s]", "labels"), rows)
        print_line()
        n_recordings, n_modules, n_samples = (
            f"{(n := document[f'n_{what}s'])} {what}{'s' * (n != 1)}"
            for what in ("recording", "module", "sample")
        )
        print_line(f"{n_recordings} with {n_modules} and {n_samples} in {result.out}")
    report_findings((document["name"], findings) for document, findings in result.imported)
    if result.hint and document["recordings"]:
        path = document["recordings"][0]["path"]
        print_message(f"holdfast info {path} --plot import.png draws what was imported")
        print_message(f"hint: {result.hint}")
