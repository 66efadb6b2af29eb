from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.study.paper.published import discrepancies
from holdfast_lab.study.sections import PartOutput, report_sections


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
    found = report_sections(made, ["a", "b"], ["c"], twin=False)
    assert titles(found) == [
        ("What was run", []),
        ("The paper's tables", ["confusion", "more"]),
        ("Where the paper disagrees with itself", ["discrepancies"]),
        ("Results on new data", ["unseen"]),
        ("Real recordings", ["hand"]),
        ("Methods", []),
    ]
    assert found[0].text == "- a\n- b"
    assert [picture.name for picture in found[-2].figures] == ["forces"]
