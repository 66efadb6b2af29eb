"""Part of the study: what the distance to the paper's accuracy is due to, one thing at a time."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from holdfast.features import DEFAULT_WINDOW, DEPLOYED_FEATURES
from holdfast.metrics import bootstrap_interval
from holdfast.sensors.types import Array
from holdfast.twin.uskin_readout import UskinParameters
from holdfast_lab.report.html_report import ReportFigure
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.paper import published
from holdfast_lab.study.paper.label_sources import (
    OWN_ENERGY,
    OWN_FORCE,
    OWN_WINDOW,
    has_truth,
)
from holdfast_lab.study.paper.paper_tables import METHOD_TITLES, first_finger
from holdfast_lab.study.paper.pooled_samples import UNTREATED, Treatment
from holdfast_lab.study.paper.random_split import (
    HELD_OUT,
    OTHER_RECORDINGS,
    ConfusionCounts,
    FitBudget,
    VariantResult,
    evaluate_variants,
    rate_rows,
)
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

N_ATTRIBUTION_FIT = 40_000
"""Maximum number of samples of a fit."""
OTHER_WINDOW = 32
"""Another window [samples]."""
LINE_DIFFERENCE = "accuracy less the first line [points]"
RATES = ("FPR", "FNR", "FDR", "accuracy")

Keys = dict[str, Key]


class Switch(NamedTuple):
    """One condition that differs from the paper's method on the reference recordings.

    Attributes:
        name: of its task.
        factor: what is switched.
        setting: to what.
        role: of the corpus.
        treatment: of its recordings.
        classifier: of `FIT_RECIPES`.
        window: N_w [samples].
    """

    name: str
    factor: str
    setting: str
    role: str = "main"
    treatment: Treatment = UNTREATED
    classifier: str = "logreg"
    window: int = DEFAULT_WINDOW


EXACT = Treatment(labels="exact")
DOUBLE_NOISE = float(np.sqrt(3)) * UskinParameters().noise_counts
"""Noise that doubles the sensor's own: variances add, and 4 = 1 + 3 [count]."""

