"""Tables of numbers in CSV files; errors name the row and column of a wrong cell."""

import codecs
import csv
import itertools
import re
from array import array
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.files import check_regular
from holdfast.io.importers.stored import StoredArray
from holdfast.sensors.types import Array

MAX_CELL_LENGTH = 1 << 20
"""Maximum length of a cell [characters]; the csv module itself stops at 131,072."""
MAX_HEAD_SIZE = 1 << 20
"""Maximum size of all lines before the first row [characters]."""
MAX_SHOWN_LENGTH = 80
"""Length from which on names of columns are left out of a message [characters]."""
MIN_CELLS = 4
"""Minimum number of cells of a header that a block of other lines precedes."""
MAX_BLOCK = 100
"""Maximum number of lines before such a header."""
SEPARATORS = ",;\t| "
"""Possible separators of cells; a file uses one of them. Several blanks count as one."""
SLIPPED = "slipped"
"""Field of the metadata with the label of a whole recording: whether the object slipped."""

_ANY_CASE = "*.[cC][sS][vV]"
_SEPARATOR_LINE = re.compile(r'"?sep=(?P<separator>.)"?', re.IGNORECASE)
"""First line of a file of a spreadsheet: its separator."""
_ENCODING_SIZE = 1 << 16
"""Size of the start of a file that decides its encoding [bytes]."""
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"-?\d{1,3}([.,]\d{3})+")
_GROUPED = re.compile(r"-?\d{1,3}(,\d{3})+(\.\d*)?")
_OTHER_FORMS = re.compile(r"[^\x00-\x7f]|[_\r\n]")
"""Characters with which Python reads numbers that no other program writes, such as `1_000`."""


class TableHead(NamedTuple):
    """Head of a file: all lines before its first row.

    Attributes:
        comments: lines that begin with `#`, without the `#`.
        names: of the columns; `column1` and so on without a header.
        first_line: line of the first row in the file, counted from 1.
        separator: between the cells.
        encoding: of the text.
        named: whether the names are those of a header.
        first_row: cells of the first row.
        n_skipped: number of lines before the header that are another table.
    """

    comments: tuple[str, ...]
    names: tuple[str, ...]
    first_line: int
    separator: str
    encoding: str
    named: bool
    first_row: tuple[str, ...]
    n_skipped: int = 0


class Table(NamedTuple):
    """A CSV file of numbers.

    Attributes:
        path: path of the file.
        names: names of the columns in the header.
        values: (n_rows, n_columns); NaN for a cell that is empty or NaN.
        first_line: line of row 0 in the file, counted from 1.
        comments: lines before the header that begin with `#`, without the `#`.
    """

    path: Path
    names: tuple[str, ...]
    values: Array
    first_line: int
    comments: tuple[str, ...]

    def columns(self, names: Sequence[str]) -> Array:
        """Return (n_rows, len(names)): the columns with these names.

        Raises:
            RecordingError: a column is missing.
        """
        indices = {name: index for index, name in reversed(list(enumerate(self.names)))}
        if missing := [name for name in names if name not in indices]:
            raise RecordingError(
                f"{self.path}: column {missing[0]!r} is missing"
                f"{f' and {len(missing) - 1} more' if len(missing) > 1 else ''}; "
                f"it has {some_names(self.names)}"
            )
        return self.values[:, [indices[name] for name in names]]


def header_line(path: Path) -> tuple[str, ...]:
    """Return the names of the columns of a CSV file, `column1` and so on without a header.

    None if it is not text.
    """
    try:
        return read_head(path).names
    except (RecordingError, UnicodeError):
        return ()


