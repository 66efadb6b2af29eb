from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.terminal import print_main_table


def test_only_one_split_and_few_columns_are_printed(capsys):
    """The first split with the most methods is printed, with few columns."""
    rows = [
        Row({"on": on, "method": method, "figure": figure}, 1.0, 0.5 if method == "a" else None)
        for on, methods in (("by object", "a"), ("by recording", "ab"), ("fresh", "ab"))
        for method in methods
        for figure in ("AUC", "accuracy [%]", "Brier")
    ]
    rows.append(Row({"on": "by recording", "method": "c", "figure": "AUC"}, None))
    rows += [
        Row({"on": "by recording", "method": "d", "threshold": "for 1/min", "figure": "AUC"}, 1.0)
    ]
    table = ResultTable("methods", "Methods", "", rows, ("on", "method"), digits_of={"AUC": 3})
    print_main_table(table)
    assert capsys.readouterr().out.splitlines() == [
        "Methods (in parentheses: the paper)",
        "on            method  AUC            accuracy [%]",
        "by recording  a       1.000 (0.500)  1.0 (0.5)",
        "by recording  b       1.000          1.0",
        "by recording  c       –              -",
        "",
    ]
