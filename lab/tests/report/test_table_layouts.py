import math

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.table_layouts import notes, to_markdown


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


def test_columns_have_a_common_head():
    rows = [Row({"figure": "Acc", "N_w": n}, 95.0) for n in (4, 6)]
    made = ResultTable("window", "By window", "", rows, ("figure",), column="N_w")
    assert "| figure | N\\_w 4 | N\\_w 6 |" in to_markdown(made)
    assert notes(made) == []


def test_the_number_of_recordings_has_a_column_if_it_varies():
    rows = [
        Row({"m": "a", "figure": "x"}, 1.0, n=60),
        Row({"m": "b", "figure": "x"}, 1.0, n=48),
        Row({"m": "b", "figure": "y"}, 1.0, n=12),
        Row({"m": "c", "figure": "y"}, 1.0),
    ]
    made = ResultTable("t", "T", "", rows, ("m",))
    assert "| b | 1.0 | 1.0 | 12–48 |" in to_markdown(made).splitlines()


def test_an_interval_with_one_end():
    rows = [Row({"m": "a", "figure": "x"}, 1.0, interval=(0.5, None)),
            Row({"m": "a", "figure": "y"}, 1.0, interval=(None, 2.0))]  # fmt: skip
    text = to_markdown(ResultTable("t", "T", "", rows, ("m",)))
    assert "<sub>from 0.5</sub>" in text and "<sub>to 2.0</sub>" in text


def test_a_value_of_the_paper_alone_has_no_difference():
    rows = [Row({"where": "Table II", "figure": "printed"}, None, 95.3)]
    alone = ResultTable("said", "What is said", "", rows, ("where",))
    assert "| Table II | *paper 95.3* |" in to_markdown(alone)
