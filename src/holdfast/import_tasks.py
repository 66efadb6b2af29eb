"""Import recordings of other formats, and of files that were cut off: all of them, or none."""

import errno
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from holdfast.errors import OutputError, RecordingError, is_installed
from holdfast.files import file_stem, refuse_overwrite
from holdfast.io import import_recordings, load_recording, save_recording
from holdfast.io.dataset import load_dataset
from holdfast.io.file_formats import is_recording
from holdfast.io.importers import import_hint, import_parts
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.table import name_prefixes
from holdfast.labelling.review.findings import Finding, findings_of
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

SAME_NAME = "two recordings have the name {!r}: import them one by one"


class Imported(NamedTuple):
    """An imported recording: its facts as JSON values, and its findings."""

    document: dict[str, Any]
    findings: tuple[Finding, ...]

    @property
    def file_name(self) -> str:
        """Name of its file."""
        return str(self.document["path"].name)


@dataclass(frozen=True)
class ImportTask:
    """How each part of the input is imported.

    Attributes:
        out: folder for the recordings; it is created if missing.
        data_format: name of the format; None if it is detected, and for recordings of holdfast.
        sensors: by module; `"*"` is that of all others.
        columns: layout of the numbers; None if nothing is said of it.
        accept: take the layout that is proposed.
        labels: import the labels of the input.
        suffix: of the recordings to write, `parquet` or `mcap`.
        force: replace existing files.
        limited: as in `import_recordings`.
    """

    out: Path
    data_format: str | None = None
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    columns: Columns | None = None
    accept: bool = False
    labels: bool = True
    suffix: str = field(default_factory=lambda: "parquet" if is_installed("pyarrow") else "mcap")
    force: bool = False
    limited: bool = True


class ImportResult(NamedTuple):
    """Recordings that were imported into a folder, and the hint of their format."""

    imported: list[Imported]
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


def import_all(
    path: Path,
    task: ImportTask,
    engine: Engine,
    *,
    notify: Callable[[str], None],
    steps: Callable[[Iterable[Any], str, float], Iterable[Any]],
) -> ImportResult:
    """Import a file or folder; write all recordings, or none.

    Args:
        path: of the input.
        task: formats, and the folder for the recordings.
        engine: imports the parts.
        notify: called with each message of an importer, once.
        steps: shows the progress.

    Raises:
        RecordingError: the input cannot be read, or two recordings have the same name.
        OutputError: a recording exists already, or cannot be written, or a worker does not share
            the folder.
    """
    out = task.out
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, "is a file; a folder expected", str(out))
    prefixes, task = _parts(engine.path(path), replace(task, out=engine.path(out)))
    with _staging_folder(task.out) as folder:
        calls = engine.map_ordered(_import_part, prefixes.items(), shared=(task, folder))
        imported: list[Imported] = []
        names: set[str] = set()
        printed: set[str] = set()
        for recordings, messages in steps(calls, "importing", len(prefixes)):
            for key, text in messages.items():
                if key not in printed:
                    notify(text)
            printed |= messages.keys()
            for recording in recordings:
                engine.check_written(folder / recording.file_name)
                # Parts are imported in different processes: only here are all names known.
                if recording.file_name in names:
                    raise RecordingError(SAME_NAME.format(recording.document["name"]))
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


def _parts(path: Path, task: ImportTask) -> tuple[dict[Path, str], ImportTask]:
    """Return the parts of the input with the prefix of their names, and the task with the format.

    The parts are imported one by one.
    """
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
    task: ImportTask, folder: Path, part: Path, prefix: str
) -> tuple[list[Imported], dict[str, str]]:
    """Import a part into the staging folder; return its recordings and messages.

    Each message is a text, by the same text without the name of the part.
    """
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
            limited=task.limited,
            accept=task.accept,
        )
    written: list[Imported] = []
    for recording in recordings:
        if not recording.complete:
            report(f"{part} is cut off: {recording.duration:.2f} s recovered")
        named = replace(recording, name=f"{prefix}{recording.name}")
        path = folder / f"{file_stem(named.name)}.{task.suffix}"
        refuse_overwrite(task.out / path.name, force=task.force)
        if path.exists():
            raise RecordingError(SAME_NAME.format(named.name))
        save_recording(named, path)
        modules = named.modules
        document = {
            "name": named.name,
            "path": task.out / path.name,
            "modules": {name: module.n_samples for name, module in modules.items()},
            "n_samples": sum(module.n_samples for module in modules.values()),
            "duration": named.duration,
            "n_labels": sum(len(module.labels) for module in modules.values()),
            "complete": named.complete,
        }
        written.append(Imported(document, tuple(findings_of(named))))
    return written, messages


@contextmanager
def _staging_folder(out: Path) -> Iterator[Path]:
    """Create a temporary folder inside `out`; remove `out` at the end if it is new and empty."""
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
