"""Values printed in the paper [%], and statements of the paper that contradict each other."""

from typing import NamedTuple

from holdfast_lab.report.result_tables import ResultTable, Row

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


class Statement(NamedTuple):
    """A statement of the paper.

    Attributes:
        about: subject; statements on the same subject contradict each other.
        where: place in the paper.
        says: contents, in short.
        value: in the statement, if there is one.
    """

    about: str
    where: str
    says: str
    value: float | None = None


def _statements(
    about: str, *parts: tuple[str, str] | tuple[str, str, float]
) -> tuple[Statement, ...]:
    return tuple(Statement(about, *part) for part in parts)


STATEMENTS: tuple[Statement, ...] = (
    *_statements(
        "accuracy of LogReg",
        ("Results, first paragraph", "in the training phase", 95.3),
        ("Table II", "N_w = 14, the window of 'the rest of this work'", 95.0),
        ("Results, after Table III", "on unseen data", 95.64),
        ("Discussion, James et al.", "said of the training phase", 95.6),
        ("Discussion, Grover et al.", "in the training", 95.2),
        ("Discussion, Grover et al.", "in the online testing", 95.6),
    ),
    *_statements(
        "accuracy of SVM",
        ("Results, first paragraph", "in the training phase", 96.4),
        ("Discussion, James et al.", "said of the training phase", 96.0),
        ("Results, after Table III", "on unseen data", 96.2),
    ),
    *_statements(
        "window of Tables I and III",
        ("Results, before Table II", "N_w = 14 'for the rest of this work'; so also III"),
        ("Table II", "N_w = 14: FPR 5.2, FNR 4.7, FDR 5.4, accuracy", 95.0),
        ("Table III", "F_tip and sigma, without F_a and m: the same four figures", 95.0),
        ("Table II", "N_w = 18: FPR 4.9, FNR 4.5, FDR 5.1, accuracy", 95.3),
        ("Table III", "all features: the same four figures as N_w = 18", 95.3),
        ("Table I", "LogReg: FPR 4.9 and FNR 4.5, those of N_w = 18, not of 14"),
    ),
    *_statements(
        "features of the deployed model",
        ("Results, after Table II", "m is left out 'for the rest of this work'"),
        ("Discussion, Zhang et al.", "'our method' with the FDR of all features, m included", 5.1),
        ("Table III", "FDR without m", 5.0),
    ),
    *_statements(
        "what contributes most",
        ("Results, before Table III", "'sigma and F_a were the most significant'"),
        ("Table III", "accuracy without F_a: as with all features", 95.3),
        ("Table III", "accuracy without F_tip: the larger loss", 93.1),
    ),
    *_statements(
        "F_a or m",
        ("Results, before Table III", "'slightly better using F_a instead of m'"),
        ("Table III", "F_a, F_tip, sigma: equal in all four figures to F_tip, m, sigma", 95.3),
        ("Table III", "accuracy of F_a and sigma; 93.1 with m and sigma", 93.2),
        ("Table III", "accuracy of F_a and F_tip; 81.4 with F_tip and m", 81.1),
    ),
    *_statements(
        "beyond N_w = 14",
        ("Results, before Table II", "'relatively unchanged'"),
        ("Table II", "accuracy gained from 14 to 18", 0.3),
        ("Table II", "accuracy gained from 10 to 14", 0.4),
    ),
    *_statements(
        "the decision boundary",
        ("Results, first paragraph", "'a linear kernel SVM and a Logistic Regression'"),
        ("Discussion, Zhang et al.", "'finding a nonlinear decision boundary'"),
    ),
    *_statements(
        "m and sigma",
        ("Equations 1 and 2", "sums over the coefficients are divided by N_w"),
        ("Feature extraction", "a window of N_w samples has N_w / 2 Haar coefficients"),
        ("Feature extraction, A(k) and D(k)", "m = k - N_w ... k: N_w + 1 terms for N_w samples"),
        ("Feature extraction, A(k) and D(k)", "coefficients do not depend on the sum's index m"),
        ("Feature extraction", "'n is the time translation'; no equation has an n"),
    ),
    *_statements(
        "the finger",
        ("Data collection", "250,000 data 'for one fingertip', which one is not said"),
        ("Results", "'trained for the rest of the finger': middle and thumb; no fourth finger"),
    ),
    *_statements(
        "the classes",
        ("Table II", "share of stable data that FPR, FNR, FDR at N_w = 14 imply", 48.9),
        ("Results, middle finger", "the most that accuracy 95.8 and FDR 12.6 allow", 29.1),
        ("Discussion, Zhang et al.", "FDR 'up to': about that of calling everything stable", 49.1),
    ),
    *_statements(
        "unseen data",
        ("Data collection", "80 % of the data train, 20 % test; how they are drawn is not said"),
        ("Results, after Table III", "'previously unseen data': the 20 % or new recordings?"),
        ("Figure of the objects", "the same six objects are 'for training and testing'"),
        ("Table I", "'training confusion matrices': on the data of the fit, or validated?"),
    ),
    *_statements(
        "experiment 2",
        ("Results", "closed, locked, 'before we started applying disturbances'"),
        ("Figure of experiment 2", "closed, secured its grip, 'and then released the object'"),
    ),
    *_statements(
        "the unstable class",
        ("Introduction", "'both slippage and loss of contact'"),
        ("Data collection", "also the absence of contact, and the closing of the hand"),
        ("Model selection", "no contact 'can be separated by a small threshold'; none is used"),
    ),
)


def discrepancies() -> ResultTable:
    """Return the table of statements that contradict each other or leave a question open."""
    rows = [
        Row(
            {
                "about": statement.about,
                "where": statement.where,
                "says": statement.says,
                "figure": "printed",
            },
            ours=None,
            paper=statement.value,
        )
        for statement in STATEMENTS
    ]
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
