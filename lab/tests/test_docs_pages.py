"""Tables with figures in docs/ are made from published files, or their page has a reason here."""

import re

import pytest

from benchmark_script import ROOT, load

script = load("render_pages")
DOCS = ROOT / "docs"
TABLES = script.read_tables()
PAGES = {p.relative_to(ROOT).as_posix(): p.read_text("utf-8") for p in DOCS.rglob("*.md")}
PAGES["README.md"] = (ROOT / "README.md").read_text("utf-8")
FIELDS = {"columns", "rows", "command", "revision", "date"}
BY_OTHER_TESTS = {
    "README.md": "test_docs_study.py and test_docs_trial.py: its rows quote the files",
    "docs/study/performance.md": "each row has its command; times are of a machine",
    "docs/study.md": "test_docs_study.py",
    "docs/study/paper.md": "test_docs_study.py",
    "docs/study/real-data.md": "test_docs_study.py",
    "docs/study/grip-trials.md": "test_docs_trial.py",
}
"""Pages whose figures come from another place."""
MEASURE_NOTHING = {
    "docs/sensors.md": "sizes and rates of data sheets, whose source is in the row",
    "docs/teach.md": "the length of the steps",
    "docs/grip.md": "settings and their defaults",
    "docs/twin.md": "settings of the profiles",
    "docs/metrics.md": "limits of the words of a verdict",
}
"""Pages with a table of numbers that no program measures."""
TABLE = re.compile(r"(?:^\|.*\n)+", re.M)
NUMBER = re.compile(r"\W*\d")


def has_figures(table):
    """Whether a third of the cells beside the first column begin with a number."""
    rows = [re.split(r"(?<!\\)\|", line.strip("|\n")) for line in table.splitlines()[2:]]
    cells = [cell for row in rows for cell in row[1:]]
    return 3 * sum(bool(NUMBER.match(cell)) for cell in cells) >= len(cells) > 0


def unmarked(text):
    """Return the tables with figures that stand below no mark."""
    return [x for x in TABLE.findall(script.MARK.sub("", text)) if has_figures(x)]


def test_the_tables_are_those_of_the_files():
    for name, text in PAGES.items():
        assert script.render(text, TABLES) == text, f"{name}: run python benchmarks/render_pages.py"


def test_every_table_with_figures_is_made_from_a_file():
    by_hand = {name for name, text in PAGES.items() if unmarked(text)}
    assert by_hand == set(BY_OTHER_TESTS) | set(MEASURE_NOTHING)


TABLE_OF_SETS = {"columns": ["set", "share"], "rows": [["a", "1"], ["b", "2"]], "command": "run",
                 "revision": "12345678", "date": "2026-11-27"}  # fmt: skip


def test_a_figure_that_no_file_gives_is_found():
    page = "# Page\n\n| set | share |\n|---|--:|\n| a | 1 |\n\nText.\n"
    assert len(unmarked(page)) == 1
    tables = {("page", "sets"): TABLE_OF_SETS}
    marked = script.render("# Page\n\n<!--page.sets-->\n\nText.\n", tables)
    assert unmarked(marked) == [] and script.render(marked, tables) == marked
    assert script.render(marked.replace("| b | 2 |", "| b | 3 |"), tables) == marked
    with pytest.raises(KeyError):
        script.render("<!--page.others-->\n", tables)


def test_every_table_has_one_place_and_its_source():
    marks = [mark for text in PAGES.values() for mark in script.MARK.findall(text)]
    assert sorted(marks) == sorted(TABLES)
    for table in TABLES.values():
        assert FIELDS <= set(table) <= FIELDS | {"at"}
        assert {len(cells) for cells in table["rows"]} == {len(table["columns"])}
        assert re.fullmatch(r"2026-\d\d-\d\d", table["date"])
        assert re.fullmatch(r"[0-9a-f]{8}|the revision of each row", table["revision"])
