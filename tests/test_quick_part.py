"""What `pytest -m quick` selects, which is what one runs after each edit."""

import subprocess
import sys
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


def selected(*paths):
    """The number of tests of each file that `-m quick` selects."""
    command = [sys.executable, "-m", "pytest", "-m", "quick", "--collect-only", "-qq", "-n", "0"]
    listed = subprocess.run(
        [*command, "-p", "no:cacheprovider", *paths],
        cwd=ROOT, capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    lines = (line.rpartition(": ") for line in listed.splitlines() if ": " in line)
    return {file: int(number) for file, _, number in lines}


@pytest.fixture(scope="module")
def quick(collected):
    """The number of quick tests of each file; another collection takes as long as many tests."""
    folders = ("tests", "lab/tests", "packages")
    n_files = sum(1 for tests in folders for _ in (ROOT / tests).rglob("test_*.py"))
    if len({file for file, _ in collected if "tests/" in file}) > 0.9 * n_files:
        return dict(Counter(file for file, is_quick in collected if is_quick))
    return selected()


def test_slow_files_are_not_even_imported(collected):
    """What is selected of some files, slow ones among them, is what has the mark."""
    names = ["test_quick_part.py", "test_children.py", "test_csv_cells.py", "attack"]
    paths = [f"tests/{name}" for name in names]
    code = selected(*paths)
    assert list(code) == ["tests/test_csv_cells.py"]
    marked = sum(is_quick for file, is_quick in collected if file in code)
    assert marked in (0, code["tests/test_csv_cells.py"])  # 0: not collected in this run


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
    assert not {"tests/test_quick_part.py", "tests/test_children.py"} & set(quick)
    assert not any(file.startswith(("tests/attack", "tests/live/web/page")) for file in quick)
