"""Part of the study: the tables of the paper by its own protocol, and on new data."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from holdfast.detection import DEFAULT_WINDOW, DEPLOYED_FEATURES, FEATURE_NAMES
from holdfast.plots.style import PAPER
from holdfast_lab.figures.curves import PlottedCurve, draw_lines
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.study.comparison.rows import curve_of
from holdfast_lab.study.paper import published
from holdfast_lab.study.paper.pooled_samples import ENERGY_NAME
from holdfast_lab.study.paper.random_split import (
    FRESH,
    HELD_OUT,
    OTHER_RECORDINGS,
    UNSEEN_OBJECTS,
    FitBudget,
    Variant,
    VariantResult,
    evaluate_variants,
    rate_rows,
)
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.tasks import Task

ABLATION_WINDOWS = (14, 18)
QUICK_WINDOWS = (4, 10, 14, 18)
METHOD_TITLES = {
    "logreg": "LogReg",
    "svm": "SVM",
    "logreg_balanced": "LogReg, balanced classes",
    "svm_balanced": "SVM, balanced classes",
}
"""Classifiers of Table I. The paper's toolbox weights all samples alike."""
FINGER_TITLES = {name: METHOD_TITLES[name] for name in ("logreg", "svm")}
"""Classifiers of the tables of all fingers."""
N_FIT = 80_000
"""Maximum number of samples of a fit: the SVM needs minutes for more."""
FEATURE_SETS = {"all six": FEATURE_NAMES, "deployed": DEPLOYED_FEATURES}
SHORT_TESTS = (HELD_OUT, FRESH, OTHER_RECORDINGS, UNSEEN_OBJECTS)
"""Test data of the tables with many lines."""
SECONDS_PER_TRIAL = {"logreg": 0.1, "svm": 1.5, "threshold": 0.0}
"""Expected time of a trial on the recordings of the twin [s]."""

_PAPER_VARIANTS: tuple[Variant, ...] = tuple((name, DEPLOYED_FEATURES) for name in FINGER_TITLES)
_BALANCED: tuple[Variant, ...] = tuple(
    (name, DEPLOYED_FEATURES) for name in METHOD_TITLES if name not in FINGER_TITLES
)
_ZHANG: Variant = ("svm", (ENERGY_NAME,))
_BEST_THRESHOLD: Variant = ("threshold", (ENERGY_NAME,))

Keys = dict[str, Key]


def tasks(plan: StudyPlan) -> list[Task]:
    """Return the tasks for the tables of the paper."""
    first = first_finger(plan)
    every = [
        _task(plan, f"fingers/{finger}", finger, DEFAULT_WINDOW, _PAPER_VARIANTS, thorough=True)
        for finger in _fingers(plan)
    ]
    # The paper does not name the finger of its other tables: one stands for it.
    every.append(_task(plan, f"balanced/{first}", first, DEFAULT_WINDOW, _BALANCED, thorough=True))
    for window in _windows(plan):
        variants = (
            *(("logreg", names) for names in FEATURE_SETS.values()), _ZHANG, _BEST_THRESHOLD,
        )  # fmt: skip
        # What the task of the first finger computes already is not computed again.
        new = tuple(
            variant
            for variant in variants
            if window != DEFAULT_WINDOW or variant not in _PAPER_VARIANTS
        )
        every.append(_task(plan, f"window/{window}", first, window, new))
    for window in ABLATION_WINDOWS:
        subsets = (columns_of(subset) for subset in published.ABLATION)
        new = tuple(("logreg", names) for names in subsets if names not in FEATURE_SETS.values())
        every.append(_task(plan, f"subsets/{window}", first, window, new))
    return every


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """Return the tables of the paper, with our values and the paper's.

    Args:
        plan: of the study.
        results: of the tasks, by name.
    """
    fits = PaperResults(plan, results)
    makers = (
        confusion_table, window_table, ablation_table, unseen_table, finger_table, zhang_table,
    )  # fmt: skip
    return [*(make(fits) for make in makers), published.discrepancies()]


