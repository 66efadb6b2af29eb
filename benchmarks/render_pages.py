"""Write the pages of docs/study/ whose figures come from single programs.

    python benchmarks/render_pages.py

docs/study/NAME.md is written from docs/study/sources/NAME.md.j2 and NAME.json in the same folder.
Change these, not the page. A template has no table of its own: `{{ table("NAME") }}` writes one,
with the command that made it, the revision it was measured with and the date, and
`{{ cell("NAME", ROW, COLUMN) }}` one of its figures. `ROW` is the beginning of a row, cell by cell.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

STUDY = Path(__file__).parents[1] / "docs" / "study"


def table_text(table: Mapping[str, Any]) -> str:
    """Return a table in Markdown, with the line that says where it comes from.

    Args:
        table: `columns`, `rows`, `command`, `at` (the commit that has its program, if the tree does
            not), `revision` (measured with) and `date`.
    """
    lines = [table["columns"], ["---"] * len(table["columns"]), *table["rows"]]
    texts = [f"| {' | '.join(cells)} |" for cells in lines]
    program = f"`{table['command']}`" + (f" at commit {table['at']}" if "at" in table else "")
    return "\n".join([*texts, "", f"{program} ({table['revision']}, {table['date']})."])


def cell_text(table: Mapping[str, Any], row: str | list[str], column: str) -> str:
    """Return one cell of a table.

    Raises:
        LookupError: the table has not exactly one such row.
        ValueError: the table has no such column.
    """
    start = [row] if isinstance(row, str) else row
    found = [cells for cells in table["rows"] if cells[: len(start)] == start]
    if len(found) != 1:
        raise LookupError(f"one row expected for {start}, {len(found)} found")
    return found[0][table["columns"].index(column)]


def render(sources: Path) -> dict[str, str]:
    """Return the text of each page, by its name."""
    environment = Environment(
        loader=FileSystemLoader(sources), undefined=StrictUndefined, keep_trailing_newline=True
    )
    pages = {}
    for path in sorted(sources.glob("*.json")):
        tables = json.loads(path.read_text("utf-8"))
        pages[path.stem] = environment.get_template(f"{path.stem}.md.j2").render(
            table=lambda name, tables=tables: table_text(tables[name]),
            cell=lambda name, row, column, tables=tables: cell_text(tables[name], row, column),
        )
    return pages


def main() -> None:
    """Write all pages."""
    for name, text in render(STUDY / "sources").items():
        (STUDY / f"{name}.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
