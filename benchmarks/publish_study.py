"""Publish the results of a study in docs/, and write the pages that quote them.

    python benchmarks/publish_study.py publish STUDY --real REAL
    python benchmarks/publish_study.py render

The first copies the results of a run and writes the pages, the second writes the pages again.
The tables of real recordings (`real*`) are those of another run, `holdfast study` of the real
recordings alone, so that they can be made anew with each model that ships.

`publish` copies all tables as CSV from the folder of a finished study to docs/study/, in place of
the old ones, and `study.json` with the names of the tables. The pages of `PAGES` are written from
templates in docs/study/ (`*.md.j2`). Change the templates, not the pages: every figure in them is
taken from these files, and lab/tests/test_docs_study.py renders them again.
"""

import argparse
import csv
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("study.md", "study/paper.md", "study/real-data.md")
FIGURES = ("experiment-1.png", "experiment-2.png")
"""Figures of the report that a page shows; they are copied to docs/img/."""
MISSING = "–"
NUMBERS = ("ours", "paper", "difference")
VALUES = (*NUMBERS, "n", "low", "high")
"""Columns of a table that are no keys."""
COMPARED_KEYS = {"method", "baseline", "measure"}
"""Keys of rows that name what is compared."""
DIGITS = 6
"""Significant digits of the numbers from which the pages are written."""

Row = dict[str, Any]
Where = Mapping[str, object]


class Figures:
    """The figures of a published study, as the templates use them.

    A condition selects rows: `{"method": "holdfast", "figure": "AUC"}`. A key that the rows of a
    table do not have selects nothing and excludes nothing.

    Args:
        tables: rows of each table.
    """

    def __init__(self, tables: Mapping[str, list[Row]]) -> None:
        self.tables = tables

    def rows(self, table: str, where: Where) -> list[Row]:
        """Return the rows of a table that meet a condition; none if there is no such table."""
        return [
            row
            for row in self.tables.get(table, [])
            if all(str(row.get(key, value)) == str(value) for key, value in where.items())
        ]

    def has(self, table: str, where: Where | None = None) -> bool:
        """Return whether a table has a row that meets a condition."""
        return bool(self.rows(table, where or {}))

    def value(self, table: str, where: Where, field: str = "ours") -> float | None:
        """Return a number of the one row that meets a condition; None if it has none.

        Raises:
            LookupError: no row, or several rows, meet the condition.
        """
        rows = self.rows(table, where)
        if len(rows) != 1:
            raise LookupError(f"{table}: one row expected for {dict(where)}, {len(rows)} found")
        number = rows[0][field]
        return None if number is None else float(number)

    def cell(
        self,
        table: str,
        where: Where,
        digits: int = 1,
        *,
        interval: bool = False,
        field: str = "ours",
    ) -> str:
        """Return a number as text, with its interval if wanted; a dash without such a table.

        Raises:
            LookupError: the table has rows, but not exactly one that meets the condition.
        """
        if table not in self.tables:
            return MISSING
        text = number_text(self.value(table, where, field), digits)
        ends = self.rows(table, where)[0]["interval"]
        return text + (interval_text(ends, digits) if interval else "")

    def any_cell(self, table: str, where: Where, digits: int = 1, *, interval: bool = False) -> str:
        """Return as `cell`, but a dash if no row meets the condition."""
        if not self.has(table, where):
            return MISSING
        return self.cell(table, where, digits, interval=interval)

    def share_stable(self, table: str, where: Where, figures: Sequence[str]) -> float:
        """Return the accuracy of "always stable" [%]: the share of stable labels.

        It follows from three figures of any method on the same samples, because
        accuracy = share (1 - FNR) + (1 - share) (1 - FPR).

        Args:
            table: name of the table.
            where: condition of the rows of the method.
            figures: names of accuracy, FNR, and FPR or FDR [%].
        """
        accuracy, missed, false = (
            (self.value(table, {**where, "figure": figure}) or 0.0) / 100 for figure in figures
        )
        if figures[2].startswith("FDR"):
            return 100 * (1 - accuracy) / (1 - (1 - missed) * (1 - 2 * false) / (1 - false))
        return 100 * (accuracy - 1 + false) / (false - missed)

    def grid(
        self,
        table: str,
        where: Where,
        lines: Sequence[str],
        column: str = "figure",
        columns: Sequence[str] = (),
        digits: int = 1,
        digits_of: Mapping[str, int] | None = None,
        intervals: Sequence[str] | None = None,
        shown: Mapping[str, Sequence[str]] | None = None,
    ) -> str:
        """Return rows of a table as Markdown, with intervals and the paper's values.

        Args:
            table: name of the table.
            where: condition of the rows.
            lines: keys that name a line.
            column: key whose values are the columns.
            columns: the values that are shown, in this order; all by default.
            digits: after the decimal point.
            digits_of: the same of single columns.
            intervals: columns with their interval; all by default.
            shown: values of keys whose rows are shown, in the order of the rows; all by default.
        """
        body = [
            row
            for row in self.rows(table, where)
            if all(row.get(key) in values for key, values in (shown or {}).items())
        ]
        if not body:
            return f"(The run has no rows for this table: {table}.)"
        names = list(columns) or list(dict.fromkeys(str(row[column]) for row in body))
        cells: dict[tuple[str, ...], dict[str, str]] = {}
        for row in body:
            head = tuple(str(row.get(key, "")) for key in lines)
            name = str(row[column])
            n_digits = (digits_of or {}).get(name, digits)
            kept = row if intervals is None or name in intervals else {**row, "interval": None}
            cells.setdefault(head, {}).setdefault(name, _cell_text(kept, n_digits))
        table_lines = [[*lines, *names], ["---"] * len(lines) + ["--:"] * len(names)]
        table_lines += [
            [*head, *(by_column.get(cell, MISSING) for cell in names)]
            for head, by_column in cells.items()
        ]
        return "\n".join(f"| {' | '.join(map(_escape, cell))} |" for cell in table_lines)


