"""Tables of the comparison by sample: methods, hands, splits and probabilities."""

from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import (
    REFERENCE_METHOD,
    SPLIT_TITLES,
    Results,
    method_results,
    method_titles,
)
from holdfast_lab.study.comparison.rows import (
    DIGITS,
    calibration_row,
    difference_row,
    sample_rows,
    without_estimate_row,
)
from holdfast_lab.study.comparison.strongest import strongest_of_family
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.paper import published
from holdfast_lab.study.paper.random_split import ConfusionCounts, rate_rows
from holdfast_lab.study.plan import StudyPlan

POOLED_METHODS = (
    "logreg", "logreg_unweighted", "svm", "svm_unweighted", "trees", "holdfast",
)  # fmt: skip
"""Methods that are evaluated by the random split too."""
ACCURACY_DIFFERENCE = "accuracy less the paper's best [points]"
PAPER_UNSEEN: dict[str, dict[str, float]] = {
    "logreg": {"accuracy [%]": 95.64, "FDR [%]": 5.1},
    "svm": {"accuracy [%]": 96.2},
    "zhang": {"accuracy [%]": 62.7, "FDR [%]": 49.1},
}
PAPER_UNSEEN |= {f"{name}_unweighted": PAPER_UNSEEN[name] for name in ("logreg", "svm")}
"""Values that the paper prints for unseen data; for Zhang "not more than" and "up to".

The paper does not say how it weighted classes, so its values stand beside both weights."""

SAME_SAMPLES_NOTE = (
    "All methods are scored on the same samples: those at which every one of them has had enough "
    "samples for an estimate. 'Without estimate' is the share of all labelled samples at which "
    "the method itself has none."
)

Keys = dict[str, Key]


def methods(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of all methods on all splits, with the values that the paper prints."""
    rows: list[Row] = []
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            keys: Keys = {"method": title, "on": SPLIT_TITLES[key]}
            paper = PAPER_UNSEEN.get(name, {}) if key == "recording" else {}
            rows += sample_rows(keys, evaluation.metrics, paper=paper)
            rows.append(without_estimate_row(keys, evaluation.without_estimate, plan.seed))
            as_hand = evaluation.fingers is None
            best = strongest_of_family(plan, results, key, as_hand=as_hand)
            if best is not None and best[0] != name:
                base = best[1].hand if as_hand else best[1].metrics
                figure = keys | {"figure": ACCURACY_DIFFERENCE}
                rows.append(difference_row(figure, evaluation.metrics, base, plan.seed))
    whole_hand = ", ".join(method.title for method in METHODS.values() if method.whole_hand)
    note = (
        "By recording and by object: evaluated out of fold. Unseen objects, other seeds, other "
        "profiles: fitted to all of main. Samples of all fingers pooled, at the method's own "
        "threshold; below the contact threshold nothing is stable. The whole-hand methods "
        f"({whole_hand}) are evaluated, and compared, as hands. {SAME_SAMPLES_NOTE} The "
        "difference is to the most accurate of the paper's method and its variants on the same "
        "recordings; it is paired: a resample draws the same recordings for both. The AUC pools "
        "the probabilities of all folds and fingers, so it also depends on whether their scales "
        "agree. The paper's values are of its own data, finger and split."
        f"{' Left out of a quick study: the linear SVMs of James & Lepora.' * plan.quick}"
    )
    title = "Methods by sample"
    return ResultTable("methods", title, note, rows, ("on", "method"), digits_of=DIGITS)


def hands(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of all methods as hands, the task that they have in common."""
    rows: list[Row] = []
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            keys: Keys = {"method": title, "on": SPLIT_TITLES[key]}
            shown = ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC", "AUC contact")
            rows += sample_rows(keys, evaluation.hand, shown)
            rows.append(without_estimate_row(keys, evaluation.hand_without_estimate, plan.seed))
            best = strongest_of_family(plan, results, key, as_hand=True)
            if best is not None and best[0] != name:
                figure = keys | {"figure": ACCURACY_DIFFERENCE}
                rows.append(difference_row(figure, evaluation.hand, best[1].hand, plan.seed))
    note = (
        "A hand is not stable if a finger is not stable; it is stable if at least two fingers "
        "are. Its score is the smallest probability of the fingers in contact. "
        f"{SAME_SAMPLES_NOTE}"
    )
    return ResultTable(
        "hands", "Methods by sample, hands", note, rows, ("on", "method"), digits_of=DIGITS
    )


def splits(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of accuracy by split: how much a random split of samples flatters."""
    rows: list[Row] = []
    for name in pooled_methods(plan):
        keys: Keys = {"method": METHODS[name].title}
        counts: ConfusionCounts = results[f"pooled/{name}"]
        ((_, row),) = rate_rows(counts, ("accuracy",), plan.seed)
        # The paper's accuracies of the random split, beside both weights of the classes.
        method = name.removesuffix("_unweighted")
        paper = published.UNSEEN.get(method)
        if method == REFERENCE_METHOD:
            paper = published.FIRST_FINGER["accuracy"]
        rows.append(Row({**keys, "split": "random"}, row.ours, paper, row.n, row.interval))
        for key, evaluation in method_results(plan, results, name):
            (row,) = sample_rows({}, evaluation.metrics, ("accuracy [%]",))
            row_keys = keys | {"split": SPLIT_TITLES[key]}
            rows.append(Row(row_keys, row.ours, None, row.n, row.interval))
    note = (
        "Random: the samples of all recordings, pooled and split at random into five folds, as in "
        "the paper. All else is equal. The paper's value is of its own data."
    )
    return ResultTable("splits", "Accuracy by split [%]", note, rows, ("method",), column="split")


def reliability(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of the quality of probabilities."""
    rows: list[Row] = []
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            keys: Keys = {"on": SPLIT_TITLES[key], "method": title}
            rows += sample_rows(keys, evaluation.metrics, ("Brier",))
            figure = keys | {"figure": "calibration error"}
            rows.append(calibration_row(figure, evaluation, plan.seed))
    note = (
        "Brier: mean of (probability - class)^2. Calibration error: the distance between the mean "
        "probability and the share of stable samples, by ten bins of probability, mean over "
        "samples."
    )
    lines = ("on", "method")
    return ResultTable("reliability", "Probabilities", note, rows, lines, digits=3)


def pooled_methods(plan: StudyPlan) -> list[str]:
    """Return the names of the methods that are evaluated by the random split too."""
    left_out = ("trees",) if plan.quick else ()
    return [n for n in method_titles(plan) if n in POOLED_METHODS and n not in left_out]
