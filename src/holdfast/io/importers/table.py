"""Numbers out of CSV files, with the place of whatever is none."""

import csv
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.sensors.types import Array

if TYPE_CHECKING:
    import pyarrow


class Table(NamedTuple):
    """A CSV file of numbers.

    Attributes:
        path: where it came from.
        names: of its columns, as in the header.
        values: (n_rows, n_columns); NaN where a cell is empty or says NaN.
        first_line: line of the file that holds row 0, counted from 1.
        comments: lines before the header that begin with `#`, without it.
    """

    path: Path
    names: tuple[str, ...]
    values: Array
    first_line: int
    comments: tuple[str, ...]

    def columns(self, names: Sequence[str]) -> Array:
        """(n_rows, len(names)) of these columns.

        Raises:
            RecordingError: one is missing.
        """
        if missing := [name for name in names if name not in self.names]:
            raise RecordingError(
                f"{self.path}: column {missing[0]!r} is missing"
                f"{f' and {len(missing) - 1} more' if len(missing) > 1 else ''}; "
                f"it has {_some(self.names)}"
            )
        return self.values[:, [self.names.index(name) for name in names]]


def header_line(path: Path) -> tuple[str, ...]:
    """Names of the columns of a CSV file; none where it is no text."""
    try:
        return _head(path)[1]
    except (RecordingError, UnicodeError):
        return ()


def read_table(path: Path, text: Sequence[str] = ()) -> tuple[Table, dict[str, list[str]]]:
    """The numbers of a CSV file, and the cells of its columns of text.

    Args:
        path: of the file.
        text: names of the columns that hold text; among the numbers they are NaN.

    Raises:
        RecordingError: it cannot be read, is empty, has rows of different lengths, or a cell
            that is no number.
    """
    import pyarrow as pa
    from pyarrow import csv as arrow

    comments, names, first_line = _head(path)
    keys = [str(place) for place in range(len(names))]
    places = {name: names.index(name) for name in text if name in names}
    types = dict.fromkeys(keys, pa.float64())
    types.update({str(place): pa.string() for place in places.values()})
    try:
        table = arrow.read_csv(
            path,
            read_options=arrow.ReadOptions(column_names=keys, skip_rows=first_line - 1),
            convert_options=arrow.ConvertOptions(
                column_types=types, null_values=["", "nan", "NaN", "NAN"]
            ),
        )
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause}") from cause
    except pa.ArrowException as cause:
        raise _explained(path, names, first_line, set(text), str(cause)) from cause
    if len(table) == 0:
        raise _without_samples(path)
    cells = {
        name: [cell or "" for cell in table[place].to_pylist()] for name, place in places.items()
    }
    return Table(path, names, _numbers(table, set(places.values())), first_line, comments), cells


def counts_or(values: Array) -> npt.NDArray[np.generic]:
    """Whole numbers of 16 bits as uint16, other whole ones as int32, all else as it is."""
    if not np.isfinite(values).all() or (values != np.rint(values)).any():
        return values
    if values.min() >= 0 and values.max() <= np.iinfo(np.uint16).max:
        return values.astype(np.uint16)
    limits = np.iinfo(np.int32)
    return (
        values.astype(np.int32)
        if limits.min <= values.min() <= values.max() <= limits.max
        else values
    )


def csv_files(path: Path) -> list[Path]:
    """The file at `path`, or the CSV files in that folder in the order of their names."""
    return [path] if path.is_file() else sorted(path.glob("*.csv"), key=natural)


def natural(path: Path) -> list[str | int]:
    """Sorts names with numbers as a person would: Exp2 before Exp10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path.name)]


def _head(path: Path) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Comments, names of the columns, and the line that holds the first row."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            comments: list[str] = []
            for number, line in enumerate(file, start=1):
                if line.startswith("#"):
                    comments.append(line[1:].strip())
                elif line.strip():
                    names = next(csv.reader([line.rstrip("\r\n")]))
                    return tuple(comments), tuple(name.strip() for name in names), number + 1
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    except (UnicodeError, csv.Error) as cause:
        raise RecordingError(f"{path} is no CSV text: {cause}") from cause
    raise RecordingError(f"{path} is empty; a header line and samples expected")


def _numbers(table: "pyarrow.Table", text: set[int]) -> Array:
    values = np.full((len(table), table.num_columns), np.nan)
    for place in range(table.num_columns):
        if place not in text:
            values[:, place] = table[place].to_numpy()
    return values


def _explained(
    path: Path, names: tuple[str, ...], first_line: int, text: set[str], cause: str
) -> RecordingError:
    """Which cell or row is to blame, found by a second, slow look."""
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = list(file)[first_line - 1 :]
    if not any(line.strip() for line in lines):
        return _without_samples(path)
    for number, row in enumerate(csv.reader(lines), start=first_line):
        if row and len(row) != len(names):
            return RecordingError(
                f"{path}, row {number}: {len(row)} cells given, {len(names)} expected as in the "
                "header"
            )
        for name, cell in zip(names, row, strict=False):
            if name not in text and not _is_number(cell):
                return RecordingError(
                    f"{path}, row {number}, column {name!r}: {cell[:40]!r} given, a number expected"
                )
    return RecordingError(f"{path} is no table of numbers: {' '.join(cause.split())[:200]}")


def _without_samples(path: Path) -> RecordingError:
    return RecordingError(f"{path} has a header but no samples; at least one expected")


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(map(repr, names[:6]))
    return f"{shown} and {len(names) - 6} more" if len(names) > 6 else shown
