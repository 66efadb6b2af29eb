import csv
from io import StringIO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.csv_cells import cell_text, csv_text, text_cell

TEXTS = st.text() | st.from_regex(r"'{0,2}[-=+@\t\r]?.*")


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "'=1+1"])
def test_no_text_is_a_formula(text):
    assert text_cell(text) == f"'{text}"


@given(TEXTS)
def test_a_text_comes_back(text):
    assert cell_text(text_cell(text)) == text
    assert not text_cell(text).startswith(("=", "+", "-", "@", "\t", "\r"))


@given(st.lists(st.lists(TEXTS, min_size=2, max_size=2)))
def test_a_table_comes_back(rows):
    read = list(csv.reader(StringIO(csv_text(rows), newline="")))
    assert [list(map(cell_text, row)) for row in read] == rows


def test_numbers_remain_numbers():
    assert csv_text([(-0.5, 3, float("-inf"), "")]) == "-0.5,3,-inf,\n"
