"""`holdfast import`: other people's data, and recordings that were cut, as whole recordings."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.terminal.console import print_json, print_table, say, show
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.recordings import Recording


class Suffix(StrEnum):
    """Formats that a recording can be written in."""

    PARQUET = "parquet"
    MCAP = "mcap"


@dataclass(frozen=True)
class _Imported:
    """What is told of a recording that came in."""

    name: str
    path: Path
    modules: dict[str, int]
    duration: float
    n_labels: int
    complete: bool

    @property
    def n_samples(self) -> int:
        return sum(self.modules.values())


def import_(
    path: Annotated[Path, typer.Argument(help="The file or folder to bring in.")],
    out: Annotated[Path, typer.Argument(help="The folder for the recordings; made if missing.")],
    data_format: Annotated[
        str | None,
        typer.Option("--format", help="Its format; found out from the content if not given."),
    ] = None,
    no_labels: Annotated[
        bool, typer.Option("--no-labels", help="Leave the labels that it comes with behind.")
    ] = False,
    suffix: Annotated[Suffix, typer.Option(help="What to write.")] = Suffix.PARQUET,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite recordings of the same names.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Brings in other people's data, whatever its format.

    Formats: uskin-pick-move, xela-log, gtac, arq-crisp, rosbag, csv (see docs/formats.md).
    Recordings of holdfast itself come in too: an .mcap file that was cut is recovered as far as
    it goes. Writes OUT/NAME.parquet for each recording: all of them, or none where anything
    goes wrong.

    Example:
      holdfast import data/uskin_pick_move real/
      holdfast import log.csv real/ --format xela-log --no-labels
      holdfast import cut.mcap recovered/
    """
    if out.exists() and not out.is_dir():
        raise NotADirectoryError(20, "is a file; a folder expected", str(out))
    recordings = _recordings(path, data_format, labels=not no_labels)
    with _staged(out) as folder:
        imported = [
            _write(recording, folder, out, suffix, force)
            for recording in progress(recordings, "importing")
        ]
        for one in imported:
            (folder / one.path.name).replace(one.path)
    _tell(imported, out, as_json)


def _recordings(path: Path, data_format: str | None, *, labels: bool) -> Iterator["Recording"]:
    from holdfast.io import import_recordings

    if data_format is None and (own := _own(path)):
        return (_loaded(file, labels=labels) for file in own)
    return import_recordings(path, data_format, labels=labels)


def _own(path: Path) -> list[Path]:
    """Files of holdfast itself: the file at `path`, or those in that folder."""
    from holdfast.errors import RecordingError
    from holdfast.io.dataset import load_dataset
    from holdfast.io.recording_files import is_recording

    if path.is_dir():
        with suppress(RecordingError):
            return list(load_dataset(path).paths)
        return []
    return [path] if is_recording(path) else []


def _loaded(file: Path, *, labels: bool) -> "Recording":
    from holdfast.io import load_recording

    recording = load_recording(file, labels=labels)
    if not recording.complete:
        say(f"{file} was cut: {recording.duration:.2f} s recovered")
    return recording if labels else recording.with_labels({})


@contextmanager
def _staged(out: Path) -> Iterator[Path]:
    """A folder inside `out` for what is not whole yet; `out` is made, and unmade if empty."""
    from holdfast.errors import OutputError

    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        staging = tempfile.TemporaryDirectory(prefix=".import.", dir=out)
    except OSError as cause:
        raise OutputError(f"cannot write to {out}: {cause.strerror}") from cause
    try:
        with staging as name:
            yield Path(name)
    except OutputError as cause:
        raise OutputError(str(cause).replace(staging.name, str(out))) from cause
    finally:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()


def _write(
    recording: "Recording", folder: Path, out: Path, suffix: Suffix, force: bool
) -> _Imported:
    from holdfast.errors import RecordingError
    from holdfast.files import refuse_overwrite
    from holdfast.io import save_recording

    file_name = f"{recording.name}.{suffix}"
    if Path(file_name).name != file_name or "\\" in file_name or file_name.startswith("."):
        raise RecordingError(f"{recording.name!r} is a recording's name that no file can have")
    refuse_overwrite(out / file_name, force=force)
    if (folder / file_name).exists():
        raise RecordingError(f"two recordings are called {recording.name!r}: import one by one")
    save_recording(recording, folder / file_name)
    return _Imported(
        recording.name,
        out / file_name,
        {name: module.n_samples for name, module in recording.modules.items()},
        recording.duration,
        sum(len(module.labels) for module in recording.modules.values()),
        recording.complete,
    )


def _tell(imported: list[_Imported], out: Path, as_json: bool) -> None:
    n_modules = sum(len(one.modules) for one in imported)
    n_samples = sum(one.n_samples for one in imported)
    if as_json:
        print_json(
            {
                "out": out,
                "n_recordings": len(imported),
                "n_modules": n_modules,
                "n_samples": n_samples,
                "recordings": [_document(one) for one in imported],
            }
        )
        return
    print_table(
        ("recording", "modules", "samples", "duration [s]", "labels"),
        [
            (one.name, len(one.modules), one.n_samples, f"{one.duration:.2f}", one.n_labels)
            for one in imported
        ],
    )
    show()
    counts = [_count(len(imported), "recording"), _count(n_modules, "module")]
    show(f"{' with '.join(counts)} and {_count(n_samples, 'sample')} in {out}")


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _document(one: _Imported) -> dict[str, Any]:
    return {
        "name": one.name,
        "path": one.path,
        "modules": one.modules,
        "n_samples": one.n_samples,
        "duration": one.duration,
        "n_labels": one.n_labels,
        "complete": one.complete,
    }