def number_text(value: float | None, digits: int) -> str:
    """Return a number as text.

    Example:
        >>> number_text(91.25, 1), number_text(-0.5, 1), number_text(None, 1)
        ('91.2', '−0.5', '–')
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "infinite"
    return f"{value:.{digits}f}".replace("-", "−")


def interval_text(interval: Sequence[float] | None, digits: int) -> str:
    """Return an interval as text in brackets; empty if there is none."""
    if interval is None:
        return ""
    low, high = (number_text(end, digits) for end in interval)
    return f" ({low} to {high})"


def render(summary: Mapping[str, Any], templates: Path) -> dict[str, str]:
    """Return the text of each page.

    Args:
        summary: of a published study, with its tables.
        templates: folder of the templates.
    """
    environment = Environment(
        loader=FileSystemLoader(templates),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    figures = Figures(summary["tables"])
    public = ("cell", "any_cell", "grid", "has", "share_stable")
    names = {name: getattr(figures, name) for name in public}
    names["compares_methods"] = lambda keys: not COMPARED_KEYS.isdisjoint(keys)
    return {
        page: environment.get_template(f"{Path(page).name}.j2").render(study=summary, **names)
        for page in PAGES
    }


def publish(run: Path, docs: Path, real: Path | None = None) -> None:
    """Copy the results of a run to docs/study/, in place of the old ones.

    Args:
        run: folder of a finished study.
        docs: folder of the documentation.
        real: folder of a finished study of the real recordings, for the tables of them.

    Raises:
        FileNotFoundError: a folder has no finished study.
    """
    summary = json.loads((run / "study.json").read_text("utf-8"))
    folders = dict.fromkeys(summary["tables"], run)
    if real is not None:
        tables = json.loads((real / "study.json").read_text("utf-8"))["tables"]
        of_real = {name: rows for name, rows in tables.items() if name.startswith("real")}
        summary["tables"] |= of_real
        folders |= dict.fromkeys(of_real, real)
    target = docs / "study"
    for old in target.glob("*.csv"):
        old.unlink()
    for name, folder in folders.items():
        shutil.copyfile(folder / "tables" / f"{name}.csv", target / f"{name}.csv")
    for name in FIGURES:
        if (run / "figures" / name).is_file():
            (docs / "img").mkdir(exist_ok=True)
            shutil.copyfile(run / "figures" / name, docs / "img" / name)
    summary["tables"] = list(folders)
    text = json.dumps(summary, ensure_ascii=False, indent=1)
    (target / "study.json").write_text(f"{text}\n", encoding="utf-8")


def published(folder: Path) -> dict[str, Any]:
    """Return what was published in a folder: `study.json`, with the rows of its tables."""
    summary = json.loads((folder / "study.json").read_text("utf-8"))
    tables = {}
    for name in summary["tables"]:
        with (folder / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            tables[name] = [_row(line) for line in csv.DictReader(file)]
    return {**summary, "tables": tables}


def _row(line: Mapping[str, str]) -> Row:
    """Return a row with its keys as text; a key without a value is left out."""
    numbers = {name: _number(line[name]) for name in (*NUMBERS, "low", "high")}
    ends = [numbers.pop("low"), numbers.pop("high")]
    interval = None
    if ends != [None, None] or numbers["ours"] == math.inf:  # an end that is missing has no bound
        interval = [math.inf if end is None else end for end in ends]
    keys = {key: value for key, value in line.items() if key not in VALUES and value}
    return {**keys, **numbers, "interval": interval}


def _number(text: str) -> float | None:
    return float(f"{float(text):.{DIGITS}g}") if text else None


def write_pages(docs: Path) -> None:
    """Write the pages from the published results."""
    for page, text in render(published(docs / "study"), docs / "study").items():
        (docs / page).write_text(text, encoding="utf-8")


def _cell_text(row: Row, digits: int) -> str:
    text = number_text(row["ours"], digits) + interval_text(row["interval"], digits)
    return text if row["paper"] is None else f"{text}; paper {number_text(row['paper'], digits)}"


def _escape(text: str) -> str:
    return text.replace("|", r"\|").replace("_", r"\_")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Publish a study in docs/.")
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("publish")
    command.add_argument("run", type=Path)
    command.add_argument("--real", type=Path)
    commands.add_parser("render")
    options = parser.parse_args()
    if options.command == "publish":
        publish(options.run, DOCS, options.real)
    write_pages(DOCS)


if __name__ == "__main__":
    main()