SWITCHES = (
    Switch("base", "none", "LogReg, exact labels, reference profile, N_w = 14", treatment=EXACT),
    Switch("sliding", "labels", "only sliding is unstable", treatment=Treatment("sliding")),
    Switch("no_glitches", "labels", "glitches labelled stable", treatment=Treatment("no_glitches")),
    Switch("drawn", "labels", "drawn from the plot", treatment=Treatment("drawn")),
    Switch("own_energy", "labels", "by a threshold on its own energy, N_w = 4",
           treatment=Treatment("own_energy"), window=OWN_WINDOW),
    Switch("finger", "disturbances", "only a finger pushes", role="finger", treatment=EXACT),
    Switch("balanced", "classifier", METHOD_TITLES["logreg_balanced"], treatment=EXACT,
           classifier="logreg_balanced"),
    Switch("svm", "classifier", METHOD_TITLES["svm"], treatment=EXACT, classifier="svm"),
    Switch("svm_balanced", "classifier", METHOD_TITLES["svm_balanced"], treatment=EXACT,
           classifier="svm_balanced"),
    Switch("noiseless", "noise", "none but rounding", role="noiseless", treatment=EXACT),
    Switch("noisy", "noise", "twice the sensor's", treatment=Treatment("exact", DOUBLE_NOISE)),
    Switch("window", "window", f"N_w = {OTHER_WINDOW}", treatment=EXACT, window=OTHER_WINDOW),
    Switch("short_window", "window", f"N_w = {OWN_WINDOW}", treatment=EXACT, window=OWN_WINDOW),
)  # fmt: skip
"""The paper's method on the reference recordings, then with one thing switched at a time."""


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for each switch; none without a truth."""
    if not has_truth(plan.main.load()[0]):
        return []
    finger = first_finger(plan)
    corpora = same_repeats({each.role: plan.corpora[each.role] for each in switches(plan)})
    every = []
    for switch in switches(plan):
        variants = [(switch.classifier, DEPLOYED_FEATURES)]
        trials = 1 if plan.quick else 10
        budget = FitBudget(trials, N_ATTRIBUTION_FIT)
        arguments = (
            {"main": corpora[switch.role]}, finger, switch.window, variants, budget,
            plan.seed, False, switch.treatment,
        )  # fmt: skip
        cost = 60.0 if switch.classifier.startswith("svm") else 10.0
        name = f"attribution/{switch.name}"
        every.append(Task(name, evaluate_variants, arguments, list[VariantResult], cost=cost))
    return every


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """Return the table of switches; none without a truth."""
    if "attribution/base" not in results:
        return []
    base: VariantResult = results["attribution/base"][0]
    rows: list[Row] = []
    for switch in switches(plan):
        result: VariantResult = results[f"attribution/{switch.name}"][0]
        for on in (HELD_OUT, OTHER_RECORDINGS):
            keys: Keys = {"switched": switch.factor, "to": switch.setting, "on": on}
            paper = published.PUBLISHED_WINDOW[DEFAULT_WINDOW] if switch.name == "base" else {}
            for rate, row in rate_rows(result.counts[on], RATES, plan.seed):
                figure = keys | {"figure": rate}
                rows.append(Row(figure, row.ours, paper.get(rate), row.n, row.interval))
            if switch.name != "base":
                # Only main has the very recordings of the first line.
                paired = switch.role == "main"
                rows.append(
                    difference_row(keys, result.counts[on], base.counts[on], plan.seed, paired)
                )
    left_out = {each.role for each in SWITCHES} - set(plan.corpora)
    missing = f" Not simulated in this run: {', '.join(sorted(left_out))}." if left_out else ""
    note = (
        f"Finger {first_finger(plan)}, features and protocol of the paper (Table I), the paper's "
        "values of N_w = 14 beside the first line. Each further line differs from the first by "
        "one thing, in training and in test. Held out: the random split of the paper. Other "
        "recordings: each recording is tested with a fit to others. The same objects, cases and "
        "repeats in all lines. Only sliding is unstable: in a held contact, disturbances without "
        "sliding and glitches are stable. Glitches labelled stable: the jumps of the hand's own "
        "controller alone are. By its own energy: as in the public prototype of the paper's first "
        "author (github.com/Douniakit/tactile_data), a contact is where the normal force is over "
        f"{OWN_FORCE:g} counts, and labelled unstable where the energy of the Haar details of "
        f"that force is at least {OWN_ENERGY:,.0f} count^2 over {OWN_WINDOW} samples. What it "
        f"gains over the line N_w = {OWN_WINDOW} comes from labels that the classifier's own "
        "window makes, not from the contact. A finger pushes: the profile finger-reference of "
        "holdfast 0.1. Noise: recordings that are simulated with whole counts and no other "
        "noise, and readings with added noise. The difference is paired by recording where the "
        "recordings are the same; elsewhere both are drawn separately."
        f"{missing}"
    )
    lines = ("switched", "to", "on")
    title = "The paper's method, with one thing switched at a time [%]"
    return [ResultTable("attribution", title, note, rows, lines)]


def figures(plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
    """Return no figures."""
    del plan, results
    return []


def switches(plan: StudyPlan) -> list[Switch]:
    """Return the switches whose recordings exist."""
    return [switch for switch in SWITCHES if switch.role in plan.corpora]


def same_repeats(corpora: Mapping[str, Corpus]) -> dict[str, Corpus]:
    """Return the corpora with only those repeats of each grasp that all of them have.

    Repeats are read from the names of the recordings, as the twin gives them; recordings with
    other names are kept.
    """
    repeats = {
        role: [repeat_of(name) for name in corpus.recordings] for role, corpus in corpora.items()
    }
    last = min(max(repeat, default=0) for repeat in repeats.values())
    return {
        role: msgspec.structs.replace(
            corpus, recordings=tuple(n for n in corpus.recordings if repeat_of(n) <= last)
        )
        for role, corpus in corpora.items()
    }


def repeat_of(name: str) -> int:
    """Return the repeat in the name of a recording of the twin; 0 for other names.

    Example:
        >>> repeat_of("can-case2-3"), repeat_of("can-case2-3-failed1"), repeat_of("mine")
        (3, 3, 0)
    """
    match = re.search(r"-case\d+-(\d+)", name)
    return int(match[1]) if match else 0


def difference_row(
    keys: Mapping[str, Key],
    counts: ConfusionCounts,
    base: ConfusionCounts,
    seed: int,
    paired: bool,
) -> Row:
    """Return the accuracy of some counts minus that of others [points].

    Args:
        keys: of the row.
        counts: [TN, FP, FN, TP] of each recording.
        base: the same of the first line.
        seed: of the bootstrap.
        paired: a resample draws the same recordings for both.
    """
    tables = (np.array(table, dtype=np.float64).reshape(-1, 4) for table in (counts, base))
    # Correct samples, TN + TP, and all samples of each recording.
    first, second = (
        np.column_stack([table[:, 0] + table[:, 3], table.sum(axis=1)]) for table in tables
    )
    if paired:
        both = np.hstack([first, second])
    else:
        # Each recording fills its own half of the columns, so a resample draws them separately.
        both = np.vstack([np.pad(first, ((0, 0), (0, 2))), np.pad(second, ((0, 0), (2, 0)))])
    both = both[both.any(axis=1)]

    def statistic(draws: Array) -> Array:
        # A resample of both together may have no recording of one of them.
        correct, n, other_correct, other_n = (draws @ both).T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(100 * (correct / n - other_correct / other_n))

    ours = float(statistic(np.ones((1, len(both))))[0])
    interval = bootstrap_interval(statistic, len(both), seed=seed)
    n = sum(any(row) for row in counts)
    return Row({**keys, "figure": LINE_DIFFERENCE}, ours, None, n, interval)
