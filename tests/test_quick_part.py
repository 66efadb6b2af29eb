"""What `pytest -m quick` selects, which is what one runs after each edit."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = [
    f"{tests}/{path.parent.name}/"
    for package, tests in (("src/holdfast", "tests"), ("lab/holdfast_lab", "lab/tests"))
    for path in sorted((ROOT / package).glob("*/__init__.py"))
]


@pytest.fixture(scope="module")
def quick():
    """The number of quick tests of each file."""
    command = [sys.executable, "-m", "pytest", "-m", "quick", "--collect-only", "-qq", "-n", "0"]
    listed = subprocess.run(
        [*command, "-p", "no:cacheprovider"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    lines = (line.rpartition(": ") for line in listed.splitlines() if ": " in line)
    return {file: int(number) for file, _, number in lines}


def test_there_are_a_thousand_of_all_rooms(quick):
    assert sum(quick.values()) >= 1000
    assert {"tests/detector/", "lab/tests/trial/"} <= set(ROOMS)
    assert [room for room in ROOMS if not any(file.startswith(room) for file in quick)] == []


def test_none_starts_a_process_or_needs_a_browser(quick):
    assert quick["tests/test_csv_cells.py"] > 0
    assert not {"tests/test_quick_part.py", "tests/test_children.py"} & set(quick)
    assert not any(file.startswith(("tests/attack", "tests/live/web/page")) for file in quick)
