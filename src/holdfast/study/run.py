"""The whole study: tasks of all parts in one go, then tables, figures and the report."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from holdfast.errors import TrainingError
from holdfast.parallel import Engine
from holdfast.study import environment as circumstances
from holdfast.study.comparison import all_methods as comparison
from holdfast.study.comparison import real_recordings, sensitivity
from holdfast.study.paper import experiments, paper_tables
from holdfast.study.plan import StudyPlan
from holdfast.study.report.folder import check_output_folder, write_study
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import ResultTable
from holdfast.study.sections import Made, sections
from holdfast.study.tasks import Notify, ShowProgress, Task, TaskRunner

TITLE = "Slip and disturbance at the fingertips: the study"


class Part(Protocol):
    """A module with tasks, and what is made of their results."""

    def tasks(self, plan: StudyPlan) -> list[Task]:
        """What has to be computed."""
        ...

    def tables(self, plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
        """Tables out of it."""
        ...

    def figures(self, plan: StudyPlan, results: Mapping[str, Any]) -> list[ReportFigure]:
        """Figures out of it."""
        ...


PARTS: Mapping[str, Part] = {
    "paper": paper_tables,
    "experiments": experiments,
    "comparison": comparison,
    "sensitivity": sensitivity,
    "real": real_recordings,
}
"""The parts by name."""


def run_study(
    plan: StudyPlan,
    out: str | Path,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
    *,
    progress: ShowProgress = lambda items, *_: iter(items),
    notify: Notify = lambda _: None,
    force: bool = False,
    made_in: float = 0.0,
    left_out: Sequence[str] = (),
) -> list[ResultTable]:
    """Does a study and writes it to a folder; the same plan gives the same tables.

    What each task returned is kept in `out/work`, so that a study that was stopped goes on where
    it was, and one that is repeated is done at once.

    Args:
        plan: what is studied.
        out: the folder; it may hold `work` and `data`.
        engine: where the work is done.
        progress: goes through the tasks as they are done.
        notify: is given what a person would want to know.
        force: replace a study that is there, but for `work` and `data`.
        made_in: how long it took to make the data [s].
        left_out: what a reader would expect and does not find, in sentences.

    Returns:
        Every table, in the order of the report.

    Raises:
        OutputError: as `check_output_folder`.
        TrainingError: as `check_plan`, or the data cannot train something that is asked.
        EngineError: as `TaskRunner.run`.
    """
    check_output_folder(out, force=force)
    check_plan(plan)
    begun = time.perf_counter()
    tasks = [task for part in PARTS.values() for task in part.tasks(plan)]
    results = TaskRunner(Path(out), engine, progress, notify).run(tasks)
    notify("making tables and figures")
    made = {
        name: Made(part.tables(plan, results), part.figures(plan, results))
        for name, part in PARTS.items()
    }
    seconds = {"data": made_in, "study": time.perf_counter() - begun}
    summary = _summary(plan, seconds, len(tasks), left_out)
    found = sections(made, _run(summary), twin=_of_twin(plan))
    write_study(out, TITLE, _facts(summary), found, summary, force=force)
    return [table for section in found for table in section.tables]


def check_plan(plan: StudyPlan) -> None:
    """Does nothing where all methods can be compared.

    Raises:
        TrainingError: there are fewer fingers than a method for whole hands needs.
    """
    fingers = plan.main.fingers
    if len(fingers) < 2:
        raise TrainingError(
            f"{plan.main.folder}: one finger with labels of both classes given ({fingers[0]}); "
            "the study compares classifiers of whole hands, which need at least two"
        )


def _of_twin(plan: StudyPlan) -> bool:
    return plan.main.load()[0].metadata.get("source") == "twin"


def _summary(
    plan: StudyPlan, seconds: Mapping[str, float], n_tasks: int, left_out: Sequence[str]
) -> dict[str, Any]:
    """What `study.json` holds beside the tables."""
    return {
        "seed": plan.seed,
        "quick": plan.quick,
        "data": circumstances.data(plan),
        "versions": circumstances.versions(),
        "machine": circumstances.machine(),
        "seconds": {name: round(value, 1) for name, value in seconds.items()},
        "tasks": n_tasks,
        "left_out": list(left_out),
    }


def _facts(summary: Mapping[str, Any]) -> dict[str, object]:
    """The head of the report."""
    on = summary["machine"]
    memory = "" if on["memory"] is None else f", {on['memory']:g} GiB"
    return {
        "data": {role: _corpus_text(told) for role, told in summary["data"].items()},
        "seed": summary["seed"],
        "versions": ", ".join(
            f"{name} {number or 'not installed'}" for name, number in summary["versions"].items()
        ),
        "machine": f"{on['processor']}, {on['cores']} cores{memory}, {on['system']}",
        "time": ", ".join(
            f"{name} {_duration(value)}" for name, value in summary["seconds"].items() if value
        ),
    }


def _corpus_text(told: Mapping[str, Any]) -> str:
    return (
        f"{told['recordings']} recordings, {told['samples']:,} samples of a finger, "
        f"{told['rate']:.0f} Hz, {', '.join(told['fingers'])}; digest {told['digest'][:12]}"
    )


def _duration(seconds: float) -> str:
    """A time as people read it.

    Example:
        >>> _duration(42.3), _duration(1500)
        ('42 s', '25 min')
    """
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


ROLES = {
    "main": "what trains",
    "fresh": "the same objects, other seeds and another skin; never trains",
    "others": "objects that never train",
    "gentle": "a calmer profile of the twin",
    "vigorous": "a rougher profile of the twin",
    "real": "recordings of a real gripper",
}


def _run(summary: Mapping[str, Any]) -> list[str]:
    """What was run, in sentences."""
    lines = [
        f"{role}: {told['recordings']} recordings; {ROLES.get(role, 'others')}."
        for role, told in summary["data"].items()
    ]
    if summary["quick"]:
        lines.append(
            "A quick study: fewer recordings, windows, methods and trials than the full one. "
            "Its intervals are wide; quote the full one."
        )
    how = "kept results of a study that was stopped are not counted in the time"
    lines.append(f"{summary['tasks']} tasks with seed {summary['seed']}; {how}.")
    return [*lines, *(f"Left out: {each}" for each in summary["left_out"])]
