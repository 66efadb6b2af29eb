from holdfast_lab.report.html_report import ReportFigure
from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.study.paper.published import discrepancies
from holdfast_lab.study.sections import OUTLINES, TWIN_NOTE, PartOutput, report_sections


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
