"""Each table of results has the trivial baseline, and its program is here or at a named commit."""

import re
import subprocess

import pytest

from . import blocks

PAGES = ("real-data.md", "study.md", *(
    f"study/{name}.md" for name in ("built-in-models", "labels-by-rules", "live",
                                    "real-data", "slips", "twin")
))  # fmt: skip
TABLE = re.compile(r"(?:^\|.*\n)+", re.M)
RESULT = re.compile(r"\bAUC\b|missed|within 100 ms|called STABLE|found within|\btrained on\b")
TRIVIAL = re.compile(r"always stable|never a slip|always a disturbance")
PROGRAM = re.compile(
    r"((?:benchmarks|lab/holdfast_lab)/[\w/]+\.(?:py|sh|awk))(?:[^`\n]*(?:`| #) at commit (\w+))?"
)


def test_a_program_that_a_page_names_is_here_or_was_at_the_commit_it_names():
    texts = [page.read_text("utf-8") for page in (blocks.ROOT / "docs").rglob("*.md*")]
    named = {tuple(found) for text in texts for found in PROGRAM.findall(text)}
    gone = {(path, commit) for path, commit in named if not (blocks.ROOT / path).is_file()}
    assert len(named) > len(gone) > 10
    assert [path for path, commit in gone if not commit] == []
    for path, commit in gone:
        git = ["git", "-C", str(blocks.ROOT), "cat-file", "-e"]
        if subprocess.run([*git, commit], capture_output=True, check=False).returncode == 0:
            subprocess.run([*git, f"{commit}:{path}"], check=True)  # else the clone has no history


@pytest.mark.parametrize("page", PAGES)
def test_a_table_of_results_has_the_trivial_baseline(page):
    text = (blocks.ROOT / "docs" / page).read_text("utf-8")
    results = [table for table in TABLE.findall(text) if RESULT.search(table)]
    assert results
    for table in results:
        assert TRIVIAL.search(table), table.partition("\n")[0]
