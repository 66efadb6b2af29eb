"""The paper's figures, read from its source by hand once more, row by row as printed."""

import pytest

from holdfast_lab.study.paper.published import (
    ABLATION,
    CONFUSION,
    PUBLISHED_WINDOW,
    discrepancies,
)


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