def read_table(
    path: Path,
    text: Sequence[str] = (),
    head: TableHead | None = None,
    *,
    decimal: str | None = None,
    wrong: dict[str, str] | None = None,
) -> tuple[Table, dict[str, list[str]]]:
    """Read the numbers of a CSV file, and the cells of its columns of text.

    Cells are separated by commas, semicolons, tabs or blanks. A number may have a decimal comma if
    cells are not separated by commas.

    Args:
        path: path of the file.
        text: names of the columns of text; they are NaN among the numbers.
        head: what `read_head` returned, if it is known.
        decimal: `comma` or `point`; the other one separates thousands.
        wrong: receives the first cell of each column that is no number, and under an empty name a
            last row that is cut; None to raise an error for them.

    Raises:
        RecordingError: the file cannot be read, is empty, has rows of different lengths, a cell
            that is not a number, or both decimal commas and points.
    """
    head = head or read_head(path)
    names, first_line, separator = head.names, head.first_line, head.separator
    cells: dict[int, list[str]] = {names.index(name): [] for name in text if name in names}
    numbers = array("d")
    marks = _DecimalMarks(path, separator, decimal)
    uneven = ""
    try:
        with _long_cells():
            rows = csv.reader(_lines(path, head), delimiter=separator)
            for number, row in enumerate(rows, start=first_line):
                if row and (uneven or len(row) != len(names)):
                    problem = f"{len(row)} cells given, {len(names)} expected as in the header"
                    uneven = uneven or f"{path}, row {number}: {problem}"
                    if wrong is None or len(row) > len(names) or "" in wrong:
                        raise RecordingError(uneven)
                    wrong[""] = f"the last row, {number}, is cut and left out: {problem}"
                elif row:
                    numbers.extend(_numbers(path, number, names, row, cells, marks, wrong))
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    except (UnicodeError, csv.Error) as cause:
        raise RecordingError(f"{path} is not a table of numbers: {_text(cause)}") from cause
    if not numbers:
        raise RecordingError(f"{path} has a header but no samples; at least one expected")
    if wrong is not None:
        marks.check()
    values = np.frombuffer(numbers).reshape(-1, len(names))
    return (
        Table(path, names, values, first_line, head.comments),
        {names[index]: column for index, column in cells.items()},
    )


class _DecimalMarks:
    """Conversion of decimal commas to points; a file has only one of the two.

    Args:
        path: path of the file.
        separator: between cells; with commas there is no decimal comma.
        decimal: `comma` or `point`, if the user says it: the other one separates thousands.
    """

    def __init__(self, path: Path, separator: str, decimal: str | None) -> None:
        self._path = path
        self._used = {"comma": ",", "point": "."}.get(decimal or "", "")
        self._thousands = {"comma": ".", "point": ","}.get(decimal or "", "")
        self._converts = separator != "," or bool(decimal)
        # Cells such as 1.451 beside 946, and no others, may have points between thousands.
        self._n_grouped, self._n_plain, self._is_clear = 0, 0, bool(decimal) or separator == ","

    def converted(self, number: int, row: list[str]) -> list[str]:
        """Return a row of numbers without decimal commas.

        Raises:
            RecordingError: the file has decimal commas and points.
        """
        if not self._converts:
            return row
        if self._thousands:
            row = [cell.replace(self._thousands, "") for cell in row]
        text = "".join(row)
        used = {mark for mark in ",." if mark in text} | {self._used} - {""}
        if len(used) > 1:
            raise RecordingError(
                f"{self._path}, row {number}: numbers with a comma and with a point given: give "
                "--columns decimal=comma, or decimal=point, if the other one separates thousands"
            )
        self._used = "".join(used)
        if not self._is_clear:
            self._look(row)
        return [cell.replace(",", ".", 1) for cell in row] if self._used == "," else row

    def _look(self, row: list[str]) -> None:
        marked = [cell for cell in row if self._used and self._used in cell]
        plain = [cell.strip("-") for cell in row if cell not in marked and cell.strip()]
        grouped = sum(map(bool, map(_THOUSANDS.fullmatch, marked)))
        self._is_clear = grouped < len(marked) or any(len(cell) > 3 for cell in plain)
        self._n_grouped += grouped
        self._n_plain += len(plain)

    def check(self) -> None:
        """Check at the end that no number can have a mark between thousands.

        Raises:
            RecordingError: all have.
        """
        # One column of whole numbers beside others with three decimals is no doubt.
        if not self._is_clear and self._n_grouped and self._n_plain > 0.2 * self._n_grouped:
            name = "comma" if self._used == "." else "point"
            other = "point" if name == "comma" else "comma"
            raise RecordingError(
                f"{self._path}: numbers such as 1{self._used}451 beside whole numbers below 1000 "
                f"given: give --columns decimal={name} if these are thousands, else decimal={other}"
            )


