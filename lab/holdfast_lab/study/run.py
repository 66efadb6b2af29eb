"""A whole study: run the tasks of all parts, then write tables, figures and the report."""

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from holdfast.parallel import Engine
from holdfast_lab.report.environment import fact_texts, machine, versions
from holdfast_lab.report.folder import ReportKind, check_output_folder, write_report
from holdfast_lab.report.result_tables import ResultTable, to_json
from holdfast_lab.report.sections import ReportFigure
from holdfast_lab.study import environment
from holdfast_lab.study.comparison import all_methods, real_recordings, shipped, slip_table
from holdfast_lab.study.comparison.jobs import method_titles
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.paper import experiment_tables, experiments, paper_tables
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.study.sections import PartOutput, report_sections
from holdfast_lab.tasks import Notify, ShowProgress, Task, TaskRunner

STUDY = ReportKind("study", "study.json")
TITLE = "Slip and disturbance at the fingertips: the study"


Results = Mapping[str, Any]


class StudyPart(NamedTuple):
    """A part of the study.

    Attributes:
        tasks: function that returns what has to be computed.
        tables: function that returns the tables of the results.
        figures: function that returns the figures of the results.
    """

    tasks: Callable[[StudyPlan], list[Task]]
    tables: Callable[[StudyPlan, Results], list[ResultTable]] = lambda *_: []
    figures: Callable[[StudyPlan, Results], list[ReportFigure]] = lambda *_: []


PARTS = {
    "paper": StudyPart(paper_tables.tasks, paper_tables.tables, paper_tables.figures),
    "experiments": StudyPart(experiments.tasks, figures=experiments.figures),
    "experiment tables": StudyPart(experiment_tables.tasks, experiment_tables.tables),
    "comparison": StudyPart(all_methods.tasks, all_methods.tables, all_methods.figures),
    "slips": StudyPart(slip_table.tasks, slip_table.tables),
    "shipped": StudyPart(shipped.tasks, shipped.tables),
    "real": StudyPart(real_recordings.tasks, real_recordings.tables),
}
"""The parts of the study, by name."""
ONLY_FULL = ("slips", "shipped")
"""Those beyond the paper and the comparison. A quick study has them at a small size."""


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
    """Run a study and write it to a folder. The same plan gives the same tables.

    The result of each task is stored in `out/work`. A study that was stopped therefore continues
    where it stopped, and a repeated study is finished at once.

    Args:
        plan: of the study.
        out: the folder; it may hold `work` and `data`.
        engine: that runs the tasks.
        progress: that passes on the finished tasks.
        notify: that is called with messages for the user.
        force: replace a study in `out`, except `work` and `data`.
        made_in: time that was needed to make the data [s].
        left_out: sentences on what a reader would expect and does not find.

    Returns:
        All tables, in the order of the report.

    Raises:
        OutputError: as `check_output_folder`.
        TrainingError: the data are not enough to train a method.
        EngineError: as `TaskRunner.run`.
    """
    # First, so that hours of work are not lost to a folder that is refused.
    check_output_folder(out, STUDY, force=force)
    start = time.perf_counter()
    skipped = () if plan.full or plan.quick else ONLY_FULL
    parts = {name: part for name, part in PARTS.items() if name not in skipped}
    tasks = {name: part.tasks(plan) for name, part in parts.items()}
    runner = TaskRunner(Path(out), engine, progress, notify)
    results = runner.run([task for of_part in tasks.values() for task in of_part])
    notify("making tables and figures")
    outputs = {
        name: PartOutput(part.tables(plan, results), part.figures(plan, results))
        for name, part in parts.items()
    }
    seconds = {"data": made_in, "study": time.perf_counter() - start}
    # The contents of `study.json`, except the tables.
    summary = {
        "seed": plan.seed,
        "quick": plan.quick,
        "full": plan.full,
        "data": environment.data(plan),
        "versions": versions(),
        "machine": machine(),
        "seconds": {name: round(value, 1) for name, value in seconds.items()},
        "tasks": len(results),
        "processor_minutes": {
            name: round(runner.seconds(of_part) / 60, 1) for name, of_part in tasks.items()
        },
        "left_out": [*left_out, *whole_hand_note(plan), *full_note(skipped)],
    }
    sources = [f"{title}: {METHODS[name].source}." for name, title in method_titles(plan).items()]
    notes = environment.run_notes(summary)
    sections = report_sections(outputs, notes, sources, twin=plan.main.is_simulated)
    # Those of the sections, because they carry the note on the twin.
    tables = [table for section in sections for table in section.tables]
    document = {"tables": {table.name: to_json(table) for table in tables}, **summary}
    write_report(out, STUDY, TITLE, fact_texts(summary), sections, document, force=force)
    return tables


def whole_hand_note(plan: StudyPlan) -> list[str]:
    """Return a sentence on the methods that a study of one finger leaves out, else nothing."""
    if len(plan.main.fingers) > 1:
        return []
    titles = ", ".join(method.title for method in METHODS.values() if method.whole_hand)
    return [f"{titles}, because only the {plan.main.fingers[0]} has labels of both classes."]


def full_note(skipped: Sequence[str]) -> list[str]:
    """Return a sentence on the parts that only a full study has, else nothing."""
    return [f"{', '.join(skipped)}: give --full."] if skipped else []
