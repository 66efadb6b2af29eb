"""Inputs of labs: the first command and the proposal give the right values (`tests/cases.py`)."""

import pytest

from cases import CASES, TABLE, outcome, run_here

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("case", TABLE, ids=[case.id for case in TABLE])
def test_a_case_gives_its_values(tmp_path, case):
    if not CASES.is_dir():
        pytest.skip("no inputs here: set HOLDFAST_CASES to the folder of their scripts")
    printed, wrong = outcome(case, tmp_path, run_here)
    assert wrong == [], "\n".join(printed)
    if case.first == "proposes":
        lines = printed[0].splitlines()
        assert len(lines) <= 40
        assert max(map(len, lines)) <= 100
