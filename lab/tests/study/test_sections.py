from holdfast_lab.report.html_report import ReportFigure

from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.study.paper.published import discrepancies
from holdfast_lab.study.sections import (
    EVENTS,
    OUTLINES,
    STRONGEST,
    TWIN_NOTE,
    PartOutput,
    report_sections,
    summary_text,
)


def table(name, n=3):
    return ResultTable(name, name, "Note.", [Row({"m": "a", "figure": "x"}, 1.0, n=n)], ("m",))


def titles(sections):
    return [(section.title, [table.name for table in section.tables]) for section in sections]


def test_tables_are_where_they_are_named_or_with_their_part():
    made = {
        "paper": PartOutput(
            [table("unseen"), table("more"), table("confusion"), discrepancies()], []
        ),
        "real": PartOutput([table("hand")], [ReportFigure("forces", "", None)]),
    }
    found = report_sections(made, ["a", "b"], twin=False)
    assert titles(found) == [
        ("What was run", []),
        ("The paper's tables", ["confusion", "more"]),
        ("Where the paper disagrees with itself", ["discrepancies"]),
        ("Results on new data", ["unseen"]),
        ("Real recordings", ["hand"]),
    ]
    assert found[0].text == "- a\n- b"
    assert [picture.name for picture in found[-1].figures] == ["forces"]


def test_the_summary_comes_first():
    rows = [Row({"classifier": "LogReg", "on": "held out", "figure": "accuracy"}, 94.8, 95.3)]
    confusion = ResultTable("confusion", "c", "", rows, ("classifier", "on"))
    first, second, *_ = report_sections({"paper": PartOutput([confusion], [])}, ["a"], twin=False)
    assert first.title == "Summary"
    assert "LogReg 94.8 % correct (paper: 95.3 %)" in first.text
    assert second.title == "What was run"


def test_tables_of_the_twin_have_a_note():
    made = {
        "paper": PartOutput([table("confusion"), table("cost", None), discrepancies()], []),
        "real": PartOutput([table("hand")], []),
    }
    found = report_sections(made, [], twin=True)
    notes = {table.name: table.note for section in found for table in section.tables}
    assert notes["confusion"] == f"Note. {TWIN_NOTE}"
    assert notes["hand"] == notes["cost"] == "Note."
    assert TWIN_NOTE not in notes["discrepancies"]
    assert found[-1].title == "What the twin cannot show"
    lines = found[-1].text.split("\n\n")[1].splitlines()
    assert len(lines) > 3 and all(line.startswith("- ") for line in lines)


def test_every_section_has_a_text_on_how_to_read_it():
    assert all(len(outline.text.split()) > 20 for outline in OUTLINES)
    named = [name for outline in OUTLINES for name in outline.names]
    assert len(named) == len(set(named))


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