def _numbers(
    path: Path,
    number: int,
    names: Sequence[str],
    row: list[str],
    cells: dict[int, list[str]],
    marks: _DecimalMarks,
    wrong: dict[str, str] | None,
) -> list[float]:
    """Return the numbers of a row; NaN for empty cells and text, which is appended to `cells`.

    The first wrong cell of each column goes to `wrong`; without it, it is an error.

    Raises:
        RecordingError: a cell is not a number.
        UnicodeError: a cell of text is not UTF-8.
    """
    for index, column in cells.items():
        row[index].encode()
        column.append(row[index])
        row[index] = ""
    row = marks.converted(number, row)
    if not _OTHER_FORMS.search("".join(row)):
        with suppress(ValueError):  # a cell is empty or wrong
            return list(map(float, row))
    # Cell by cell, which is slower: some are empty, or the error names the first that is wrong.
    numbers: list[float] = []
    for name, cell in zip(names, row, strict=True):
        value = None
        if not _OTHER_FORMS.search(cell):
            with suppress(ValueError):
                value = float(cell or "nan")
        if value is None:
            text = f"{path}, row {number}, column {name!r}: {_start(cell)} given, a number expected"
            if _GROUPED.fullmatch(cell.strip()):
                text += "; --columns decimal=point if the comma separates thousands"
            if wrong is None:
                raise RecordingError(text)
            wrong.setdefault(name, text)
            value = np.nan
        numbers.append(value)
    return numbers


@contextmanager
def _long_cells() -> Iterator[None]:
    """Let the csv module read cells of up to `MAX_CELL_LENGTH` characters."""
    before = csv.field_size_limit(MAX_CELL_LENGTH)
    try:
        yield
    finally:
        csv.field_size_limit(before)


def with_integer_type(values: Array) -> npt.NDArray[np.generic]:
    """Convert whole numbers to uint16 or int32 if they fit; return other values unchanged."""
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
    """Return the file at `path`, or the CSV files in that folder in natural order.

    Without any, those in the folders inside it, folder by folder.
    """
    if path.is_file():
        return [path]
    if inside := sorted(path.glob(_ANY_CASE), key=natural_order):
        return inside
    deeper = (file for file in path.glob(f"*/{_ANY_CASE}") if not file.parent.name.startswith("."))
    return sorted(deeper, key=lambda file: (natural_order(file.parent), natural_order(file)))


def name_prefixes(parts: Sequence[Path]) -> dict[Path, str]:
    """Return what to put before the names of the recordings of each part.

    It is the name of the folder where files of two folders have the same name, else empty.

    Example:
        >>> name_prefixes([Path("a/log.csv"), Path("b/log.csv")])[Path("b/log.csv")]
        'b_'
        >>> name_prefixes([Path("a/1.csv"), Path("a/2.csv")])[Path("a/1.csv")]
        ''
    """
    stems = {part.name if part.is_dir() else part.stem for part in parts}
    apart = len(stems) < len(parts) and len({part.parent for part in parts}) > 1
    return {part: f"{part.parent.name}_" if apart else "" for part in parts}


class CsvFormat(NamedTuple):
    """Format of CSV files that are recognised by their header.

    Attributes:
        is_header: whether the columns have the names of the format.
        expected: message about a folder without such a file, with `{}` for its path.
        every_file: whether all CSV files of a folder are read, also those with another header.
    """

    is_header: Callable[[tuple[str, ...]], bool]
    expected: str
    every_file: bool = False

    def can_read(self, path: Path) -> bool:
        """Return whether `path` is such a CSV file, or a folder with one."""
        return any(self.is_header(header_line(file)) for file in csv_files(path))

    def parts(self, path: Path) -> list[Path]:
        """Return the file, or the files of this format in a folder.

        Raises:
            RecordingError: there is none.
        """
        files = csv_files(path)
        if path.is_dir() and not self.every_file:
            files = [file for file in files if self.is_header(header_line(file))]
        if not files:
            raise RecordingError(self.expected.format(path))
        return files


@contextmanager
def errors_named(source: object) -> Iterator[None]:
    """Add the path of a file, or another source, to the errors that do not have it.

    Raises:
        RecordingError: the block raised one.
    """
    try:
        yield
    except RecordingError as cause:
        text = str(cause)
        raise RecordingError(text if str(source) in text else f"{source}: {text}") from cause


