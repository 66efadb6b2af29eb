"""Tables of the comparison by sample: methods, hands, splits and probabilities."""

from collections.abc import Iterator

from holdfast.study.comparison.jobs import PAPER, SPLITS, Results, found, network_note, titles
from holdfast.study.comparison.rows import (
    DIGITS,
    calibration_row,
    difference_row,
    sample_rows,
)
from holdfast.study.evaluation.evaluate_method import MethodEvaluation
from holdfast.study.methods import METHODS
from holdfast.study.paper import published
from holdfast.study.paper.random_split import ConfusionCounts, rate_rows
from holdfast.study.plan import StudyPlan
from holdfast.study.report.result_tables import Key, ResultTable, Row

LEAKING = ("logreg", "svm", "trees", "holdfast")
"""Methods that are also judged by the random split."""
DIFFERENCE = "accuracy less LogReg's [points]"
PRINTED: dict[str, dict[str, float]] = {
    "logreg": {"accuracy [%]": 95.64, "FDR [%]": 5.1},
    "svm": {"accuracy [%]": 96.2},
    "zhang": {"accuracy [%]": 62.7, "FDR [%]": 49.1},
}
"""What the paper says of unseen data; of Zhang "not more than" and "up to"."""


def methods(plan: StudyPlan, results: Results) -> ResultTable:
    """Every method by every split, beside the paper's."""
    rows: list[Row] = []
    for name, title in titles(plan).items():
        for key, judged in found(plan, results, name):
            keys: dict[str, Key] = {"method": title, "on": SPLITS[key]}
            paper = PRINTED.get(name, {}) if key == "recording" else {}
            rows += sample_rows(keys, judged.metrics, paper=paper)
            if name != PAPER and (reference := _paper(plan, results, key)) is not None:
                base = reference.metrics if judged.fingers else reference.hand
                about = keys | {"figure": DIFFERENCE}
                rows.append(difference_row(about, judged.metrics, base, plan.seed))
    note = (
        "By recording and by object: fitted without what is judged, out of fold. Unseen objects, "
        "other seeds, other profiles: fitted to all of main. Samples of all fingers pooled, at "
        "the method's own threshold; below the contact threshold nothing is stable. The methods "
        f"for whole hands ({_whole()}) are judged, and compared, as hands. The difference is "
        "paired: a resample draws the same recordings for both. AUC is of the probabilities of all "
        "folds and fingers together, so that it also asks whether they mean the same. The "
        f"paper's figures are of its own data, finger and split. {network_note(plan)}"
    )
    title = "Methods by sample"
    return ResultTable("methods", title, note, rows, ("on", "method"), digits_of=DIGITS)


def hands(plan: StudyPlan, results: Results) -> ResultTable:
    """Every method judged as a hand: the task that all have in common."""
    rows: list[Row] = []
    for name, title in titles(plan).items():
        for key, judged in found(plan, results, name):
            keys: dict[str, Key] = {"method": title, "on": SPLITS[key]}
            shown = ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC", "AUC contact")
            rows += sample_rows(keys, judged.hand, shown)
            if name != PAPER and (reference := _paper(plan, results, key)) is not None:
                about = keys | {"figure": DIFFERENCE}
                rows.append(difference_row(about, judged.hand, reference.hand, plan.seed))
    note = (
        "A hand is not stable where a finger is not, stable where two hold. Its score is the "
        "least probability of the fingers in contact."
    )
    return ResultTable(
        "hands", "Methods by sample, hands", note, rows, ("on", "method"), digits_of=DIGITS
    )


def splits(plan: StudyPlan, results: Results) -> ResultTable:
    """What a random split of samples hides."""
    rows: list[Row] = []
    for name in leaking(plan):
        keys: dict[str, Key] = {"method": METHODS[name].title}
        paper = published.FIRST_FINGER["accuracy"] if name == PAPER else published.UNSEEN.get(name)
        rows.append(_pooled(keys, results[f"pooled/{name}"], paper, plan.seed))
        for key, judged in found(plan, results, name):
            (row,) = sample_rows({}, judged.metrics, ("accuracy [%]",))
            about = keys | {"split": SPLITS[key]}
            rows.append(Row(about, row.ours, None, row.n, row.interval))
    note = (
        "Random: samples of all recordings pooled and dealt to five folds, as the paper's split; "
        "everything else is equal. The paper's figure is of its own data."
    )
    return ResultTable("splits", "Accuracy by split [%]", note, rows, ("method",), column="split")


def reliability(plan: StudyPlan, results: Results) -> ResultTable:
    """How far probabilities can be believed."""
    rows: list[Row] = []
    for name, title in titles(plan).items():
        for key, judged in found(plan, results, name):
            keys: dict[str, Key] = {"on": SPLITS[key], "method": title}
            rows += sample_rows(keys, judged.metrics, ("Brier",))
            rows.append(calibration_row(keys | {"figure": "calibration error"}, judged, plan.seed))
    note = (
        "Brier: mean of (probability - class)^2. Calibration error: by ten bins of probability, "
        "the distance between what was given and what was so, mean over samples."
    )
    lines = ("on", "method")
    return ResultTable("reliability", "Probabilities", note, rows, lines, digits=3)


def leaking(plan: StudyPlan) -> list[str]:
    """Methods that are also judged by the random split."""
    return [
        name for name in titles(plan) if name in LEAKING and not (plan.quick and name == "trees")
    ]


def _pooled(keys: dict[str, Key], counts: ConfusionCounts, paper: float | None, seed: int) -> Row:
    ((_, row),) = rate_rows(counts, ("accuracy",), seed)
    return Row(keys | {"split": "random"}, row.ours, paper, row.n, row.interval)


def _paper(plan: StudyPlan, results: Results, key: str) -> MethodEvaluation | None:
    """The paper's method on the same recordings."""
    return dict(found(plan, results, PAPER)).get(key)


def _whole() -> str:
    return ", ".join(_titles_of_hands())


def _titles_of_hands() -> Iterator[str]:
    return (each.title for each in METHODS.values() if each.whole_hand)
