"""Part of the study: labels by two conventions, and the ceiling that the sensor sets."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from holdfast.metrics import Decisions, Metrics, summarise
from holdfast.metrics.samples import score_samples
from holdfast_lab.report.html_report import ReportFigure
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.rows import DIGITS, ratio_row, sample_rows
from holdfast_lab.study.evaluation.evaluate_method import held_out_folds
from holdfast_lab.study.evaluation.fitted_method import MethodTraining
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures, corpus_features
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.paper.label_sources import LabelSource, has_truth, relabelled
from holdfast_lab.study.paper.random_split import ConfusionCounts, rate_rows
from holdfast_lab.study.paper.visible_changes import HELD_CAUSES, HiddenCounts, count_hidden
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

SOURCES: dict[LabelSource, str] = {"exact": "exact truth", "drawn": "drawn from the plot"}
"""Conventions of the table of four, with their titles."""
LABEL_METHODS = ("logreg", "svm", "holdfast")
QUICK_LABEL_METHODS = ("logreg", "holdfast")
CEILING_WINDOWS = (14, 64)
"""The paper's window, and the longest of holdfast [samples]."""
CEILING_ROLES = {"main": "main", "finger": "finger protocol of holdfast 0.1"}
"""Roles of the corpora in the table of the ceiling, and their titles."""
SHOWN = ("accuracy [%]", "FDR [%]", "FNR [%]", "AUC contact", "Brier")
HELD_LABELS = "held: disturbance, slip or glitch"
ALL_SAMPLES = "all labelled samples"
HIDDEN = "without a visible change [%]"
CEILING = "ceiling [%]"
MISSED_EVENTS = "events missed at 50 ms [%]"
FALSE_ALARMS = "false alarms per minute"

Keys = dict[str, Key]