def natural_order(path: Path) -> list[str | int]:
    """Return a sort key for file names with numbers: Exp2 before Exp10."""
    # Every second part is a number. Of more than 640 digits, Python may refuse to make an `int`.
    parts = re.split(r"(\d{1,640})", path.name)
    return [int(part) if k % 2 else part for k, part in enumerate(parts)]


def read_head(path: Path) -> TableHead:
    """Return what is before the first row of a file, and how its cells are separated.

    The header of `numpy.savetxt` begins with `#`: it is the last comment, with as many cells as
    the first row.

    Raises:
        RecordingError: the file cannot be read, is empty or is not text.
    """
    try:
        check_regular(path)
        encoding = _encoding(path)
        with path.open(encoding=encoding, newline="") as file:
            comments: list[str] = []
            separators = SEPARATORS
            for number, line in enumerate(_first_lines(file), start=1):
                if line.startswith("#"):
                    comments.append(line[1:].strip())
                elif number == 1 and (
                    separator_line := _SEPARATOR_LINE.fullmatch(line.strip("\r\n"))
                ):
                    separators = separator_line["separator"]
                elif line.strip():
                    lines = [line, file.readline(MAX_HEAD_SIZE)]
                    names, separator, n = _header(lines, file, separators)
                    if n or not _is_sample(names, separator):
                        row, first = _cells(lines[n + 1], separator), number + n + 1
                        n_skipped = first - 2 if n else 0
                        return TableHead(
                            tuple(comments), names, first, separator, encoding, True, row, n_skipped
                        )
                    numbered = tuple(f"column{k + 1}" for k in range(len(names)))
                    title = _cells(comments[-1], separator) if comments else ()
                    named = len(title) == len(names)
                    if named:
                        comments.pop()
                    shown = title if named else numbered
                    return TableHead(
                        tuple(comments), shown, number, separator, encoding, named, names
                    )
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    except (UnicodeError, csv.Error) as cause:
        raise RecordingError(f"{path} is not CSV text: {_text(cause)}") from cause
    raise RecordingError(f"{path} is empty; a header line and samples expected")


def _header(lines: list[str], file: TextIO, separators: str) -> tuple[tuple[str, ...], str, int]:
    """Return the names in the header, the separator, and the index of the header among the lines.

    A block of lines of a few cells, such as a description of the session, may precede it.

    Args:
        lines: the first two; those that are read more are appended.
        file: has the others.
        separators: that may be between cells.
    """
    names, separator = _names(lines[0].rstrip("\r\n"), lines[1], separators)
    if len(names) < MIN_CELLS or len(_cells(lines[1], separator)) < len(names):
        lines += islice(iter(lambda: file.readline(MAX_HEAD_SIZE), ""), MAX_BLOCK)
        for n, (line, after) in enumerate(itertools.pairwise(lines)):
            titles, mark = _names(line.rstrip("\r\n"), after, separators)
            is_table = len(titles) == len(_cells(after, mark)) >= MIN_CELLS
            if n and is_table and len(titles) > 2 * len(names):
                return titles, mark, n
    return names, separator, 0


def columns_of_table(
    path: Path, decimal: str | None = None, text: Collection[str] = ()
) -> tuple[dict[str, StoredArray], TableHead, list[str]]:
    """Return the columns of a CSV file, what is before them, and lines about what was left out.

    A column is text if its first cell is. A cell that is no number is an error if its column is
    read.

    Args:
        path: path of the file.
        decimal: as in `read_table`.
        text: names of columns of text.

    Raises:
        RecordingError: as `read_table`, or two columns have one name.
    """
    head = read_head(path)
    if doubled := [name for name, n in Counter(head.names).items() if n > 1 and name]:
        raise RecordingError(f"two columns are named {doubled[0]!r}; one name for each expected")
    firsts = dict(zip(head.names, head.first_row, strict=False))
    words = [name for name, cell in firsts.items() if name in text or _is_text(cell)]
    wrong: dict[str, str] = {}
    table, cells = read_table(path, words, head, decimal=decimal, wrong=wrong)
    arrays = {}
    for k, name in enumerate(head.names):
        values = np.array(cells[name]) if name in cells else table.values[:, k]

        def read(name: str = name, values: npt.NDArray[Any] = values) -> npt.NDArray[Any]:
            if name in wrong:
                raise RecordingError(wrong[name])
            return values

        arrays[name] = StoredArray(values.shape, values.dtype.kind, read)
    n = head.n_skipped
    notes = [f"{n} lines before the header are left out"] if n else []
    return arrays, head, notes + ([wrong[""]] if "" in wrong else [])


