import csv
import io
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.csv_cells import cell_text
from holdfast_lab.report.result_tables import (
    ResultTable,
    Row,
    number_text,
    pivot,
    to_csv,
    to_json,
)


def row(ours, paper=None, figure="Acc", **options):
    keys = {"classifier": options.pop("classifier", "LogReg"), "figure": figure}
    return Row(keys, ours, paper, **options)


def table(*rows, **options):
    return ResultTable("some", "Some table", "", list(rows), ("classifier",), **options)


def test_lines_and_columns_are_in_the_order_of_first_appearance():
    grid = pivot(
        table(
            row(1, figure="z"), row(2, classifier="A"), row(3), row(4, figure="z", classifier="A")
        )
    )
    assert grid.columns == ("z", "Acc")
    assert [line.heads for line in grid.lines] == [("LogReg",), ("A",)]
    assert [[cell.ours for cell in line.cells] for line in grid.lines] == [[1, 3], [4, 2]]


def test_a_cell_without_a_row_is_none():
    grid = pivot(table(row(1), row(2, figure="FDR", classifier="SVM")))
    assert grid.lines[0].cells[1] is None and grid.lines[1].cells[0] is None


@pytest.mark.parametrize(
    ("ours", "paper", "expected"),
    [
        (95.0, 95.3, -0.3),
        (None, 95.3, None),
        (95.0, None, None),
        (math.inf, 0.1, None),
        (math.nan, 0.1, None),
    ],
)
def test_difference_is_ours_minus_the_papers(ours, paper, expected):
    assert row(ours, paper).difference == expected


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "–"), (math.nan, "–"), (math.inf, "infinite"), (-math.inf, "−infinite"),
     (-1.25, "−1.2"), (0.04, "0.0"), (-0.04, "0.0"), (1234.56, "1234.6")],
)  # fmt: skip
def test_numbers_as_text(value, text):
    assert number_text(value, 1) == text


keys = st.text(st.characters(exclude_categories=["C"]), min_size=1, max_size=8)
numbers = st.none() | st.floats(allow_nan=False)


@given(st.lists(st.tuples(keys, numbers, numbers), unique_by=lambda each: each[0], min_size=1))
def test_csv_holds_every_value_to_the_last_digit(given_rows):
    made = table(*(row(ours, paper, classifier=name) for name, ours, paper in given_rows))
    header, *lines = csv.reader(io.StringIO(to_csv(made), newline=""))
    assert header == ["classifier", "figure", "ours", "paper", "difference", "n", "low", "high"]
    read = [
        (cell_text(name), *(float(x) if x else None for x in (ours, paper)))
        for name, _, ours, paper, *_ in lines
    ]
    assert read == given_rows


def test_json_is_strict_and_marks_infinite_values():
    made = table(row(math.inf, n=3, interval=(0.1, math.inf)), row(math.nan, figure="FDR"))
    document = json.loads(json.dumps(to_json(made), allow_nan=False))
    assert document == [
        {"classifier": "LogReg", "figure": "Acc", "ours": None, "paper": None, "difference": None,
         "n": 3, "interval": [0.1, None], "infinite": True},
        {"classifier": "LogReg", "figure": "FDR", "ours": None, "paper": None, "difference": None,
         "n": None, "interval": None},
    ]  # fmt: skip


@pytest.mark.parametrize(
    "build",
    [
        lambda: ResultTable("a/b", "", "", [], ("x",)),
        lambda: ResultTable("a", "", "", [], ()),
        lambda: table(Row({"paper": "x", "figure": "y"}, 1.0)),
        lambda: table(Row({"classifier": "x"}, 1.0)),
        lambda: table(row(1), row(2)),
    ],
)
def test_an_inconsistent_table_is_rejected(build):
    with pytest.raises(ValueError, match="table"):
        build()


def test_a_table_without_a_paper_has_values_only():
    rows = [Row({"law": "a", "figure": "x"}, math.inf, n=4, interval=(1.0, math.inf))]
    table = ResultTable("t", "T", "", rows, ("law",), counted="trials", has_paper=False)
    assert to_csv(table) == "law,figure,value,n,low,high\na,x,inf,4,1.0,inf\n"
    assert to_json(table) == [
        {"law": "a", "figure": "x", "value": None, "n": 4, "interval": [1.0, None],
         "infinite": True}
    ]  # fmt: skip
