"""Tables of results: rows of values, and how they are written as data.

A row is one value: what it is about, ours, the paper's. CSV and JSON write the rows as they are;
`holdfast_lab.report.table_layouts` lays them out as lines and columns.
"""

import math
import re
from typing import Any, NamedTuple

import msgspec

from holdfast.csv_cells import csv_text

Key = str | int | float
RESERVED_KEYS = (
    "ours", "paper", "difference", "value", "n", "low", "high", "interval", "infinite",
)  # fmt: skip
"""Names of a row's own columns, which no key may have."""
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
MISSING = "–"
INFINITE = "infinite"
MINUS = "−"


class Row(msgspec.Struct, frozen=True):
    """One value of a table.

    Attributes:
        keys: what it is about: {"classifier": "LogReg", "figure": "accuracy [%]"}.
        ours: our value; None or NaN if there is none, infinity for a delay that never ends.
        paper: the value in the paper.
        n: number of recordings or trials behind the value.
        interval: 95 %, by bootstrap over recordings or trials; an end may be None or infinite.
    """

    keys: dict[str, Key]
    ours: float | None
    paper: float | None = None
    n: int | None = None
    interval: tuple[float | None, float | None] | None = None

    @property
    def difference(self) -> float | None:
        """Ours minus the paper's, if both are finite."""
        if self.ours is None or self.paper is None:
            return None
        difference = round(self.ours - self.paper, 9)
        return difference if math.isfinite(difference) else None


class ResultTable(msgspec.Struct, frozen=True):
    """Rows of one table, and how they are laid out.

    Attributes:
        name: of its files: letters, digits, "-" and "_".
        title: of one line.
        note: explanation for the reader.
        rows: in the order in which lines and columns appear.
        lines: keys that name a line of the layout.
        column: key whose values are the columns of the layout.
        digits: after the decimal point.
        digits_of: the same of single columns that differ.
        counted: what `n` of the rows counts, in the plural.
        has_paper: whether values of the paper are compared with ours. Without them, a row of
            CSV and JSON has `value` instead of `ours`, `paper` and `difference`.

    Raises:
        ValueError: the name is no file name, no key names a line, a key has a reserved name, a
            row has no column, or two rows have the same cell.
    """

    name: str
    title: str
    note: str
    rows: list[Row]
    lines: tuple[str, ...]
    column: str = "figure"
    digits: int = 1
    digits_of: dict[str, int] = {}
    counted: str = "recordings"
    has_paper: bool = True

    def __post_init__(self) -> None:
        if not FILE_NAME.fullmatch(self.name):
            raise ValueError(f"a table's name is letters, digits, - and _; {self.name!r} given")
        if not self.lines:
            raise ValueError(f"table {self.name}: no key names its lines")
        reserved = [key for key in self.keys if key in RESERVED_KEYS]
        if reserved:
            raise ValueError(f"table {self.name}: a key may not be called {reserved[0]!r}")
        seen = set()
        for row in self.rows:
            if self.column not in row.keys:
                raise ValueError(f"table {self.name}: a row has no {self.column!r}: {row.keys}")
            if (cell := self.cell(row)) in seen:
                raise ValueError(f"table {self.name}: two rows for {' / '.join(cell)}")
            seen.add(cell)

    @property
    def keys(self) -> list[str]:
        """All keys of the rows, in the order in which they first appear."""
        return list(dict.fromkeys(key for row in self.rows for key in row.keys))

    def cell(self, row: Row) -> tuple[str, ...]:
        """Return the position of a row in the layout: the heads of its line, and its column."""
        values = [row.keys.get(key, "") for key in (*self.lines, self.column)]
        return tuple(f"{value:g}" if isinstance(value, float) else str(value) for value in values)

    def values(self, row: Row) -> dict[str, float | None]:
        """Return the values of a row, by the names that they have in files."""
        if self.has_paper:
            return {"ours": row.ours, "paper": row.paper, "difference": row.difference}
        return {"value": row.ours}


class TableLine(NamedTuple):
    """A line of a layout.

    Attributes:
        heads: what the line is about, one text for each of the table's `lines`.
        cells: the row of each column, None if there is none.
    """

    heads: tuple[str, ...]
    cells: tuple[Row | None, ...]


class TableGrid(NamedTuple):
    """A table as lines and columns, in the order in which they first appear."""

    columns: tuple[str, ...]
    lines: tuple[TableLine, ...]


def pivot(table: ResultTable) -> TableGrid:
    """Return the table as lines and columns; lines with the same first head are adjacent.

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
        *heads, column = table.cell(row)
        cells.setdefault(tuple(heads), {})[column] = row
        columns[column] = None
    firsts = list(dict.fromkeys(heads[0] for heads in cells))
    lines = (
        TableLine(heads, tuple(by_column.get(column) for column in columns))
        for heads, by_column in sorted(cells.items(), key=lambda item: firsts.index(item[0][0]))
    )
    return TableGrid(tuple(columns), tuple(lines))


def number_text(value: float | None, digits: int, *, signed: bool = False) -> str:
    """Return a number as text: a dash if there is none, "infinite", a typographic minus.

    Example:
        >>> number_text(94.25, 1), number_text(None, 1), number_text(float("inf"), 3)
        ('94.2', '–', 'infinite')
        >>> number_text(-0.04, 1, signed=True), number_text(-1.26, 1, signed=True)
        ('0.0', '−1.3')
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return INFINITE if value > 0 else MINUS + INFINITE
    text = f"{value:+.{digits}f}" if signed else f"{value:.{digits}f}"
    # A value that is rounded to zero has no sign.
    if not any(digit in text for digit in "123456789"):
        text = text.lstrip("+-")
    return text.replace("-", MINUS)


def digits_of(table: ResultTable, column: str) -> int:
    """Return how many digits a column shows after the decimal point."""
    return table.digits_of.get(column, table.digits)


def to_json(table: ResultTable) -> list[dict[str, Any]]:
    """Return the rows for JSON: their keys, `ours`, `paper`, `difference`, `n`, `interval`.

    Without a paper they have `value` instead of the first three. JSON has no infinity: it is
    null, as in every output of the commands. A row whose value is infinite has
    `"infinite": true`.
    """
    rows = []
    for row in table.rows:
        flat: dict[str, Any] = {
            key: _finite(value) if isinstance(value, float) else value
            for key, value in row.keys.items()
        }
        flat |= {name: _finite(value) for name, value in table.values(row).items()}
        flat["n"] = row.n
        flat["interval"] = None if row.interval is None else [_finite(end) for end in row.interval]
        if row.ours is not None and math.isinf(row.ours):
            flat["infinite"] = True
        rows.append(flat)
    return rows


def to_csv(table: ResultTable) -> str:
    """Return the rows as comma-separated text with a header.

    The columns are the keys, then `ours,paper,difference,n,low,high`, or without a paper
    `value,n,low,high`. An empty field is unknown, `inf` is infinite.
    """
    # Of a row without keys, because the header does not depend on the rows.
    names = list(table.values(Row({}, None)))
    lines: list[list[object]] = [[*table.keys, *names, "n", "low", "high"]]
    for row in table.rows:
        values = (*table.values(row).values(), row.n, *(row.interval or (None, None)))
        fields = ("" if value is None or math.isnan(value) else value for value in values)
        lines.append([*(row.keys.get(key, "") for key in table.keys), *fields])
    return csv_text(lines)


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
