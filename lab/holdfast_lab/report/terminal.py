"""The main tables of a study on the terminal."""

from msgspec import structs

from holdfast.cli.terminal.console import print_line, print_table
from holdfast_lab.report.result_tables import ResultTable, Row, digits_of, number_text, pivot

PRINTED_COLUMNS: dict[str, tuple[str, ...]] = {
    "confusion": (),
    "real": ("mean AUC", "stable called STABLE [%]"),
    "methods": ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC"),
    "events": ("missed at 50 ms [%]", "missed at 200 ms [%]", "false alarms per minute"),
}
"""Tables that are printed at the end, with their columns; an empty tuple means all columns."""
PRINTED_SPLITS = ("by object", "by recording")
"""Splits that can be printed; the first of those with the most methods is printed."""


def print_main_table(table: ResultTable) -> None:
    """Print a table of `PRINTED_COLUMNS`, with the values of the paper in parentheses."""
    grid = pivot(printed_rows(table))
    has_paper = any(row.paper is not None for row in table.rows)
    print_line(f"{table.title}{' (in parentheses: the paper)' if has_paper else ''}")
    lines = [
        [*line.heads, *(_with_paper(table, cell) for cell in named)]
        for line in grid.lines
        for named in [zip(grid.columns, line.cells, strict=True)]
    ]
    print_table((*table.lines, *grid.columns), lines)
    print_line()


def _with_paper(table: ResultTable, cell: tuple[str, Row | None]) -> str:
    column, row = cell
    if row is None:
        return "-"
    digits = digits_of(table, column)
    paper = "" if row.paper is None else f" ({number_text(row.paper, digits)})"
    return number_text(row.ours, digits) + paper


def printed_rows(table: ResultTable) -> ResultTable:
    """Return the table with the rows to print.

    They are those of one split, at each method's own threshold; glitches count as events.
    """
    columns = PRINTED_COLUMNS[table.name]
    n_rows = {on: sum(row.keys.get("on") == on for row in table.rows) for on in PRINTED_SPLITS}
    chosen = max(PRINTED_SPLITS, key=lambda on: n_rows[on])
    rows = [
        row
        for row in table.rows
        if (not columns or row.keys["figure"] in columns)
        and (not n_rows[chosen] or row.keys["on"] == chosen)
        and row.keys.get("threshold", "own") == "own"
        and row.keys.get("a glitch is", "an event") == "an event"
    ]
    return structs.replace(table, rows=rows)
