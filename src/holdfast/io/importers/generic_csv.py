"""Import of CSV files: the one of docs/importing.md, and files of any other logger."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from holdfast.errors import RecordingError
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.names import named_groups
from holdfast.io.importers.reading import ForeignFile, recordings_of
from holdfast.io.importers.table import (
    columns_of_table,
    csv_files,
    errors_named,
    header_line,
    name_prefixes,
)
from holdfast.io.importers.times import time_names
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

_COMMENT = re.compile(r"(?P<key>sensor|unit)\s*:\s*(?:(?P<module>[^=]+?)\s*=)?\s*(?P<value>\S+)")
_OWN_TAXEL = re.compile(r"(?:.+[._])?t\d+[._][xyz]")
_TEXT = re.compile(r"(?:.+\.)?(?:label|cause)")


def can_read(path: Path) -> bool:
    """Return whether `path` is a CSV file of holdfast, or a folder with one."""
    return any(map(_is_own, map(header_line, csv_files(path))))


def can_guess(path: Path) -> bool:
    """Return whether `path` is a CSV file, or a folder with one: by its name, or its columns."""
    files = csv_files(path)
    return any(file.suffix.lower() == ".csv" or _names_taxels(file, ()) for file in files)


def parts(
    path: Path, columns: Columns | None = None, sensors: Mapping[str, Sensor] | None = None
) -> list[Path]:
    """Return the file, or the CSV files of a folder whose columns name taxels.

    If none does, return all of them, so that reading the first gives the reason.

    Args:
        path: path of the file or folder.
        columns: as in `read`.
        sensors: as in `read`.

    Raises:
        RecordingError: there is no CSV file.
    """
    files = csv_files(path)
    if not files:
        raise RecordingError(f"no CSV file in {path}; files NAME.csv expected")
    if path.is_file() or columns:
        return files
    n_taxels = {skin.n_taxels for skin in (sensors or {}).values()}
    return [file for file in files if _names_taxels(file, n_taxels)] or files


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Callable[[str], None] = lambda _: None,
    *,
    accept: bool = False,
) -> Iterator[Recording]:
    """Yield the recordings in a CSV file, or in the CSV files of a folder.

    Args:
        path: path of the file or folder.
        sensors: sensor by module, or of `"*"` for all; they precede those that the file names.
        columns: as in `recordings_of`.
        report: as in `recordings_of`.
        accept: as in `recordings_of`.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    layout = columns or Columns()
    for file, prefix in name_prefixes(parts(path, columns, sensors)).items():
        with errors_named(file):
            text = {"label", "cause", layout.label or "", layout.cause or ""}
            names = {name for name in header_line(file) if _TEXT.fullmatch(name)}
            arrays, head, notes = columns_of_table(file, layout.decimal, text | names)
        matches = (_COMMENT.fullmatch(line) for line in head.comments)
        stated = {(match["key"], match["module"]): match["value"] for match in matches if match}
        source = ForeignFile(file, arrays, "--sensor", stated, notes)
        for recording in recordings_of(source, sensors or {}, columns, report, accept=accept):
            yield replace(recording, name=f"{prefix}{recording.name}")


def _is_own(names: Collection[str]) -> bool:
    return "time" in names and any(map(_OWN_TAXEL.fullmatch, names))


def _names_taxels(file: Path, n_taxels: Collection[int]) -> bool:
    names = header_line(file)
    try:
        return bool(time_names(names)) and bool(named_groups(names, n_taxels))
    except RecordingError:  # a column is missing
        return True