class LabelEvaluation(msgspec.Struct, frozen=True):
    """Results of one method that is trained and tested on two kinds of labels.

    Attributes:
        metrics: by "trained/tested", names of `SOURCES`.
        rule: confusion counts of each recording, if the drawn labels were the decisions.
    """

    metrics: dict[str, Metrics]
    rule: ConfusionCounts


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for each method and each window; none without a truth."""
    if not has_truth(plan.main.load()[0]):
        return []
    folds, max_samples = (3, 10_000) if plan.quick else (5, 20_000)
    every = [
        Task(
            f"labels/{name}",
            evaluate_labels,
            (name, plan.main, folds, max_samples, plan.seed),
            LabelEvaluation,
            cost=40.0,
        )
        for name in _methods(plan)
    ]
    for role in CEILING_ROLES:
        if role in plan.corpora:
            every += [
                Task(
                    f"ceiling/{role}/{window}",
                    count_hidden,
                    (plan.corpora[role], window),
                    list[HiddenCounts],
                    cost=20.0,
                )
                for window in CEILING_WINDOWS
            ]
    return every


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """Return the table of four and the table of the ceiling; none without a truth."""
    if f"labels/{_methods(plan)[0]}" not in results:
        return []
    every = [label_table(plan, results), ceiling_table(plan, results)]
    return [table for table in every if table.rows]


def figures(plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
    """Return no figures."""
    del plan, results
    return []


def evaluate_labels(
    name: str, corpus: Corpus, n_folds: int, max_samples: int, seed: int
) -> LabelEvaluation:
    """Fit a method to each kind of labels and test it on each, by recording.

    Args:
        name: of the method.
        corpus: of recordings whose truth is known.
        n_folds: of whole recordings; the same for all four.
        max_samples: of a finger, that train a classifier.
        seed: of folds and fits.
    """
    method = METHODS[name]
    # The features with each kind of labels.
    features = corpus_features(method, corpus)
    by_name = {recording.name: recording for recording in corpus.load()}
    by_source: dict[LabelSource, list[RecordingFeatures]] = {source: [] for source in SOURCES}
    for source, labelled in by_source.items():
        for each in features:
            modules = relabelled(by_name[each.name], source, corpus.tare).modules
            labels = {finger: modules[finger].label_states for finger in each.times}
            labelled.append(replace(each, labels=labels))
    metrics = {}
    for trained in SOURCES:
        training = MethodTraining.of(method, by_source[trained], max_samples, seed)
        everything = set(range(len(training.recordings)))
        decided: dict[LabelSource, dict[int, Decisions]] = {source: {} for source in SOURCES}
        for left_out in held_out_folds(training.objects, "recording", n_folds, seed):
            fitted = training.fit(everything - left_out)
            for index in left_out:
                for tested in SOURCES:
                    recording = by_source[tested][index]
                    scored = fitted.scores(recording)
                    decided[tested][index] = scored.decide(recording.labels)
        for tested, of_recording in decided.items():
            ordered = [of_recording[index] for index in sorted(of_recording)]
            metrics[f"{trained}/{tested}"] = summarise(ordered, seed=seed)
    # TN, FP, FN, TP of each recording, with the drawn labels as decisions.
    rule = []
    for exact, drawn in zip(by_source["exact"], by_source["drawn"], strict=True):
        counts = np.zeros(4, dtype=np.int64)
        for finger, truth in exact.labels.items():
            as_decisions = score_samples(truth, drawn.labels[finger], np.zeros(len(truth)))
            counts += as_decisions.confusion.ravel()
        rule.append([int(n) for n in counts])
    return LabelEvaluation(metrics, rule)


def label_table(plan: StudyPlan, results: Mapping[str, Any]) -> ResultTable:
    """Return the table of four: both labels in training and in test."""
    rows: list[Row] = []
    rule: ConfusionCounts = []
    for name in _methods(plan):
        evaluation: LabelEvaluation = results[f"labels/{name}"]
        rule = evaluation.rule
        for trained, trained_title in SOURCES.items():
            for tested, tested_title in SOURCES.items():
                keys: Keys = {
                    "method": METHODS[name].title,
                    "trained on": trained_title,
                    "tested on": tested_title,
                }
                metrics = evaluation.metrics[f"{trained}/{tested}"]
                rows += sample_rows(keys, metrics, SHOWN)
                if tested == "exact":  # events by drawn labels would be other events
                    hand, n = metrics.events.hand, len(metrics.recordings)
                    ends = None if metrics.intervals is None else metrics.intervals.hand
                    missed = None if ends is None else ends.missed["0.05"]
                    alarms = None if ends is None else ends.false_alarms_per_minute
                    figure = keys | {"figure": MISSED_EVENTS}
                    rows.append(Row(figure, hand.missed["0.05"], None, n, missed))
                    figure = keys | {"figure": FALSE_ALARMS}
                    rows.append(Row(figure, hand.false_alarms_per_minute, None, n, alarms))
    keys = {"method": "the drawn labels themselves", "trained on": "–", "tested on": "exact truth"}
    # The heads of the other lines, so that the rule stands in the same columns.
    names = {"accuracy": "accuracy [%]", "FDR": "FDR [%]", "FNR": "FNR [%]"}
    rows += [
        Row(keys | {"figure": names[name]}, row.ours, None, row.n, row.interval)
        for name, row in rate_rows(rule, names, plan.seed)
    ]
    note = (
        "By recording, the same folds for all. Exact truth: labels from the simulated forces and "
        "speeds, without margin. Drawn from the plot: labels by the rule 'signal', which uses the "
        "force alone, as a person does who reads its plot. The last line takes the drawn labels "
        "as decisions. Events are those of the hand by exact labels without margin, at the "
        "method's own threshold, without a hold time."
    )
    lines = ("method", "trained on", "tested on")
    return ResultTable(
        "labels", "Labels: exact or drawn, in training and in test", note, rows, lines,
        digits_of=DIGITS,
    )  # fmt: skip


def ceiling_table(plan: StudyPlan, results: Mapping[str, Any]) -> ResultTable:
    """Return the table of what the sensor shows."""
    rows: list[Row] = []
    for role, title in CEILING_ROLES.items():
        for window in CEILING_WINDOWS:
            counts: list[HiddenCounts] = results.get(f"ceiling/{role}/{window}", [])
            if counts:
                rows += ceiling_rows({"recordings of": title, "N_w": window}, counts, plan.seed)
    note = (
        "Exact labels without margin. A change is visible if, within the window that ends at the "
        "sample, the range of a component of the fingertip force, the range of any reading, or "
        "the sum of the variances of all readings is larger than in 99 % of the windows before "
        "the first contact. Without a visible change, a sample looks like a stable one to every "
        "detector with this window; only a longer memory can help. The ceiling is the largest "
        "share of the unstable samples that such a detector can call unstable without an error "
        f"on stable ones; for '{ALL_SAMPLES}' it is the largest accuracy. There, samples while "
        "the hand closes, releases or is empty count as visible, because the amplitude of the "
        "force shows them. The line 'stable' shows how often stable samples look like noise."
    )
    lines = ("recordings of", "N_w", "cause")
    title = "What the sensor shows of instability: the ceiling"
    return ResultTable("ceiling", title, note, rows, lines, digits_of={"samples": 0})


def ceiling_rows(keys: Keys, counts: Sequence[HiddenCounts], seed: int) -> Iterator[Row]:
    """Yield the number of samples, the hidden share and the ceiling, by cause."""
    all_kinds = dict.fromkeys(kind for count in counts for kind in count.samples)
    kinds = [kind for kind in all_kinds if kind != "stable"]
    for kind in kinds:
        n = [count.samples.get(kind, 0) for count in counts]
        hidden = [count.hidden.get(kind, 0) for count in counts]
        yield from _cause_rows(keys | {"cause": kind}, hidden, n, seed)
    in_grasp = [cause.value for cause in HELD_CAUSES]
    n = [sum(count.samples.get(kind, 0) for kind in in_grasp) for count in counts]
    hidden = [sum(count.hidden.get(kind, 0) for kind in in_grasp) for count in counts]
    yield from _cause_rows(keys | {"cause": HELD_LABELS}, hidden, n, seed)
    n_all = [count.n_labelled for count in counts]
    yield from _cause_rows(keys | {"cause": ALL_SAMPLES}, hidden, n_all, seed)
    if "stable" in all_kinds:
        n = [count.samples.get("stable", 0) for count in counts]
        hidden = [count.hidden.get("stable", 0) for count in counts]
        # Without the ceiling, which is one of unstable samples.
        yield from list(_cause_rows(keys | {"cause": "stable"}, hidden, n, seed))[:2]


def _cause_rows(keys: Keys, hidden: Sequence[int], n: Sequence[int], seed: int) -> Iterator[Row]:
    n_recordings = sum(number > 0 for number in n)
    yield Row(keys | {"figure": "samples"}, float(sum(n)), None, n_recordings)
    yield ratio_row(keys | {"figure": HIDDEN}, hidden, n, seed)
    visible = [whole - part for part, whole in zip(hidden, n, strict=True)]
    yield ratio_row(keys | {"figure": CEILING}, visible, n, seed)


def _methods(plan: StudyPlan) -> list[str]:
    names = QUICK_LABEL_METHODS if plan.quick else LABEL_METHODS
    return [name for name in names if name in METHODS]
