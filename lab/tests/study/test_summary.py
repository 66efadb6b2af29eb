from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.study.summary import EVENTS, STRONGEST, summary_text


def table_of(name, rows):
    return ResultTable(name, name, "", rows, tuple(rows[0].keys)[:-1])


def row(ours, paper=None, n=None, **keys):
    return Row(keys, ours, paper, n)


CONFUSION = table_of(
    "confusion",
    [
        row(94.84, 95.3, 24, classifier="LogReg", on="held out", figure="accuracy"),
        row(5.1, 4.7, 24, classifier="LogReg", on="held out", figure="FPR"),
        row(95.56, 96.4, 24, classifier="SVM", on="held out", figure="accuracy"),
        row(92.9, 95.3, 14, classifier="LogReg", on="other objects", figure="accuracy"),
        row(None, None, 14, classifier="SVM", on="other objects", figure="accuracy"),
    ],
)


def test_accuracies():
    assert summary_text([CONFUSION]).splitlines() == [
        "- The paper's protocol (samples split at random): LogReg 94.8 % correct (paper: 95.3 %), "
        "SVM 95.6 % correct (paper: 96.4 %); 24 recordings.",
        "- The same classifiers on objects that were not in training: LogReg 92.9 % correct; "
        "14 recordings.",
    ]


def test_the_strongest_baseline():
    keys = {**STRONGEST, "baseline": "trees"}
    rows = [
        Row({**keys, "figure": "holdfast [%]"}, 2.0, n=14),
        Row({**keys, "figure": "baseline [%]"}, 4.0, n=14),
    ]
    assert summary_text([table_of("strongest", rows)]) == (
        "- On unseen objects our own method has 2.0 % errors by samples of hands, the strongest "
        "rival (trees) 4.0 %; 14 recordings."
    )


def test_events():
    keys = {**EVENTS, "method": "holdfast"}
    rows = [
        Row({**keys, "figure": "missed at 100 ms [%]"}, 3.04),
        Row({**keys, "figure": "false alarms per minute"}, 1.5),
    ]
    assert summary_text([table_of("events", rows)]) == (
        "- Events on unseen objects that are missed within 0.1 s: holdfast 3.0 % "
        "(with 1.5 false alarms per minute), at thresholds for 1 in training."
    )


def test_without_these_tables_there_is_no_summary():
    assert summary_text([]) == ""
    assert summary_text([table_of("other", [row(1.0, m="a", figure="x")])]) == ""
