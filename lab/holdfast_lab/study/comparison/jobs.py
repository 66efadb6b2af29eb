"""The evaluation jobs of the study: which methods, on which recordings, at which size."""

from collections.abc import Iterator, Mapping
from typing import Any

from holdfast_lab.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    GroupSplit,
    MethodEvaluation,
    evaluate_method,
)
from holdfast_lab.study.methods import METHODS, PAPER_FAMILY
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.tasks import Task

REFERENCE_METHOD = "logreg"
"""The paper's method, which all others are compared with."""
MAIN_METHODS = (*PAPER_FAMILY, "zhang", "holdfast", "noise_floor", "always_stable")
"""Methods that are evaluated on every corpus."""
QUICK_METHODS = (*PAPER_FAMILY, "holdfast")
"""Those of them that a quick study evaluates on every corpus."""
SLOW_METHODS = ("jl_local_svm", "jl_global_svm")
"""Methods that a quick study leaves out."""
METHOD_SECONDS = {"trees": 80.0, "jl_local_svm": 40.0, "jl_global_svm": 60.0}
"""Approximate duration of the slow evaluations [s]."""
DEFAULT_SECONDS = 20.0
"""Approximate duration of the other evaluations [s]."""

QUICK_EFFORT = EvaluationEffort(folds=3, inner=2, max_samples=10_000)

SPLIT_TITLES = {
    "recording": "by recording",
    "object": "by object",
    "others": "unseen objects",
    "fresh": "other seeds",
    "gentle": "gentle profile",
    "vigorous": "vigorous profile",
    "glitch-0": "no glitches",
    "glitch-1": "1 glitch a minute",
}
"""Titles of splits and corpora in tables, by name. The first two are splits of "main"."""
GLITCH_RATE_SPLITS = ("glitch-0", "glitch-1", "others")
"""Corpora of the same objects that differ in the rate of glitches; "others" has 7 a minute."""

Results = Mapping[str, Any]
"""Results of the tasks of the study, by name of the task."""


def method_titles(plan: StudyPlan) -> dict[str, str]:
    """Return the titles of the compared methods, by name.

    Methods for whole hands are left out if there is one finger.
    """
    left_out = SLOW_METHODS if plan.quick else ()
    one_finger = len(plan.main.fingers) < 2
    return {
        name: method.title
        for name, method in METHODS.items()
        if name not in left_out and not (method.whole_hand and one_finger)
    }


def short_titles(plan: StudyPlan) -> dict[str, str]:
    """Return the titles of the compared methods for legends, by name."""
    return {name: short_title(title) for name, title in method_titles(plan).items()}


def short_title(title: str) -> str:
    """Return the title of a method without the text in brackets."""
    return title.split(" (", maxsplit=1)[0]


def method_task(plan: StudyPlan, method: str) -> Task:
    """Return the task that evaluates a method on all corpora that the plan has for it."""
    job = method_job(plan, method)
    parts = len(job.splits) + 0.5 * len(job.tests)
    # For recordings of the twin [s]; a quick study has fewer folds.
    seconds = METHOD_SECONDS.get(method, DEFAULT_SECONDS) * parts / 2.5
    cost = seconds * (0.5 if plan.quick else 1.0)
    result = dict[str, MethodEvaluation]
    return Task(f"methods/{method}", evaluate_method, (job,), result, cost=cost)


def method_job(plan: StudyPlan, method: str) -> EvaluationJob:
    """Return the complete evaluation job of a method."""
    # Corpora other than "main": all for the main methods, else only those of unseen objects.
    roles = ["others"] if not plan.quick else []
    if method in (QUICK_METHODS if plan.quick else MAIN_METHODS):
        roles = list(SPLIT_TITLES)[2:]
    tests = tuple(plan.corpora[role] for role in roles if role in plan.corpora)
    splits: tuple[GroupSplit, ...] = ("recording", "object")
    if plan.quick and method not in QUICK_METHODS:
        splits = ("recording",)
    return EvaluationJob(
        method,
        plan.main,
        splits,
        tests,
        method_effort(plan),
        plan.seed,
        tuple(method_titles(plan)),
    )


def method_effort(plan: StudyPlan) -> EvaluationEffort:
    """Return the size of the evaluation of a method."""
    return QUICK_EFFORT if plan.quick else EvaluationEffort()


def method_results(
    plan: StudyPlan, results: Results, method: str
) -> Iterator[tuple[str, MethodEvaluation]]:
    """Yield the results of a method on each split and corpus, by key of `SPLIT_TITLES`."""
    evaluations: Mapping[str, MethodEvaluation] = results[f"methods/{method}"]
    for key in SPLIT_TITLES:
        # Results are stored by the name of a corpus, tables are made by its role.
        name = plan.corpora[key].name if key in plan.corpora else key
        if name in evaluations:
            yield key, evaluations[name]
