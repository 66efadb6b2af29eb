"""A whole comparison of laws: run the trials, then write tables, figures and the report."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from holdfast.parallel import Engine
from holdfast_lab.report.environment import fact_texts, machine, versions
from holdfast_lab.report.folder import ReportKind, check_output_folder, write_report
from holdfast_lab.report.sections import Section
from holdfast_lab.tasks import Notify, ShowProgress, TaskRunner
from holdfast_lab.trial.course import TrialCourse
from holdfast_lab.trial.document import (
    BASELINE_LAW,
    OWN_LAW,
    TrialResults,
    document_of,
    example_of,
    trials_csv,
)
from holdfast_lab.trial.figures import (
    course_figure,
    distribution_figure,
    kinds_figure,
    trade_off_figure,
)
from holdfast_lab.trial.law_tables import (
    fingers_table,
    kinds_table,
    law_tables,
    objects_table,
    paired_table,
)
from holdfast_lab.trial.plan import TrialPlan
from holdfast_lab.trial.trials import draw_trial

COMPARISON = ReportKind("comparison of grip laws", "trial.json", ("trials.csv",))
"""Content of the folder of a comparison."""
TRIAL_TITLE = "Grip laws against each other on the twin"
WHAT_NUMBERS_MEAN = (
    "Results of a simulation: docs/study/grip.md says what each number means, docs/twin.md what "
    "the twin cannot show."
)
RULE = f"It is the first of the set that {BASELINE_LAW} loses and {OWN_LAW} holds."
"""How the trial that is shown is chosen."""


class Example(NamedTuple):
    """The trial that is shown.

    Attributes:
        what: sentence that describes the trial.
        courses: its course by law.
    """

    what: str
    courses: Mapping[str, TrialCourse]


def run_trials(
    plan: TrialPlan,
    out: str | Path,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
    *,
    progress: ShowProgress = lambda items, *_: iter(items),
    notify: Notify = lambda _: None,
    force: bool = False,
) -> dict[str, Any]:
    """Run all trials with all laws and write them to a folder.

    The result of each trial is stored in `out/work`. A comparison that was stopped therefore
    continues where it stopped, and with one law more, only the trials with that law are run.

    Args:
        plan: of the comparison.
        out: the folder; it may hold `work`.
        engine: that runs the trials.
        progress: that passes on the finished trials.
        notify: that is called with messages for the user.
        force: replace a comparison in `out`, except `work`.

    Returns:
        The contents of `trial.json`.

    Raises:
        OutputError: as `check_output_folder`.
        EngineError: as `TaskRunner.run`.
    """
    check_output_folder(out, COMPARISON, force=force)
    start = time.perf_counter()
    runner = TaskRunner(Path(out), engine, progress, notify)
    # All laws of a trial follow one another: a process computes the least forces of a trial once.
    tasks = {law: [plan.trial_task(number, law) for number in range(plan.n)] for law in plan.laws}
    by_number = (task for same in zip(*tasks.values(), strict=True) for task in same)
    done = runner.run(list(by_number))
    results = {
        law: [done[task.name] for task in tasks_of_law] for law, tasks_of_law in tasks.items()
    }
    number = example_of(results)
    example = None if number is None else _example(plan, number, runner)
    seconds = {"trials": round(time.perf_counter() - start, 1)}
    notify("making tables and figures")
    document = document_of(plan, results, number)
    document |= {"versions": versions(), "machine": machine(), "seconds": seconds}
    sections = report_sections(document, results, example)
    others = {"trials.csv": trials_csv(results).encode()}
    write_report(
        out,
        COMPARISON,
        TRIAL_TITLE,
        {
            "trials": f"{document['n_trials']} with each of {len(document['laws'])} laws",
            "plant": document["plant"]["name"],
            "model": f"{document['model']}, digest {document['model_digest'][:12]}",
            **fact_texts(document),
        },
        sections,
        document,
        others=others,
        force=force,
    )
    return document


def _example(plan: TrialPlan, number: int, runner: TaskRunner) -> Example:
    """Return the courses of a trial."""
    laws = (BASELINE_LAW, OWN_LAW)
    tasks = {law: plan.course_task(number, law) for law in laws}
    done = runner.run(list(tasks.values()))
    courses = {law: done[task.name] for law, task in tasks.items()}
    trial = draw_trial(number, plan.seed, plan.plant, plan.n_impacts)
    lost_at = courses[BASELINE_LAW].lost_at
    when = "" if lost_at is None else f"; {BASELINE_LAW} loses it {lost_at:.2f} s later"
    what = (
        f"Trial {number}: {trial.grasp.object}, {trial.n_fingers} fingers, load "
        f"{trial.load.kind.value}{when}."
    )
    return Example(what, courses)


def report_sections(
    document: Mapping[str, Any], results: TrialResults, example: Example | None
) -> list[Section]:
    """Return the sections of the report.

    Args:
        document: contents of `trial.json`.
        results: of all trials, by law.
        example: the trial that is shown, if there is one.
    """
    shown = Section("One trial, lost and saved", f"There is no such trial. {RULE}")
    if example is not None:
        figure = course_figure(example.courses, example.what)
        shown = Section(shown.title, f"{example.what} {RULE}", [], [figure])
    paired = [paired_table(document, other) for other in document["paired"]]
    return [
        Section("All laws", WHAT_NUMBERS_MEAN, law_tables(document), [trade_off_figure(document)]),
        Section("In pairs", "", [table for table in paired if table.rows]),
        Section("Slip and reaction", "", [], [distribution_figure(results)]),
        Section(
            "Kinds of load, objects and fingers",
            "",
            [kinds_table(document), objects_table(document), fingers_table(document)],
            [kinds_figure(document)],
        ),
        shown,
    ]
