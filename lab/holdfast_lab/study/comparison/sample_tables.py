"""Tables of the comparison by sample: methods, hands, splits and probabilities.

And by circumstance: phase, grip force, direction of the disturbance.
"""

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from holdfast.contact import CONTACT_FORCE, Phase
from holdfast.sensors.types import Array
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import (
    REFERENCE_METHOD,
    SPLIT_TITLES,
    Results,
    method_results,
    method_titles,
    network_note,
)
from holdfast_lab.study.comparison.rows import (
    DIGITS,
    calibration_row,
    difference_row,
    ratio_row,
    sample_rows,
    without_estimate_row,
)
from holdfast_lab.study.comparison.strongest import strongest_of_family
from holdfast_lab.study.evaluation.error_breakdown import (
    OBLIQUE,
    PULL_DIRECTIONS,
    ErrorBreakdown,
    GripErrors,
)
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
        "agree. The paper's values are of "
        f"its own data, finger and split. {network_note(plan)}"
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
        known = name.removesuffix("_unweighted")
        paper = published.UNSEEN.get(known)
        if known == REFERENCE_METHOD:
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


QUARTERS = ("lightest quarter", "second", "third", "firmest quarter")
SHOWN_SPLITS = ("recording", "others")
STABLE_MISSED = "stable called otherwise [%]"
NOT_STABLE_MISSED = "not stable called stable [%]"
ERROR_KINDS = (STABLE_MISSED, NOT_STABLE_MISSED)

Line = tuple[Keys, Sequence[ErrorBreakdown]]


def phases(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of errors by phase of the experiment."""
    rows: list[Row] = []
    for keys, breakdowns in _lines(plan, results):
        for phase in map(str, Phase):
            n, wrong = np.array([breakdown.phases.get(phase, (0, 0)) for breakdown in breakdowns]).T
            if n.sum():
                rows.append(ratio_row(keys | {"phase": phase}, wrong, n, plan.seed))
    note = "Share of wrong samples in each phase of the true course of the grasp; all fingers."
    title = "Errors by phase [%]"
    return ResultTable("phases", title, note, rows, ("on", "method"), column="phase")


def force(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of errors by grip force. The paper states that it has no influence."""
    rows: list[Row] = []
    lines = [line for line in _lines(plan, results) if any(errors.grips for errors in line[1])]
    # Of the first line, for the grips are those of the recordings, whatever the method.
    edges = force_quartiles(lines[0][1]) if lines else np.empty(0)
    for keys, breakdowns in lines:
        for quarter, title in enumerate(QUARTERS):
            for kind in ERROR_KINDS:
                # Samples, and wrong ones, of the fingers in this quarter, by recording.
                counts = np.zeros((2, len(breakdowns)))
                for column, errors in enumerate(breakdowns):
                    for grip in _holding_grips([errors]):
                        if np.searchsorted(edges, grip.force) == quarter:
                            missed = grip.stable if kind == STABLE_MISSED else grip.not_stable
                            counts[:, column] += missed
                n, wrong = counts
                figure = keys | {"error": kind, "grip": title}
                rows.append(ratio_row(figure, wrong, n, plan.seed))
    bounds = ", ".join(f"{edge:.2f}" for edge in edges)
    note = (
        "Quarters of the fingers by the mean of their true contact force while the object is "
        f"locked, over the recordings evaluated by recording (limits {bounds} N). Samples while "
        "the object is held; methods that decide for fingers."
    )
    return ResultTable(
        "force", "Errors by grip force [%]", note, rows, ("on", "error", "method"), column="grip"
    )


def directions(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of missed disturbances by direction. The paper states: all are found."""
    rows: list[Row] = []
    n_disturbances: dict[str, int] = {}
    for keys, breakdowns in _lines(plan, results):
        for direction in (*PULL_DIRECTIONS, OBLIQUE):
            # Counts are (labelled samples, wrong ones): without labelled samples there is no rate.
            events = [
                [count for name, count in breakdown.disturbances if count[0] and name == direction]
                for breakdown in breakdowns
            ]
            n = [sum(n for n, _ in of_recording) for of_recording in events]
            wrong = [sum(wrong for _, wrong in of_recording) for of_recording in events]
            if sum(n):
                rows.append(ratio_row(keys | {"direction": direction}, wrong, n, plan.seed))
                # The first line counts: it has the recordings evaluated by recording.
                n_disturbances.setdefault(direction, sum(map(len, events)))
    ordered = [each for each in (*PULL_DIRECTIONS, OBLIQUE) if each in n_disturbances]
    counts = ", ".join(f"{direction} {n_disturbances[direction]}" for direction in ordered)
    note = (
        "Share of the samples labelled not stable, during a disturbance, that are called stable; "
        "all fingers. Directions of the mean outside force in the world frame, within 30 degrees; "
        f"gravity acts downwards. Disturbances by recording: {counts or 'none'}."
    )
    title = "Disturbed called stable, by direction [%]"
    return ResultTable("directions", title, note, rows, ("on", "method"), column="direction")


def force_quartiles(breakdowns: Sequence[ErrorBreakdown]) -> Array:
    """Return the three quartiles of the force of the fingers that hold the object [N]."""
    forces = [grip.force for grip in _holding_grips(breakdowns)]
    return np.quantile(forces, (0.25, 0.5, 0.75)) if forces else np.empty(0)


def _holding_grips(breakdowns: Sequence[ErrorBreakdown]) -> Iterator[GripErrors]:
    grips = chain.from_iterable(breakdown.grips for breakdown in breakdowns)
    return (grip for grip in grips if grip.force > CONTACT_FORCE)


def _lines(plan: StudyPlan, results: Results) -> Iterator[Line]:
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            if key in SHOWN_SPLITS and any(errors.phases for errors in evaluation.breakdown):
                yield {"on": SPLIT_TITLES[key], "method": title}, evaluation.breakdown
