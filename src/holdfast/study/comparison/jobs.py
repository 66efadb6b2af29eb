"""Which methods the study judges, on what, and how thoroughly."""

from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from typing import Any

from holdfast.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    MethodEvaluation,
    Split,
    evaluate_method,
)
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import METHODS
from holdfast.study.plan import StudyPlan
from holdfast.study.tasks import Task

PAPER = "logreg"
"""What all others are compared to."""
MAIN = ("logreg", "svm", "zhang", "trees", "holdfast")
"""Evaluated on every corpus."""
CORE = ("logreg", "holdfast")
"""Those of them that a quick study judges there."""
NETWORK = "tcn"
SLOW = ("jl_local_svm", "jl_global_svm", NETWORK)
"""Left out of a quick study."""
SECONDS = {"trees": 300.0, "jl_local_svm": 150.0, "jl_global_svm": 230.0, NETWORK: 1500.0}
"""About how long they take; others `USUAL`."""
USUAL = 30.0

QUICK = EvaluationEffort(folds=3, inner=2, max_rows=10_000)
OF_NETWORK = EvaluationEffort(folds=2, inner=2, stride=3, max_rows=6_000)
"""A fit takes a minute for 20,000 windows of a finger."""

SPLITS = {
    "recording": "by recording",
    "object": "by object",
    "others": "unseen objects",
    "fresh": "other seeds",
    "gentle": "gentle profile",
    "vigorous": "vigorous profile",
}
"""What the keys of a method's results are called in tables; the first two are splits of main."""

Results = Mapping[str, Any]


def titles(plan: StudyPlan) -> dict[str, str]:
    """The methods that are compared, by name."""
    left_out = SLOW if plan.quick else () if has_network() else (NETWORK,)
    return {name: each.title for name, each in METHODS.items() if name not in left_out}


def has_network() -> bool:
    """Whether torch, which the network needs, is installed."""
    return find_spec("torch") is not None


def network_note(plan: StudyPlan) -> str:
    """What a reader has to know of the network: how it was judged, or why it was not."""
    if plan.quick:
        return "Left out of a quick study: the TCN and the linear SVMs of James & Lepora."
    if not has_network():
        return "Left out: the TCN, for torch is not installed (pip install 'holdfast[deep]')."
    effort = OF_NETWORK
    return (
        f"The TCN has a budget of its own: {effort.folds} folds, {effort.max_rows:,} windows of "
        f"a finger to train, every {effort.stride}rd sample judged."
    )


def task_of(plan: StudyPlan, method: str) -> Task:
    """The task that judges a method on all that the plan has for it."""
    return judging(f"methods/{method}", job_of(plan, method), quick=plan.quick)


def judging(name: str, job: EvaluationJob, *, quick: bool = False) -> Task:
    """A task of that name that does a job; its cost is about right for the twin's recordings [s].

    Args:
        name: of the task.
        job: to do.
        quick: whether folds are few.
    """
    parts = len(job.splits) + 0.5 * len(job.tests)
    seconds = SECONDS.get(job.method, USUAL) * parts / 2.5 * (0.5 if quick else 1.0)
    return Task(name, evaluate_method, (job,), dict[str, MethodEvaluation], cost=seconds)


def job_of(plan: StudyPlan, method: str) -> EvaluationJob:
    """All that is asked of a method."""
    tests = tuple(plan.corpora[role] for role in _roles(plan, method))
    splits: tuple[Split, ...] = ("recording", "object")
    if method == NETWORK or (plan.quick and method not in CORE):
        splits = ("recording",)
    return EvaluationJob(
        method, plan.main, splits, tests, Variation(), effort_of(plan, method), plan.seed
    )


def effort_of(plan: StudyPlan, method: str) -> EvaluationEffort:
    """How thoroughly a method is judged."""
    if method == NETWORK:
        return OF_NETWORK
    return QUICK if plan.quick else EvaluationEffort()


def found(plan: StudyPlan, results: Results, method: str) -> Iterator[tuple[str, MethodEvaluation]]:
    """By key of `SPLITS`, what a method is worth there."""
    judged: Mapping[str, MethodEvaluation] = results[f"methods/{method}"]
    for key in SPLITS:
        name = plan.corpora[key].name if key in plan.corpora else key
        if name in judged:
            yield key, judged[name]


def _roles(plan: StudyPlan, method: str) -> list[str]:
    everywhere = method in (CORE if plan.quick else MAIN)
    wanted = list(SPLITS)[2:] if everywhere else [] if plan.quick else ["others"]
    return [role for role in wanted if role in plan.corpora]