def figures(plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
    """Return Table II as a figure."""
    return [window_figure(window_table(PaperResults(plan, results)))]


def first_finger(plan: StudyPlan) -> str:
    """Return the finger of the tables: the index, for the paper does not name it."""
    return "index" if "index" in plan.main.fingers else plan.main.fingers[0]


def base_name(classifier: str) -> str:
    """Return the name of a classifier without its class weights.

    Example:
        >>> base_name("svm_balanced")
        'svm'
    """
    return classifier.removesuffix("_balanced")


def columns_of(subset: Iterable[str]) -> tuple[str, ...]:
    """Return the features of a row of Table III, where F_tip stands for three of them."""
    return tuple(
        name
        for name in FEATURE_NAMES
        if name in subset or ("F_tip" in subset and name in ("F_x", "F_y", "F_z"))
    )


class PaperResults:
    """Results of the tasks, by finger, window and variant."""

    def __init__(self, plan: StudyPlan, results: Mapping[str, Any]) -> None:
        self.plan = plan
        self.by_variant: dict[tuple[str, int, Variant], VariantResult] = {}
        for task in tasks(plan):
            _, finger, window, *_ = task.arguments
            for result in results[task.name]:
                self.by_variant[finger, window, (result.classifier, result.features)] = result
        roles = {FRESH: "fresh", UNSEEN_OBJECTS: "others"}
        self.tests = [on for on in SHORT_TESTS if on not in roles or roles[on] in plan.corpora]

    def of(
        self, variant: Variant, window: int = DEFAULT_WINDOW, finger: str | None = None
    ) -> VariantResult:
        """Return the result of a variant, by default of the first finger."""
        return self.by_variant[finger or first_finger(self.plan), window, variant]

    def rows(
        self,
        result: VariantResult,
        keys: Keys,
        names: Iterable[str],
        paper: Mapping[str, float],
        on: Iterable[str] | None = None,
    ) -> Iterator[Row]:
        """Yield a row for each rate and each kind of test data.

        Args:
            result: of a variant.
            keys: of all rows.
            names: of the rates.
            paper: values in the paper, by the names of the rates.
            on: kinds of test data; all by default.
        """
        for test_data in result.counts:
            if on is not None and test_data not in on:
                continue
            for name, row in rate_rows(result.counts[test_data], names, self.plan.seed):
                about = keys | {"on": test_data, "figure": name}
                yield Row(about, row.ours, paper.get(name), row.n, row.interval)

    @property
    def protocol(self) -> str:
        """Reference to the note of Table I."""
        return (
            f"Protocol and test data as in Table I (finger {first_finger(self.plan)} and "
            f"N_w = {DEFAULT_WINDOW}, if nothing else is given)."
        )


def confusion_table(fits: PaperResults) -> ResultTable:
    """Return Table I: the rates of each class."""
    rows: list[Row] = []
    for name, title in METHOD_TITLES.items():
        keys: Keys = {"classifier": title}
        names = ("TNR", "FPR", "FNR", "TPR", "accuracy")
        rows += fits.rows(
            fits.of((name, DEPLOYED_FEATURES)),
            keys,
            names,
            published.CONFUSION[base_name(name)],
        )
    note = " ".join(
        [
            "Each rate is relative to its true class (1 = stable): TNR and FPR to class 0, FNR "
            "and TPR to class 1. The paper prints one matrix, of 'the training process'. It is "
            "given beside every line. Its toolbox weights all samples alike; with balanced "
            "classes both classes have the same weight.",
            *_protocol(fits.plan, fits.of(("logreg", DEPLOYED_FEATURES))),
        ]
    )
    title = "The paper's Table I: confusion [%]"
    return ResultTable("confusion", title, note, rows, ("classifier", "on"))


def window_table(fits: PaperResults) -> ResultTable:
    """Return Table II: the rates by window."""
    rows: list[Row] = []
    for window in _windows(fits.plan):
        for title, names in FEATURE_SETS.items():
            keys: Keys = {"features": title, "N_w": window}
            result = fits.of(("logreg", names), window)
            paper = published.PUBLISHED_WINDOW[window]
            rows += fits.rows(result, keys, published.RATES, paper, fits.tests)
    # The sort is stable: the windows keep their order.
    rows.sort(key=lambda row: str(row.keys["features"]))
    note = f"All six features include m; the deployed five do not. {fits.protocol}"
    title = "The paper's Table II: LogReg by window [%]"
    return ResultTable("window", title, note, rows, ("features", "N_w", "on"))


def ablation_table(fits: PaperResults) -> ResultTable:
    """Return Table III: the rates by features."""
    rows: list[Row] = []
    for window in ABLATION_WINDOWS:
        for subset, paper in published.ABLATION.items():
            keys: Keys = {"N_w": window, "features": ", ".join(subset)}
            result = fits.of(("logreg", columns_of(subset)), window)
            rows += fits.rows(result, keys, published.RATES, paper, fits.tests)
    note = f"The paper prints one table; its window is not certain. {fits.protocol}"
    title = "The paper's Table III: LogReg by features [%]"
    return ResultTable("ablation", title, note, rows, ("N_w", "features", "on"))


def unseen_table(fits: PaperResults) -> ResultTable:
    """Return the accuracy on new recordings and objects."""
    rows: list[Row] = []
    for name, title in METHOD_TITLES.items():
        keys: Keys = {"classifier": title}
        paper = {"accuracy": published.UNSEEN[base_name(name)]}
        on = (FRESH, OTHER_RECORDINGS, UNSEEN_OBJECTS)
        rows += fits.rows(fits.of((name, DEPLOYED_FEATURES)), keys, ("accuracy",), paper, on)
    title = "Accuracy on unseen data [%]"
    note = f"The paper does not say what its unseen data are. {fits.protocol}"
    return ResultTable("unseen", title, note, rows, ("classifier", "on"))


def finger_table(fits: PaperResults) -> ResultTable:
    """Return accuracy and FDR of every finger."""
    rows: list[Row] = []
    for finger in _fingers(fits.plan):
        for name, title in FINGER_TITLES.items():
            keys: Keys = {"finger": finger, "classifier": title}
            # The paper prints values of LogReg alone.
            paper = published.OTHER_FINGERS.get(finger, {}) if name == "logreg" else {}
            if name == "logreg" and finger == first_finger(fits.plan):
                paper = published.FIRST_FINGER
            result = fits.of((name, DEPLOYED_FEATURES), finger=finger)
            rows += fits.rows(result, keys, ("accuracy", "FDR"), paper)
    note = (
        "The paper names the middle finger and the thumb. Its values of the finger that it does "
        f"not name are given beside ours of the {first_finger(fits.plan)}. {fits.protocol}"
    )
    lines = ("finger", "classifier", "on")
    return ResultTable("fingers", "Every finger [%]", note, rows, lines)


def zhang_table(fits: PaperResults) -> ResultTable:
    """Return Zhang's threshold beside the paper's method."""
    methods = {
        "energy of F_x (Zhang), SVM": (_ZHANG, published.PUBLISHED_ZHANG),
        "energy of F_x, best cut": (_BEST_THRESHOLD, {}),
        "LogReg (the paper)": (("logreg", DEPLOYED_FEATURES), published.FIRST_FINGER),
    }
    rows: list[Row] = []
    for title, (variant, paper) in methods.items():
        for window in _windows(fits.plan):
            keys: Keys = {"method": title, "N_w": window}
            result = fits.of(variant, window)
            rows += fits.rows(result, keys, ("accuracy", "FDR"), paper, fits.tests)
    note = (
        "Zhang: one threshold on the energy of the Haar details of F_x, by a linear SVM with one "
        "feature. Best cut: the threshold with the best balanced accuracy in training. The paper "
        "gives an accuracy of 'not more than' 62.7 and an FDR 'up to' 49.1, without a window. "
        f"There is no FDR if nothing is called stable. {fits.protocol}"
    )
    title = "Zhang et al. and the paper's method [%]"
    return ResultTable("zhang", title, note, rows, ("method", "N_w", "on"))


def _task(
    plan: StudyPlan,
    name: str,
    finger: str,
    window: int,
    variants: tuple[Variant, ...],
    *,
    thorough: bool = False,
) -> Task:
    roles = ("main", "fresh", "others")
    corpora = {role: plan.corpora[role] for role in roles if role in plan.corpora}
    budget = fit_budget(plan)
    arguments = (corpora, finger, window, variants, budget, plan.seed, thorough)
    cost = sum(
        1 + budget.trials * SECONDS_PER_TRIAL[base_name(classifier)] for classifier, _ in variants
    )
    return Task(f"paper/{name}", evaluate_variants, arguments, list[VariantResult], cost=cost)


def fit_budget(plan: StudyPlan) -> FitBudget:
    """Return the limits of the work for one classifier."""
    return FitBudget(trials=5, n_fit=40_000) if plan.quick else FitBudget(30, N_FIT)


def _windows(plan: StudyPlan) -> tuple[int, ...]:
    return QUICK_WINDOWS if plan.quick else published.WINDOWS


def _fingers(plan: StudyPlan) -> list[str]:
    """Return all fingers, the first finger of the tables first."""
    first = first_finger(plan)
    return [first, *(finger for finger in plan.main.fingers if finger != first)]


def _protocol(plan: StudyPlan, result: VariantResult) -> Iterator[str]:
    """Yield sentences on how the values were computed."""
    budget = fit_budget(plan)
    yield (
        f"Protocol of the paper: samples of all recordings are pooled ({first_finger(plan)}, "
        f"N_w = {DEFAULT_WINDOW}), and 80 % of them are drawn at random for training. "
        f"Hyper-parameters are found by {budget.trials} trials of Bayesian optimisation of the "
        "error over 5 random folds of at most 10,000 of them. There is no contact threshold. A fit "
        "uses at most "
        f"{budget.n_fit:,} samples at even steps; here {result.n_fitted:,}."
    )
    yield (
        "Training data: the 80 % themselves. Cross-validated: 5 random folds of them. Held out: "
        "the other 20 %. Neighbouring samples are nearly identical, so all three overestimate "
        "the accuracy."
    )
    if FRESH in result.counts:
        yield "Fresh recordings: the same objects in other recordings than those for training."
    else:
        yield (
            "Other recordings: each is tested with a fit to others, in 5 folds, with the "
            "hyper-parameters found on the 80 %."
        )
    if UNSEEN_OBJECTS not in result.counts:
        yield "Other objects: none, because the recordings do not name the object."
    elif "others" in plan.corpora:
        yield "Other objects: recordings of objects that were not used for training."
    else:
        yield "Other objects: each is tested with a fit to the others, in the same way."


def window_figure(window: ResultTable) -> ReportFigure:
    """Draw the rates of the deployed features by window, one panel for each rate."""
    rows = [row for row in window.rows if row.keys["features"] == "deployed"]
    names = list(dict.fromkeys(str(row.keys["figure"]) for row in rows))
    groups: dict[str, dict[str, PlottedCurve]] = {}
    for name in names:
        of_rate = [row for row in rows if row.keys["figure"] == name]
        test_data = dict.fromkeys(str(row.keys["on"]) for row in of_rate)
        curves = {
            on: curve_of([row for row in of_rate if row.keys["on"] == on], "N_w")
            for on in test_data
        }
        # The paper's value stands beside every kind of test data: one curve for all of them.
        paper = {float(r.keys["N_w"]): r.paper for r in of_rate if r.paper is not None}
        if paper:
            curves[PAPER] = PlottedCurve(np.array(list(paper)), np.array(list(paper.values())))
        groups[f"{name} [%]"] = curves
    caption = (
        "The paper's Table II as curves: LogReg on the deployed features by window. Bands are "
        "95 % intervals, by bootstrap over recordings. The line 'held out' is the protocol of the "
        "paper; the other lines are recordings and objects that were not used for training."
    )
    return ReportFigure("window", caption, draw_lines(groups, "$N_w$ [samples]", per_row=2))
