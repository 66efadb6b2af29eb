"""`holdfast import`: recordings from other formats, and from files that were cut off."""

import errno
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from holdfast.cli.csv_options import (
    ColumnsOption,
    SensorsOption,
    parse_sensors,
    report_findings,
)
from holdfast.cli.options import (
    EngineOption,
    ForceOption,
    JobsOption,
    JsonOption,
    start_engine,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_table
from holdfast.cli.terminal.progress import progress
from holdfast.errors import is_installed

if TYPE_CHECKING:
    from holdfast.labelling.review.findings import Finding
    from holdfast.parallel import Engine
    from holdfast.recordings import Recording
    from holdfast.sensors import Sensor


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
    sensor: SensorsOption = None
    columns: ColumnsOption = None
    no_labels: Annotated[
        bool, typer.Option("--no-labels", help="Do not import the labels of the input.")
    ] = False
    suffix: Annotated[
        RecordingFormat | None,
        typer.Option(
            help="Format of the recordings to write.",
            show_default="parquet; mcap without the extra parquet",
        ),
    ] = None

    def task(self, out: Path, *, force: bool) -> "_ImportTask":
        """Return how each part of the input is imported.

        Raises:
            ValueError: a module has two sensors, or a sensor is unknown or not valid.
        """
        suffix = self.suffix
        if suffix is None:
            suffix = RecordingFormat.PARQUET if is_installed("pyarrow") else RecordingFormat.MCAP
        sensors = parse_sensors(self.sensor or ())
        labels = not self.no_labels
        return _ImportTask(self.data_format, sensors, self.columns, labels, suffix, force, out)


class _Imported(NamedTuple):
    """An imported recording: its facts as JSON values, and its findings."""

    document: dict[str, Any]
    findings: "tuple[Finding, ...]"

    @property
    def file_name(self) -> str:
        return str(self.document["path"].name)


def import_(
    path: Annotated[Path, typer.Argument(help="File or folder to import.")],
    out: Annotated[
        Path, typer.Argument(help="Folder for the recordings; it is created if missing.")
    ],
    options: FormatOptions,
    engine: EngineOption = "loky",
    jobs: JobsOption = 1,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""Import recordings from other formats.

    Formats: those of docs/importing.md, and recordings of holdfast itself. From an .mcap file that
    was cut off, everything up to the cut is recovered. Write OUT/NAME.parquet for each recording.
    If one of them fails, none is written.

    A CSV file of any other logger needs its sensor. Its columns are guessed from the header; the
    guess is shown first, as the text of --columns, which corrects it
    (docs/tutorials/own-sensor.md).

    Example:
      holdfast import data/uskin_pick_move real/
      holdfast import log.csv real/ --format xela-log --no-labels
      holdfast import press.csv real/ --sensor sensor.json
      holdfast import press.csv real/ --sensor anyskin \
        --columns 'time=t:ms,taxels=m{taxel}{axis}'
      holdfast import cut.mcap recovered/
      holdfast import /shared/logs /shared/out --engine dask:tcp://hub:8786
    """
    imported = import_all(path, out, options, start_engine(engine, jobs), force=force)
    if as_json:
        print_json(imported.document())
    else:
        imported.print()
    imported.print_messages()


def import_all(
    path: Path, out: Path, options: FormatOptions, started: "Engine", *, force: bool
) -> "ImportResult":
    """Import a file or folder; write all recordings, or none.

    Args:
        path: of the input.
        out: folder for the recordings; it is created if missing.
        options: formats.
        started: engine that imports the parts.
        force: replace existing files.

    Raises:
        RecordingError: the input cannot be read, or two recordings have the same name.
        OutputError: a recording exists already, or cannot be written, or a worker does not share
            the folder.
    """
    from holdfast.io.importers import import_hint

    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file; a folder expected", str(out))
    prefixes, task = _parts(started.path(path), options.task(started.path(out), force=force))
    with _staging_folder(task.out) as folder:
        results = started.map_ordered(_import_part, prefixes.items(), shared=(task, folder))
        results = progress(results, "importing", len(prefixes))
        imported: list[_Imported] = []
        names: set[str] = set()
        printed: set[str] = set()
        for recordings, messages in results:
            for key, text in messages.items():
                if key not in printed:
                    print_message(text)
            printed |= messages.keys()
            for recording in recordings:
                started.check_written(folder / recording.file_name)
                # Parts are imported in different processes: only here are all names known.
                _check_new(recording.document["name"], recording.file_name in names)
                names.add(recording.file_name)
            imported += recordings
        # All parts were read without an error: only now do the recordings get their names.
        for recording in imported:
            (folder / recording.file_name).replace(task.out / recording.file_name)
    # The path as the user gave it; that of the task is absolute on a cluster.
    for recording in imported:
        recording.document["path"] = out / recording.file_name
    hint = None if task.data_format is None else import_hint(task.data_format)
    return ImportResult(imported, out, hint)


class ImportResult(NamedTuple):
    """Recordings that were imported into a folder, and the hint of their format."""

    imported: list[_Imported]
    out: Path
    hint: str | None

    def document(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        recordings = [recording.document for recording in self.imported]
        return {
            "out": self.out,
            "n_recordings": len(recordings),
            "n_modules": sum(len(recording["modules"]) for recording in recordings),
            "n_samples": sum(recording["n_samples"] for recording in recordings),
            "recordings": recordings,
            "hint": self.hint,
        }

    def print(self) -> None:
        """Print the result as a table."""
        document = self.document()
        print_table(
            ("recording", "modules", "samples", "duration [s]", "labels"),
            [
                (x["name"], len(x["modules"]), x["n_samples"], f"{x['duration']:.2f}",
                 x["n_labels"])
                for x in document["recordings"]
            ],
        )  # fmt: skip
        print_line()
        n_recordings, n_modules, n_samples = (
            f"{(n := document[f'n_{what}s'])} {what}{'' if n == 1 else 's'}"
            for what in ("recording", "module", "sample")
        )
        print_line(f"{n_recordings} with {n_modules} and {n_samples} in {self.out}")

    def print_messages(self) -> None:
        """Print the findings and the hint on stderr."""
        report_findings((document["name"], findings) for document, findings in self.imported)
        if self.hint:
            print_message(f"hint: {self.hint}")


@dataclass(frozen=True)
class _ImportTask:
    """How to import each part of the input; `data_format` is None for recordings of holdfast."""

    data_format: str | None
    sensors: "Mapping[str, Sensor]"
    columns: str | None
    labels: bool
    suffix: RecordingFormat
    force: bool
    out: Path


def _parts(path: Path, task: _ImportTask) -> tuple[dict[Path, str], _ImportTask]:
    """Return the parts of the input with the prefix of their names, and the task with the format.

    The parts are imported one by one.
    """
    from holdfast.errors import RecordingError
    from holdfast.io.dataset import load_dataset
    from holdfast.io.importers import import_parts
    from holdfast.io.importers.table import name_prefixes
    from holdfast.io.recording_files import is_recording

    foreign = task.data_format is not None or task.sensors or task.columns is not None
    if not foreign:
        files: Sequence[Path] = [path] if is_recording(path) else []
        if path.is_dir():
            with suppress(RecordingError):  # a folder of other files
                files = load_dataset(path).paths
        if files:
            return dict.fromkeys(files, ""), task
    name, parts = import_parts(path, task.data_format, sensors=task.sensors, columns=task.columns)
    return name_prefixes(parts), replace(task, data_format=name)


def _import_part(
    task: _ImportTask, folder: Path, part: Path, prefix: str
) -> tuple[list[_Imported], dict[str, str]]:
    """Import a part into the staging folder; return its recordings and messages.

    Each message is a text, by the same text without the name of the part.
    """
    from holdfast.io import import_recordings, load_recording

    messages: dict[str, str] = {}

    def report(text: str) -> None:
        # One text for all parts: a message about a hundred files is printed once.
        messages[text.replace(part.name, "")] = text

    recordings: Iterable[Recording]
    if task.data_format is None:
        recording = load_recording(part, labels=task.labels)
        recordings = [recording if task.labels else recording.with_labels({})]
    else:
        recordings = import_recordings(
            part,
            task.data_format,
            labels=task.labels,
            sensors=task.sensors,
            columns=task.columns,
            report=report,
        )
    written: list[_Imported] = []
    for recording in recordings:
        if not recording.complete:
            report(f"{part} is cut off: {recording.duration:.2f} s recovered")
        named = replace(recording, name=f"{prefix}{recording.name}")
        written.append(_write(named, folder, task))
    return written, messages


def _check_new(name: str, known: bool) -> None:
    from holdfast.errors import RecordingError

    if known:
        raise RecordingError(f"two recordings have the name {name!r}: import them one by one")


@contextmanager
def _staging_folder(out: Path) -> Iterator[Path]:
    """Create a temporary folder inside `out`; remove `out` at the end if it is new and empty."""
    from holdfast.errors import OutputError

    created = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        # In `out`, on its file system: the files need only be renamed at the end.
        staging = tempfile.TemporaryDirectory(prefix=".import.", dir=out)
    except OSError as cause:
        raise OutputError(f"cannot write to {out}: {cause.strerror}") from cause
    try:
        with staging as name:
            yield Path(name)
    except OutputError as cause:
        # The user knows `out` and not the temporary folder.
        raise OutputError(str(cause).replace(staging.name, str(out))) from cause
    finally:
        for folder in created:
            # A folder with recordings is not removed.
            with suppress(OSError):
                folder.rmdir()


def _write(recording: "Recording", folder: Path, task: _ImportTask) -> _Imported:
    from holdfast.files import file_stem, refuse_overwrite
    from holdfast.io import save_recording
    from holdfast.labelling.review.findings import findings_of

    file_name = f"{file_stem(recording.name)}.{task.suffix}"
    refuse_overwrite(task.out / file_name, force=task.force)
    _check_new(recording.name, (folder / file_name).exists())
    save_recording(recording, folder / file_name)
    document = {
        "name": recording.name,
        "path": task.out / file_name,
        "modules": {name: module.n_samples for name, module in recording.modules.items()},
        "n_samples": sum(module.n_samples for module in recording.modules.values()),
        "duration": recording.duration,
        "n_labels": sum(len(module.labels) for module in recording.modules.values()),
        "complete": recording.complete,
    }
    return _Imported(document, tuple(findings_of(recording)))
