"""Layouts of tables for people: HTML, LaTeX and Markdown.

Each cell holds our value and its interval, and where there is one the paper's value with the
difference, ours minus the paper's.
"""

from typing import NamedTuple, Self

from holdfast_lab.report.rendering import escape_markdown, render
from holdfast_lab.report.result_tables import (
    INFINITE,
    MINUS,
    MISSING,
    ResultTable,
    Row,
    TableLine,
    digits_of,
    number_text,
    pivot,
)

INTERVAL_NOTE = "Small print: 95 % interval, by bootstrap over {counted}."
PAPER_NOTE = "Paper: the value in the paper, and our value minus it."
WIDE_COLUMNS = 7
"""A LaTeX table with more columns is as wide as both columns of a page."""


class CellText(NamedTuple):
    """Texts of a cell; empty where there is nothing to print.

    Attributes:
        ours: our value.
        interval: of our value.
        paper: the paper's value.
        difference: ours minus the paper's.
        exists: whether the table has a row for this cell.
    """

    ours: str = MISSING
    interval: str = ""
    paper: str = ""
    difference: str = ""
    exists: bool = False

    @classmethod
    def of(cls, row: Row | None, digits: int) -> Self:
        """Return the texts of a row, or of no row."""
        if row is None:
            return cls()
        ours, interval = number_text(row.ours, digits), _interval_text(row, digits)
        if row.paper is None:
            return cls(ours, interval, exists=True)
        paper = number_text(row.paper, digits)
        if row.ours is None:  # nothing to subtract
            return cls(ours, interval, paper, exists=True)
        difference = number_text(row.difference, digits, signed=True)
        return cls(ours, interval, paper, difference, exists=True)

    @property
    def paper_text(self) -> str:
        """The paper's value, with the difference in parentheses."""
        return f"{self.paper} ({self.difference})" if self.difference else self.paper


class LineText(NamedTuple):
    """Texts of a line.

    Attributes:
        heads: what the line is about.
        n_repeated: number of first heads that are as in the line above.
        cells: one for each value column.
        n_recordings: number of recordings, if the table has a column for it; else empty.
    """

    heads: list[str]
    n_repeated: int
    cells: list[CellText]
    n_recordings: list[str]

    @property
    def shown_heads(self) -> list[str]:
        """Heads, empty where they repeat those above."""
        return [""] * self.n_repeated + self.heads[self.n_repeated :]

    def texts(self, name: str) -> list[str]:
        """Return one text of each cell, by its name."""
        return [str(getattr(cell, name)) for cell in self.cells]


class TableText(NamedTuple):
    """All texts of a table.

    Attributes:
        name: of its files.
        title: of one line.
        keys: heads of the columns that say what a line is about.
        over: name of what the value columns vary; empty if their heads are clear without it.
        columns: heads of the value columns, and of the number of recordings if it varies.
        n_values: number of value columns.
        lines: of the body.
        notes: below the table.
    """

    name: str
    title: str
    keys: list[str]
    over: str
    columns: list[str]
    n_values: int
    lines: list[LineText]
    notes: list[str]


def to_html(table: ResultTable, number: int | None = None) -> str:
    """Return the table as an HTML `figure`: caption above, notes below.

    Args:
        table: to lay out.
        number: of the table in a report.
    """
    return render("table.html", table=table_text(table), number=number)


def to_latex(table: ResultTable) -> str:
    r"""Return the table as a LaTeX `table`; it needs the packages booktabs and graphicx.

    Intervals and the paper's values are in rows of their own. A table that is wider than the
    text is made smaller.
    """
    text = table_text(table)
    n_columns = len(text.keys) + len(text.columns)
    return render(
        "table.tex",
        table=text,
        environment="table*" if n_columns > WIDE_COLUMNS else "table",
        caption=" ".join(_sentence(sentence) for sentence in (text.title, *text.notes)),
        alignment="l" * len(text.keys) + "r" * len(text.columns),
    )


