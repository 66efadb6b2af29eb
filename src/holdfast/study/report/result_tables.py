"""Tables of the study: tidy rows, and how they are laid out and written as data.

One row is one figure: what it is about, ours, the paper's. CSV and JSON write the rows as they
are; `holdfast.study.report.table_layouts` lays them out, lines by columns, for people.
"""

import csv
import io
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import msgspec

Key = str | int | float
MEASURED = ("ours", "paper", "difference", "n", "low", "high", "interval", "infinite")
"""Names of a row's own columns: keys are called otherwise."""
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
NOTHING = "–"
INFINITE = "infinite"
MINUS = "−"


class Row(msgspec.Struct, frozen=True):
    """One figure.

    Attributes:
        keys: what it is about: {"classifier": "LogReg", "figure": "accuracy [%]"}.
        ours: None or NaN where there is none; infinity for a delay that never ends.
        paper: what the paper prints.
        n: recordings that it rests on.
        interval: 95 %, by bootstrap over recordings; an end may be None or infinite.
    """

    keys: dict[str, Key]
    ours: float | None
    paper: float | None = None
    n: int | None = None
    interval: tuple[float | None, float | None] | None = None

    @property
    def difference(self) -> float | None:
        """Ours less the paper's, where both are finite."""
        if self.ours is None or self.paper is None:
            return None
        difference = round(self.ours - self.paper, 9)
        return difference if math.isfinite(difference) else None


class ResultTable(msgspec.Struct, frozen=True):
    """Rows that belong together, and how they are laid out.

    Attributes:
        name: of its files: letters, digits, "-" and "_".
        title: of one line.
        note: what a reader must know to read it.
        rows: in the order in which lines and columns appear.
        lines: keys that name a line when laid out.
        column: key that is spread over the columns.
        digits: behind the point.
        digits_of: of single columns, where they differ.

    Raises:
        ValueError: a name that is no file name, no keys that name a line, a key with the name
            of a measured column, a row without its column, or two rows for one cell.
    """

    name: str
    title: str
    note: str
    rows: list[Row]
    lines: tuple[str, ...]
    column: str = "figure"
    digits: int = 1
    digits_of: dict[str, int] = {}

    def __post_init__(self) -> None:
        if not FILE_NAME.fullmatch(self.name):
            raise ValueError(f"a table's name is letters, digits, - and _; {self.name!r} given")
        if not self.lines:
            raise ValueError(f"table {self.name}: no key names its lines")
        taken = [key for key in _keys(self.rows) if key in MEASURED]
        if taken:
            raise ValueError(f"table {self.name}: a key may not be called {taken[0]!r}")
        seen = set()
        for row in self.rows:
            if self.column not in row.keys:
                raise ValueError(f"table {self.name}: a row has no {self.column!r}: {row.keys}")
            if (cell := _cell(self, row)) in seen:
                raise ValueError(f"table {self.name}: two rows for {' / '.join(cell)}")
            seen.add(cell)


class TableLine(NamedTuple):
    """A line of a table that is laid out.

    Attributes:
        heads: what it is about, one text for each of the table's `lines`.
        cells: the row of each column, None where there is none.
    """

    heads: tuple[str, ...]
    cells: tuple[Row | None, ...]


class TableGrid(NamedTuple):
    """A table laid out: lines by columns, in the order in which they first appear."""

    columns: tuple[str, ...]
    lines: tuple[TableLine, ...]


def pivot(table: ResultTable) -> TableGrid:
    """The table as lines by columns; lines that begin alike stand together.

    Example:
        >>> rows = [Row({"finger": "index", "figure": "Acc"}, 94.2),
        ...         Row({"finger": "thumb", "figure": "FDR"}, 5.0)]
        >>> grid = pivot(ResultTable("fingers", "Fingers", "", rows, ("finger",)))
        >>> grid.columns, [line.heads for line in grid.lines]
        (('Acc', 'FDR'), [('index',), ('thumb',)])
        >>> grid.lines[1].cells[0] is None
        True
    """
    cells: dict[tuple[str, ...], dict[str, Row]] = {}
    columns: dict[str, None] = {}
    for row in table.rows:
        *heads, column = _cell(table, row)
        cells.setdefault(tuple(heads), {})[column] = row
        columns[column] = None
    firsts = list(dict.fromkeys(heads[0] for heads in cells))
    lines = (
        TableLine(heads, tuple(found.get(column) for column in columns))
        for heads, found in sorted(cells.items(), key=lambda item: firsts.index(item[0][0]))
    )
    return TableGrid(tuple(columns), tuple(lines))


def number_text(value: float | None, digits: int, *, signed: bool = False) -> str:
    """A number for people: a dash for none, "infinite", a true minus.

    Example:
        >>> number_text(94.25, 1), number_text(None, 1), number_text(float("inf"), 3)
        ('94.2', '–', 'infinite')
        >>> number_text(-0.04, 1, signed=True), number_text(-1.26, 1, signed=True)
        ('0.0', '−1.3')
    """
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return INFINITE if value > 0 else MINUS + INFINITE
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    if not any(digit in text for digit in "123456789"):
        text = text.lstrip("+-")
    return text.replace("-", MINUS)


def digits_of(table: ResultTable, column: str) -> int:
    """How many digits a column shows behind the point."""
    return table.digits_of.get(column, table.digits)


def to_json(table: ResultTable) -> list[dict[str, Any]]:
    """The rows as JSON takes them: keys beside `ours`, `paper`, `difference`, `n`, `interval`.

    JSON has no infinity: it is null, as in every output of the commands, and a row whose `ours`
    is infinite says `"infinite": true`.
    """
    return [_flat(row) for row in table.rows]


def to_csv(table: ResultTable) -> str:
    """The rows as comma-separated text with a header.

    Columns are the keys, then `ours,paper,difference,n,low,high`; an empty field is unknown,
    `inf` infinite.
    """
    keys = _keys(table.rows)
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow([*keys, "ours", "paper", "difference", "n", "low", "high"])
    for row in table.rows:
        low, high = row.interval or (None, None)
        values = (row.ours, row.paper, row.difference, row.n, low, high)
        writer.writerow(
            [*(row.keys.get(key, "") for key in keys), *(_known(value) for value in values)]
        )
    return file.getvalue()


def _flat(row: Row) -> dict[str, Any]:
    interval = None if row.interval is None else [_finite(end) for end in row.interval]
    flat: dict[str, Any] = {key: _json_key(value) for key, value in row.keys.items()}
    flat |= {"ours": _finite(row.ours), "paper": _finite(row.paper)}
    flat |= {"difference": row.difference, "n": row.n, "interval": interval}
    if row.ours is not None and math.isinf(row.ours):
        flat["infinite"] = True
    return flat


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _json_key(value: Key) -> Key | None:
    return _finite(value) if isinstance(value, float) else value


def _known(value: float | None) -> float | str:
    return "" if value is None or math.isnan(value) else value


def _keys(rows: Iterable[Row]) -> list[str]:
    """All keys, in the order in which they first appear."""
    return list(dict.fromkeys(key for row in rows for key in row.keys))


def _cell(table: ResultTable, row: Row) -> tuple[str, ...]:
    """Where the row stands: the heads of its line, and its column."""
    return tuple(_head(row.keys, key) for key in (*table.lines, table.column))


def _head(keys: Mapping[str, Key], key: str) -> str:
    value = keys.get(key, "")
    return f"{value:g}" if isinstance(value, float) else str(value)
