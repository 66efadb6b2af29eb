from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.report.terminal import PRINTED_COLUMNS, print_main_table


def test_the_table_of_real_recordings_fits_a_terminal(capsys):
    from holdfast_lab.study.comparison.real_counts import CALLED_STABLE, MEAN_AUC, MISSED_SLIPS

    assert {MEAN_AUC, CALLED_STABLE} == set(PRINTED_COLUMNS["real"])
    keys = {"method": "FFT band energy (Fernandez 2014)", "trained on": "the others"}
    rows = [
        Row({**keys, "figure": figure}, 0.5) for figure in (MEAN_AUC, CALLED_STABLE, MISSED_SLIPS)
    ]
    table = ResultTable("real", "Real", "", rows, ("method", "trained on"), digits_of={MEAN_AUC: 2})
    print_main_table(table)
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[-2:] for line in printed[2:3]] == [["0.50", "0.5"]]
    assert max(map(len, printed)) <= 80


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
