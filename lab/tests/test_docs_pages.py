"""The pages of docs/study/ with a source in docs/study/sources/ are what it gives."""

import json
import re

import pytest

from benchmark_script import ROOT, load

script = load("render_pages")
STUDY = ROOT / "docs" / "study"
SOURCES = STUDY / "sources"
NAMES = sorted(path.stem for path in SOURCES.glob("*.json"))
FIELDS = {"columns", "rows", "command", "revision", "date"}


def test_the_pages_are_what_the_sources_give():
    for name, text in script.render(SOURCES).items():
        assert (STUDY / f"{name}.md").read_text("utf-8") == text, (
            f"docs/study/{name}.md differs: run python benchmarks/render_pages.py"
        )


@pytest.mark.parametrize("name", NAMES)
def test_every_table_comes_from_the_figures_with_their_source(name):
    template = (SOURCES / f"{name}.md.j2").read_text("utf-8")
    assert not re.search(r"^\|", template, re.M)
    tables = json.loads((SOURCES / f"{name}.json").read_text("utf-8"))
    assert set(re.findall(r'table\("(\w+)"\)', template)) == set(tables)
    for table in tables.values():
        assert FIELDS <= set(table) <= FIELDS | {"at"}
        assert {len(cells) for cells in table["rows"]} == {len(table["columns"])}
        assert re.fullmatch(r"2026-\d\d-\d\d", table["date"])
        assert re.fullmatch(r"[0-9a-f]{8}|the revision of each row", table["revision"])


TABLE = {"columns": ["set", "share"], "rows": [["a", "1"], ["b", "2"]], "command": "run",
         "revision": "12345678", "date": "2026-11-27"}  # fmt: skip


def test_a_table_has_its_command_revision_and_date():
    rows = "| set | share |\n| --- | --- |\n| a | 1 |\n| b | 2 |\n\n"
    assert script.table_text(TABLE) == f"{rows}`run` (12345678, 2026-11-27)."
    assert script.table_text(TABLE | {"at": "abc"}).startswith(f"{rows}`run` at commit abc (1")


def test_a_cell_is_of_one_row():
    assert script.cell_text(TABLE, "b", "share") == "2"
    with pytest.raises(LookupError, match=r"one row expected for \['c'\], 0 found"):
        script.cell_text(TABLE, "c", "share")