def to_markdown(table: ResultTable) -> str:
    """Return the table as GitHub's Markdown, with its title above and its notes below."""
    text = table_text(table)
    columns = [f"{text.over} {column}".strip() for column in text.columns[: text.n_values]]
    heads = [*text.keys, *columns, *text.columns[text.n_values :]]
    lines = [[escape_markdown(head) for head in heads]]
    lines.append(["---"] * len(text.keys) + ["--:"] * len(text.columns))
    for line in text.lines:
        cells = []
        for cell in line.cells:
            # A cell that has only the paper's value does not begin with a dash for ours.
            parts = [] if cell.paper and not cell.difference else [cell.ours]
            if cell.interval:
                parts.append(f"<sub>{cell.interval}</sub>")
            if cell.paper:
                parts.append(f"*paper {cell.paper_text}*")
            cells.append("<br>".join(parts))
        lines.append([*map(escape_markdown, line.heads), *cells, *line.n_recordings])
    body = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
    below = " ".join(escape_markdown(_sentence(note)) for note in text.notes)
    return f"**{escape_markdown(text.title)}**\n\n{body}\n" + f"\n{below}\n" * bool(below)


def table_text(table: ResultTable) -> TableText:
    """Return all texts of a table, for any format."""
    grid = pivot(table)
    n_varies = len({row.n for row in table.rows if row.n is not None}) > 1
    digits = [digits_of(table, column) for column in grid.columns]
    lines = []
    for before, line in zip((None, *grid.lines), grid.lines, strict=False):
        cells = [CellText.of(row, n) for row, n in zip(line.cells, digits, strict=True)]
        n_recordings = []
        if n_varies:  # one number, or the smallest and the largest of the line
            counts = sorted({r.n for r in line.cells if r is not None and r.n is not None})
            ends = dict.fromkeys([*counts[:1], *counts[-1:]])
            n_recordings = ["–".join(map(str, ends)) or MISSING]
        lines.append(LineText(list(line.heads), _n_repeated(line, before), cells, n_recordings))
    return TableText(
        name=table.name,
        title=table.title,
        keys=list(table.lines),
        over="" if table.column == "figure" else table.column,
        columns=[*grid.columns, *[table.counted] * n_varies],
        n_values=len(grid.columns),
        lines=lines,
        notes=notes(table),
    )


def notes(table: ResultTable) -> list[str]:
    """Return the notes below the table: its own, and what its cells mean."""
    counts = {row.n for row in table.rows if row.n is not None}
    sentences = []
    if len(counts) == 1:
        (n,) = counts
        sentences.append(f"On {n} {table.counted if n != 1 else table.counted.removesuffix('s')}.")
    if any(row.interval for row in table.rows):
        sentences.append(INTERVAL_NOTE.format(counted=table.counted))
    if any(row.paper is not None for row in table.rows):
        sentences.append(PAPER_NOTE)
    return [note for note in (table.note.strip(), " ".join(sentences)) if note]


def _interval_text(row: Row, digits: int) -> str:
    if row.interval is None:
        return ""
    low, high = (number_text(end, digits).replace(INFINITE, "∞") for end in row.interval)
    if (low, high) in ((MISSING, MISSING), ("∞", "∞")):  # it says nothing that the value does not
        return ""
    if MISSING in (low, high):
        return f"from {low}" if high == MISSING else f"to {high}"
    # A dash between two numbers would look like a minus before the second.
    return f"{low} to {high}" if MINUS in low + high else f"{low}–{high}"


def _n_repeated(line: TableLine, before: TableLine | None) -> int:
    """Return how many of the first heads are as in the line before, the last one excepted."""
    if before is None:
        return 0
    pairs = zip(line.heads[:-1], before.heads[:-1], strict=True)
    return next((k for k, (a, b) in enumerate(pairs) if a != b), max(len(line.heads) - 1, 0))


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."