def _is_text(cell: str) -> bool:
    number = cell.replace(",", "").replace(".", "")
    return bool(cell) and not _NUMBER.fullmatch(number) and number.lower() not in ("nan", "inf")


def _encoding(path: Path) -> str:
    """Return the encoding of a file: UTF-16 by its first bytes, UTF-8, or else cp1252.

    Raises:
        UnicodeError: it begins with bytes that no text has.
    """
    with path.open("rb") as file:
        start = file.read(_ENCODING_SIZE)
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(start)
    except UnicodeError:
        text = start.decode("cp1252", errors="ignore")
        if _CONTROL.search(text) or len(text) < len(start):
            raise
        return "cp1252"
    return "utf-8-sig"


def _names(header: str, following: str, separators: str) -> tuple[tuple[str, ...], str]:
    """Return the names in a header line, and the separator.

    It is the first that gives several names, and as many cells in the following line; else the
    first that gives several.
    """
    several: tuple[tuple[str, ...], str] | None = None
    for separator in separators:
        names = _cells(header, separator)
        if len(names) > 1:
            several = several or (names, separator)
            if len(_cells(following, separator)) == len(names):
                return names, separator
    return several or ((header.strip().strip('"'),), separators[0])


def _cells(line: str, separator: str) -> tuple[str, ...]:
    """Return the cells of a line, without blanks around them."""
    if separator == " ":
        line = " ".join(line.split())
    with _long_cells():
        return tuple(name.strip() for name in next(csv.reader([line], delimiter=separator), []))


def _is_sample(names: Sequence[str], separator: str) -> bool:
    """Return whether the first line has numbers, other than those with which columns are named."""
    if separator != ",":
        names = [name.replace(",", ".", 1) for name in names]
    named = [str(k) for k in range(len(names) + 1)]
    return (
        len(names) > 3
        and list(names) not in (named[:-1], named[1:])
        and all(map(_NUMBER.fullmatch, names))
    )


def _first_lines(file: TextIO) -> Iterator[str]:
    """Yield the lines of a file, which must not be long before the first row.

    Raises:
        csv.Error: they are.
    """
    n_left = MAX_HEAD_SIZE
    while line := file.readline(n_left + 1):
        n_left -= len(line)
        if n_left < 0:
            raise csv.Error(f"more than {MAX_HEAD_SIZE} characters before the first row")
        yield line


def _lines(path: Path, head: TableHead) -> Iterator[str]:
    """Yield the lines of a file from its first row on; blanks between cells as one."""
    with path.open(encoding=head.encoding, errors="surrogateescape", newline="") as file:
        for line in islice(file, head.first_line - 1, None):
            yield " ".join(line.split()) + "\n" if head.separator == " " else line


def _start(cell: str) -> str:
    """Return the start of a cell, with its length if it is longer."""
    return repr(cell[:40]) + (f"... ({len(cell)} characters)" if len(cell) > 40 else "")


def _text(problem: Exception) -> str:
    """Return the text of an error of the csv module; a long cell has its own."""
    if "field limit" in str(problem):
        return f"a cell of more than {MAX_CELL_LENGTH} characters"
    return str(problem)


def some_names(names: Sequence[str]) -> str:
    """Return the first names of columns, and the starts of long ones, for a message."""
    return first_texts([*map(_start, names)])


def first_texts(texts: Sequence[str]) -> str:
    """Return the first of some texts for a message, and how many more there are.

    Example:
        >>> first_texts([20 * "a", 20 * "b", 50 * "c"])
        'aaaaaaaaaaaaaaaaaaaa, bbbbbbbbbbbbbbbbbbbb and 1 more'
    """
    n = min(len(texts), 6)
    while n > 1 and sum(map(len, texts[:n])) > MAX_SHOWN_LENGTH:
        n -= 1
    more = f" and {len(texts) - n} more" if n < len(texts) else ""
    return (", ".join(texts[:n]) or "none") + more
