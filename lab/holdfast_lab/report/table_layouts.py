"""Layout of tables for people: Markdown.

Each cell holds our value and its interval, and where there is one the paper's value with the
difference, ours minus the paper's.
"""

import re

from holdfast_lab.report.result_tables import (
    INFINITE,
    MINUS,
    MISSING,
    ResultTable,
    Row,
    digits_of,
    number_text,
    pivot,
)

INTERVAL_NOTE = "Small print: 95 % interval, by bootstrap over {counted}."
PAPER_NOTE = "Paper: the value in the paper, and our value minus it."


def to_markdown(table: ResultTable) -> str:
    """Return the table as GitHub's Markdown, with its title above and its notes below."""
    grid = pivot(table)
    n_varies = len({row.n for row in table.rows if row.n is not None}) > 1
    digits = [digits_of(table, column) for column in grid.columns]
    over = "" if table.column == "figure" else table.column
    columns = [f"{over} {column}".strip() for column in grid.columns]
    heads = [*table.lines, *columns, *[table.counted] * n_varies]
    lines = [[escape_markdown(head) for head in heads]]
    lines.append(["---"] * len(table.lines) + ["--:"] * (len(heads) - len(table.lines)))
    for line in grid.lines:
        cells = [cell_text(row, n) for row, n in zip(line.cells, digits, strict=True)]
        if n_varies:  # one number, or the smallest and the largest of the line
            counts = sorted({r.n for r in line.cells if r is not None and r.n is not None})
            ends = dict.fromkeys([*counts[:1], *counts[-1:]])
            cells.append("–".join(map(str, ends)) or MISSING)
        lines.append([*map(escape_markdown, line.heads), *cells])
    body = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
    below = " ".join(escape_markdown(_sentence(note)) for note in notes(table))
    return f"**{escape_markdown(table.title)}**\n\n{body}\n" + f"\n{below}\n" * bool(below)


def cell_text(row: Row | None, digits: int) -> str:
    """Return the text of a cell: our value, its interval and the paper's value."""
    if row is None:
        return MISSING
    parts = []
    # A cell that has only the paper's value does not begin with a dash for ours.
    if row.paper is None or row.ours is not None:
        parts.append(number_text(row.ours, digits))
    if interval := _interval_text(row, digits):
        parts.append(f"<sub>{interval}</sub>")
    if row.paper is not None:
        paper = number_text(row.paper, digits)
        if row.ours is not None:
            paper += f" ({number_text(row.difference, digits, signed=True)})"
        parts.append(f"*paper {paper}*")
    return "<br>".join(parts)


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


def escape_markdown(text: str) -> str:
    r"""Escape text for a cell of a Markdown table, on one line.

    Example:
        >>> print(escape_markdown("a|b <c> F_a [%]"))
        a\|b \<c\> F\_a [%]
    """
    return re.sub(r"([\\`*_|<>&~#]|\](?=[\[(:]))", r"\\\1", " ".join(text.split()))


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


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."
