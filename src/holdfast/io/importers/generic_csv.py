"""Import of CSV files: the generic CSV of docs/importing.md, and files of any other logger.

In the generic CSV the names of the columns are fixed. The columns of any other file are given
(`Columns`), or guessed from its header; what was guessed is reported.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from holdfast.errors import RecordingError
from holdfast.io.importers.csv_columns import Columns, Layout
from holdfast.io.importers.csv_times import TIME_UNITS, clock_seconds, unit_of_column
from holdfast.io.importers.table import (
    Table,
    TableHead,
    csv_files,
    errors_named,
    header_line,
    name_prefixes,
    read_head,
    read_table,
)
from holdfast.io.importers.table_conversion import (
    DEFAULT_MODULE,
    TIME,
    Report,
    ReportOnce,
    recording_of_columns,
    recordings_of_table,
    reported_once,
    settings_of,
)
from holdfast.recordings import Recording
from holdfast.sensors import Sensor, taxel_number

_TAXEL = re.compile(r"(?:(?P<module>.+)[._])?t(?P<taxel>\d+)[._](?P<axis>[xyz])")
_TEXT = re.compile(r"(?:(?P<module>.+)\.)?(?P<column>label|cause)")


def can_read(path: Path) -> bool:
    """Return whether `path` is such a CSV file, or a folder with one."""
    return any(_is_header(header_line(file)) for file in csv_files(path))


def can_guess(path: Path) -> bool:
    """Return whether `path` is a CSV file, or a folder with one: by its name, or its columns."""
    files = csv_files(path)
    return any(f.suffix.lower() == ".csv" or _is_guessable(header_line(f), ()) for f in files)


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Report = lambda _: None,
) -> Iterator[Recording]:
    """Read the recording in a CSV file, or those in the CSV files of a folder.

    Args:
        path: path of the file or folder.
        sensors: sensor by module, or of `"*"` for all; they precede those that the file names.
        columns: columns of the file; by default those of the generic CSV, or a guess.
        report: receives a text about each different guess.

    Raises:
        RecordingError: there is no CSV file, or one has another form.
    """
    once = reported_once(report)
    return (
        replace(recording, name=f"{prefix}{recording.name}")
        for file, prefix in name_prefixes(parts(path, columns, sensors)).items()
        for recording in _recordings(file, sensors or {}, columns, once)
    )


def parts(
    path: Path, columns: Columns | None = None, sensors: Mapping[str, Sensor] | None = None
) -> list[Path]:
    """Return the file, or the CSV files of a folder with columns that can be read.

    If none can, return all of them, so that reading the first gives the reason.

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
    n_taxels = {one.n_taxels for one in (sensors or {}).values()}
    generic = [file for file in files if _is_header(header_line(file))]
    guessable = (file for file in files if _is_guessable(header_line(file), n_taxels))
    return generic or list(guessable) or files


def _is_header(names: tuple[str, ...]) -> bool:
    return TIME in names and any(_TAXEL.fullmatch(name) for name in names)


def _is_guessable(names: tuple[str, ...], n_taxels: Collection[int]) -> bool:
    try:
        Columns().completed(names, n_taxels)
    except RecordingError:
        return False
    return True


def _recordings(
    path: Path,
    sensors: Mapping[str, Sensor],
    columns: Columns | None,
    report: ReportOnce,
) -> list[Recording]:
    with errors_named(path):
        head = read_head(path)
        if columns is None and _is_header(head.names):
            return [_generic(path, head, sensors, report)]

        def read(used: set[str], chosen: Columns) -> tuple[Table, dict[str, list[str]]]:
            numbers: set[str | None] = {*used, chosen.time}
            # Times without a unit may be those of a wall clock, which are cells of text.
            if chosen.time in head.names and chosen.time_unit is None:
                index = head.names.index(chosen.time)
                cells = head.first_row[index : index + 1]
                if cells and clock_seconds(cells) is not None:
                    numbers = set(used)
            return read_table(path, [name for name in head.names if name not in numbers], head)

        return recordings_of_table(head.names, read, path.name, sensors, columns, report)


def _generic(
    path: Path, head: TableHead, sensors: Mapping[str, Sensor], report: ReportOnce
) -> Recording:
    table, cells = read_table(path, [name for name in head.names if _TEXT.fullmatch(name)], head)
    layout, settings = _layout(table), settings_of(table)
    times = table.columns([TIME])[:, 0]
    if not settings:  # not the format of docs/importing.md, in which times are in s
        unit = unit_of_column(TIME, times, str(path))
        times = times * TIME_UNITS[unit]
        if unit != "s":
            line = f"{path.name}: times of column {TIME!r} are taken as {unit}; --columns "
            report(unit, (f"{line}time={TIME}:s if they are in s",))
    return recording_of_columns(table, cells, times, layout, settings, sensors)


def _layout(table: Table) -> Layout:
    """Return the column of each taxel and axis, by module."""
    layout: dict[str, dict[tuple[int, str], str]] = {}
    for name in table.names:
        taxel = _TAXEL.fullmatch(name)
        if taxel:
            columns = layout.setdefault(taxel["module"] or DEFAULT_MODULE, {})
            key = int(taxel["taxel"]), taxel["axis"]
            if key in columns:
                raise RecordingError(
                    f"{table.path}: columns {columns[key]!r} and {name!r} are the same taxel and "
                    "axis; one column for each expected"
                )
            columns[key] = name
        elif name != TIME and not _TEXT.fullmatch(name):
            raise RecordingError(
                f"{table.path}: unknown column {name!r}; {TIME!r}, 'MODULE.t01.x' (or 't01_x'), "
                "'label', 'cause', 'MODULE.label' and 'MODULE.cause' are known; of other files "
                "--columns names the columns"
            )
    if not layout:
        raise RecordingError(f"{table.path}: no taxel columns such as 'thumb.t01.x' or 't01_x'")
    first = min(taxel for columns in layout.values() for taxel, _ in columns)
    if first != 0:
        return layout
    # The file counts taxels from 0.
    return {
        module: {(taxel_number(taxel), axis): name for (taxel, axis), name in columns.items()}
        for module, columns in layout.items()
    }
