"""What `pytest -m quick` selects, which is what one runs after each edit."""

from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = [
    f"{tests}/{path.parent.name}/"
    for package, tests in (("src/holdfast", "tests"), ("lab/holdfast_lab", "lab/tests"))
    for path in sorted((ROOT / package).glob("*/__init__.py"))
]
ELSEWHERE = {"tests/recorded/": "tests/cli/"}
"""Folders of tests with another name than that of their package."""


@pytest.fixture(scope="module")
def quick(collected):
    """The number of quick tests of each file, in a run of the whole suite."""
    folders = ("tests", "lab/tests", "packages")
    n_files = sum(1 for tests in folders for _ in (ROOT / tests).rglob("test_*.py"))
    if len({file for file, _ in collected if "tests/" in file}) < 0.9 * n_files:
        pytest.skip("only a run of the whole suite collects all files")
    return Counter(file for file, is_quick in collected if is_quick)


def test_there_are_a_thousand_of_all_rooms(quick):
    assert sum(quick.values()) >= 1000
    assert {"tests/detector/", "lab/tests/trial/"} <= set(ROOMS)
    assert [
        room
        for room in ROOMS
        if not any(file.startswith(ELSEWHERE.get(room, room)) for file in quick)
    ] == []


def test_none_starts_a_process_or_needs_a_browser(quick):
    assert quick["tests/test_csv_cells.py"] > 0
    assert "tests/test_children.py" not in quick
    assert not any(file.startswith("tests/live/web/page") for file in quick)
