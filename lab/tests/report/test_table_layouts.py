import math

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.table_layouts import to_markdown


def row(classifier, on, figure, *values):
    return Row({"classifier": classifier, "on": on, "figure": figure}, *values)


def confusion():
    rows = [
        row("LogReg", "fresh & new", "Acc [%]", 94.25, 95.3, 60, (92.0, 96.04)),
        row("LogReg", "fresh & new", "delay [s]", math.inf, None, 60, (0.2, math.inf)),
        row("LogReg", "held out", "Acc [%]", 95.3, 95.3, 60),
        row("SVM", "held out", "delay [s]", 0.0123, None, 60, (-0.01, 0.02)),
    ]
    return ResultTable(
        "confusion", "Table I & more", "Of <all> N_w = 14.", rows, ("classifier", "on"),
        digits_of={"delay [s]": 3},
    )  # fmt: skip


def test_markdown_by_hand():
    assert to_markdown(confusion()) == (
        "**Table I \\& more**\n\n"
        "| classifier | on | Acc [%] | delay [s] |\n"
        "| --- | --- | --: | --: |\n"
        "| LogReg | fresh \\& new | 94.2<br><sub>92.0–96.0</sub><br>*paper 95.3 (−1.1)* "
        "| infinite<br><sub>0.200–∞</sub> |\n"
        "| LogReg | held out | 95.3<br>*paper 95.3 (0.0)* | – |\n"
        "| SVM | held out | – | 0.012<br><sub>−0.010 to 0.020</sub> |\n\n"
        "Of \\<all\\> N\\_w = 14. On 60 recordings. Small print: 95 % interval, by bootstrap over "
        "recordings. Paper: the value in the paper, and our value minus it.\n"
    )


def test_the_number_of_recordings_has_a_column_if_it_varies():
    rows = [
        Row({"m": "a", "figure": "x"}, 1.0, n=60),
        Row({"m": "b", "figure": "x"}, 1.0, n=48),
        Row({"m": "b", "figure": "y"}, 1.0, n=12),
        Row({"m": "c", "figure": "y"}, 1.0),
    ]
    made = ResultTable("t", "T", "", rows, ("m",))
    assert "| b | 1.0 | 1.0 | 12–48 |" in to_markdown(made).splitlines()
