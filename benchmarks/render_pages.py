"""Write the tables of docs/ whose figures come from single programs.

    python benchmarks/render_pages.py

A table stands below its mark, `<!--FILE.TABLE-->`: it is the one of that name in
docs/study/sources/FILE.json, with the command that made it, the revision it was measured with and
the date. Change the file, not the table. A new table needs its mark alone.
"""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1] / "docs"
SOURCES = DOCS / "study" / "sources"
MARK = re.compile(r"<!--([\w-]+)\.(\w+)-->\n(?:\n(?:\|.*\n)+\n`.*\n)?")
"""A mark, with its table and the line below it if they are there."""


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


def read_tables(sources: Path = SOURCES) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the tables of all files, by file and name."""
    return {
        (path.stem, name): table
        for path in sorted(sources.glob("*.json"))
        for name, table in json.loads(path.read_text("utf-8")).items()
    }


def render(page: str, tables: Mapping[tuple[str, str], Mapping[str, Any]]) -> str:
    """Return a page with the tables of its marks.

    Raises:
        KeyError: no file has such a table.
    """

    def with_table(mark: re.Match[str]) -> str:
        file, name = mark.groups()
        return f"<!--{file}.{name}-->\n\n{table_text(tables[file, name])}\n"

    return MARK.sub(with_table, page)


def main() -> None:
    """Write all tables."""
    tables = read_tables()
    for path in DOCS.rglob("*.md"):
        path.write_text(render(path.read_text("utf-8"), tables), encoding="utf-8")


if __name__ == "__main__":
    main()
