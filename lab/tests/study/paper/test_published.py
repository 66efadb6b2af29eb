"""The paper's figures, read from its source by hand once more, row by row as printed."""

import pytest

from holdfast_lab.study.paper.published import (
    ABLATION,
    CONFUSION,
    PUBLISHED_WINDOW,
    discrepancies,
)

TABLE_II = """
N_w 4 6 8 10 12 14 16 18
FPR 8,6 7,2 6,4 5,8 5,5 5,2 5,0 4,9
FNR 5,3 5,4 5,3 5,0 4,8 4,7 4,5 4,5
FDR 8,6 7,3 6,5 6,0 5,6 5,4 5,1 5,1
accuracy 93,0 93,7 94,2 94,6 94,9 95,0 95,2 95,3
"""

TABLE_III = """
C C C C 4.9 4.5 5.1 95.3
X C C C 4,9 4,6 5,0 95,3
C X C C 7,0 6,7 7,2 93,1
C C X C 4,9 4,6 5,0 95,3
C C C X 20,5 16,9 20,3 81,3
X X C C 7,1 6,7 7,3 93,1
C X X C 7,0 6,7 7,2 93,2
C C X X 20,9 16,8 20,5 81,1
X C X C 5,2 4,7 5,4 95,0
X C C X 20,3 16,8 20,2 81,4
C X C X 26,1 32,9 28,6 70,6
"""


def number(text):
    return float(text.replace(",", "."))


def test_table_two_has_the_32_values_of_the_paper():
    head, *lines = [line.split() for line in TABLE_II.split("\n") if line]
    expected = {
        int(window): {line[0]: number(line[1 + column]) for line in lines}
        for column, window in enumerate(head[1:])
    }
    assert expected == PUBLISHED_WINDOW
    assert sum(len(figures) for figures in PUBLISHED_WINDOW.values()) == 32


def test_table_three_has_the_44_values_of_the_paper_in_its_order():
    rows = [line.split() for line in TABLE_III.split("\n") if line]
    names = ("F_a", "F_tip", "m", "sigma")
    expected = [
        (
            tuple(n for n, mark in zip(names, row, strict=False) if mark == "C"),
            dict(zip(("FPR", "FNR", "FDR", "accuracy"), map(number, row[4:]), strict=True)),
        )
        for row in rows
    ]
    assert list(ABLATION.items()) == expected
    assert sum(len(figures) for figures in ABLATION.values()) == 44


@pytest.mark.parametrize("printed", [*PUBLISHED_WINDOW.values(), *ABLATION.values()])
def test_each_row_of_the_paper_is_consistent(printed):
    """FPR, FNR and FDR fix the share of class 1, and with it the accuracy."""
    fpr, fnr, fdr, accuracy = (printed[k] / 100 for k in ("FPR", "FNR", "FDR", "accuracy"))
    odds = fdr / (1 - fdr) * (1 - fnr) / fpr
    share = 1 / (1 + odds)
    assert share == pytest.approx(0.49, abs=0.01)
    assert 1 - share * fnr - (1 - share) * fpr == pytest.approx(accuracy, abs=0.001)


def said(about):
    """Values that the statements about something have, by what they say."""
    rows = [row for row in discrepancies().rows if row.keys["about"] == about]
    return {row.keys["says"]: row.paper for row in rows}


def test_the_discrepancies_that_follow_from_the_tables():
    assert PUBLISHED_WINDOW[14] == ABLATION["F_tip", "sigma"]
    assert PUBLISHED_WINDOW[18] == ABLATION["F_a", "F_tip", "m", "sigma"]
    assert CONFUSION["logreg"]["FPR"] == PUBLISHED_WINDOW[18]["FPR"] != PUBLISHED_WINDOW[14]["FPR"]
    assert CONFUSION["logreg"]["FNR"] == PUBLISHED_WINDOW[18]["FNR"] != PUBLISHED_WINDOW[14]["FNR"]
    assert ABLATION["F_tip", "m", "sigma"] == ABLATION["F_a", "F_tip", "sigma"]
    gained = said("beyond N_w = 14")
    accuracy = {n: figures["accuracy"] for n, figures in PUBLISHED_WINDOW.items()}
    assert gained["accuracy gained from 14 to 18"] == pytest.approx(accuracy[18] - accuracy[14])
    assert gained["accuracy gained from 10 to 14"] == pytest.approx(accuracy[14] - accuracy[10])


def test_the_shares_of_stable_data_that_the_values_imply():
    index, middle, _ = said("the classes").values()
    odds = 5.4 / 94.6 * 95.3 / 5.2
    assert index == pytest.approx(100 / (1 + odds), abs=0.05)
    # calling c of all data stable: FP = 0.126 c, at most all of the 4.2 % that are wrong
    called = 0.042 / 0.126
    assert middle == pytest.approx(100 * called * (1 - 0.126), abs=0.05)
