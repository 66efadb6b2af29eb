"""Values printed in the paper [%], and statements of the paper that contradict each other."""

import csv
from pathlib import Path

from holdfast_lab.report.result_tables import Key, ResultTable, Row

WINDOWS = (4, 6, 8, 10, 12, 14, 16, 18)
RATES = ("FPR", "FNR", "FDR", "accuracy")
"""The columns of Tables II and III."""

PublishedValues = dict[str, float]
Subset = tuple[str, ...]

CONFUSION: dict[str, PublishedValues] = {
    "logreg": {"TNR": 95.1, "FPR": 4.9, "FNR": 4.5, "TPR": 95.5, "accuracy": 95.3},
    "svm": {"TNR": 96.2, "FPR": 3.8, "FNR": 3.5, "TPR": 96.5, "accuracy": 96.4},
}
"""Table I; the accuracy "in the training phase" is from the text."""

_WINDOW = {
    "FPR": (8.6, 7.2, 6.4, 5.8, 5.5, 5.2, 5.0, 4.9),
    "FNR": (5.3, 5.4, 5.3, 5.0, 4.8, 4.7, 4.5, 4.5),
    "FDR": (8.6, 7.3, 6.5, 6.0, 5.6, 5.4, 5.1, 5.1),
    "accuracy": (93.0, 93.7, 94.2, 94.6, 94.9, 95.0, 95.2, 95.3),
}
PUBLISHED_WINDOW: dict[int, PublishedValues] = {
    n: {rate: values[index] for rate, values in _WINDOW.items()} for index, n in enumerate(WINDOWS)
}
"""Table II, by N_w."""

_ABLATION: tuple[tuple[Subset, tuple[float, ...]], ...] = (
    (("F_a", "F_tip", "m", "sigma"), (4.9, 4.5, 5.1, 95.3)),
    (("F_tip", "m", "sigma"), (4.9, 4.6, 5.0, 95.3)),
    (("F_a", "m", "sigma"), (7.0, 6.7, 7.2, 93.1)),
    (("F_a", "F_tip", "sigma"), (4.9, 4.6, 5.0, 95.3)),
    (("F_a", "F_tip", "m"), (20.5, 16.9, 20.3, 81.3)),
    (("m", "sigma"), (7.1, 6.7, 7.3, 93.1)),
    (("F_a", "sigma"), (7.0, 6.7, 7.2, 93.2)),
    (("F_a", "F_tip"), (20.9, 16.8, 20.5, 81.1)),
    (("F_tip", "sigma"), (5.2, 4.7, 5.4, 95.0)),
    (("F_tip", "m"), (20.3, 16.8, 20.2, 81.4)),
    (("F_a", "m"), (26.1, 32.9, 28.6, 70.6)),
)
ABLATION: dict[Subset, PublishedValues] = {
    subset: dict(zip(RATES, figures, strict=True)) for subset, figures in _ABLATION
}
"""Table III, by features, in the paper's order."""

UNSEEN: dict[str, float] = {"logreg": 95.64, "svm": 96.2}
"""Accuracy on "previously unseen data"."""

FIRST_FINGER: PublishedValues = {"accuracy": 95.3, "FDR": 5.1}
"""LogReg on the finger that the paper does not name, from the discussion."""
OTHER_FINGERS: dict[str, PublishedValues] = {
    "middle": {"accuracy": 95.8, "FDR": 12.6},
    "thumb": {"accuracy": 95.7, "FDR": 3.5},
}

PUBLISHED_ZHANG: PublishedValues = {"accuracy": 62.7, "FDR": 49.1}
""""Not more than" and "up to"; the paper gives no window."""


STATEMENTS = Path(__file__).with_name("discrepancies.csv")
"""Statements of the paper: subject, position in it, contents in short, value if there is one.
Those on the same subject contradict each other."""


def discrepancies() -> ResultTable:
    """Return the table of statements that contradict each other or leave a question open."""
    rows = []
    with STATEMENTS.open(encoding="utf-8", newline="") as file:
        for statement in csv.DictReader(file):
            printed = statement.pop("printed")
            keys: dict[str, Key] = {**statement, "figure": "printed"}
            rows.append(Row(keys, None, float(printed) if printed else None))
    return ResultTable(
        name="discrepancies",
        title="Where the paper disagrees with itself, or leaves open what a repetition needs",
        note=(
            "Lines with the same subject contradict each other or leave a question open. In this "
            "study, Table II is computed with all six features and with the deployed five, and "
            "Table III for N_w = 14 and 18. As printed, m and sigma are divided by N_w; the window "
            "has N_w samples."
        ),
        rows=rows,
        lines=("about", "where", "says"),
        digits=2,
    )
