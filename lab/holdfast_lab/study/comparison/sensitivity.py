"""Part of the study: results when one condition is varied.

The conditions are noise on the readings and the sampling rate. One more table compares how noise
affects the paper's sigma and an energy.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from holdfast_lab.figures.curves import PlottedCurve, draw_lines
from holdfast_lab.report.html_report import ReportFigure
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.event_tables import FALSE_ALARMS_UNDER_STABLE
from holdfast_lab.study.comparison.jobs import (
    Results,
    evaluation_task,
    method_effort,
    method_job,
)
from holdfast_lab.study.comparison.rows import (
    DIGITS,
    curve_of,
    difference_row,
    ratio_row,
    sample_rows,
)
from holdfast_lab.study.evaluation.evaluate_method import (
    COMPARED,
    COMPARED_RATE,
    EvaluationJob,
    MethodEvaluation,
)
from holdfast_lab.study.evaluation.recording_features import Variation
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.methods.wavelets import CUTS
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.tasks import Task

VARIED_METHODS = ("logreg", "zhang", "holdfast")
QUICK_VARIED_METHODS = ("logreg", "holdfast")
"""Those of them that a quick study varies."""
NOISE_LEVELS = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Standard deviations of the added noise [unit of the readings]."""
SAMPLE_STEPS = (1, 2, 3, 5)
"""Numbers n of which every n-th sample is kept."""

NOISE_NAME = "noise"
RATE_NAME = "rate [Hz]"
SAMPLE_FIGURES = ("accuracy [%]", "FDR [%]", "AUC contact")
SIGMA_DIFFERENCE = "accuracy less sigma's [points]"
CURVES = ("accuracy [%]", "AUC contact", FALSE_ALARMS_UNDER_STABLE)
"""Figures of the tables that are drawn as curves."""
NOTE = (
    "By recording. False alarms: at the threshold for "
    f"{COMPARED_RATE:g} false alarm per minute under a stable label in training, chosen for each "
    "value separately. A glitch of the controller is an event."
)

Keys = dict[str, Key]


class Sweep(NamedTuple):
    """One condition and its values.

    Attributes:
        name: of its table and figure.
        title: of both.
        key: name of the condition in the table, with its unit.
        variations: by value.
        note: how the condition is varied.
    """

    name: str
    title: str
    key: str
    variations: Mapping[float, Variation]
    note: str


def tasks(plan: StudyPlan) -> list[Task]:
    """Return an evaluation task for each method, condition and value.

    Without a variation the task is that of the comparison of methods.
    """
    # By name, because the conditions share the task without a variation.
    named: dict[str, Task] = {}
    for sweep in sweeps(plan):
        for method in varied_methods(plan):
            for variation in sweep.variations.values():
                task = _task(plan, method, variation)
                named[task.name] = task
    for cut in CUTS:
        for variation in _noise(plan).values():
            task = _task(plan, cut, variation)
            named[task.name] = task
    return list(named.values())


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """Return a table for each condition, and for sigma against energy."""
    swept = [sweep_table(plan, results, sweep) for sweep in sweeps(plan)]
    return [*swept, sigma_energy_table(plan, results)]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """Return the tables of the conditions as curves."""
    swept = [_draw(sweep_table(plan, results, each), each, CURVES) for each in sweeps(plan)]
    sweep = Sweep("sigma_energy", "Sigma beside energy", NOISE_NAME, _noise(plan), "")
    sigma_energy = _draw(sigma_energy_table(plan, results), sweep, CURVES[:2])
    return [*swept, sigma_energy]


def varied_methods(plan: StudyPlan) -> list[str]:
    """Return the names of the methods that are evaluated under variations."""
    names = QUICK_VARIED_METHODS if plan.quick else VARIED_METHODS
    return [name for name in names if name in METHODS]


def sweeps(plan: StudyPlan) -> list[Sweep]:
    """Return the conditions that are varied."""
    first = plan.main.load()[0]
    unit = first.modules[plan.main.fingers[0]].unit
    noise = Sweep(
        "noise",
        "Sensitivity to noise",
        NOISE_NAME,
        _noise(plan),
        f"Standard deviation of white noise added to every reading [{unit}], in training and "
        "in test; the readings already contain the noise of the twin.",
    )
    rates = Sweep(
        "rates",
        "Sensitivity to the sampling rate",
        RATE_NAME,
        {
            round(plan.main.rate / step, 1): Variation(every=step)
            for step in ((1, 3) if plan.quick else SAMPLE_STEPS)
        },
        "Every 1st, 2nd, ... sample, in training and in test. Windows keep their number of "
        "samples, so they last longer.",
    )
    return [noise, rates]


def _noise(plan: StudyPlan) -> dict[float, Variation]:
    levels = (NOISE_LEVELS[0], NOISE_LEVELS[-1]) if plan.quick else NOISE_LEVELS
    return {level: Variation(noise=level) for level in levels}


def _task(plan: StudyPlan, method: str, variation: Variation) -> Task:
    if method in METHODS and variation == Variation():
        job = method_job(plan, method)  # as in the comparison: equal jobs are done once
    else:
        effort = method_effort(plan, method)
        compared = tuple(varied_methods(plan)) if method in METHODS else tuple(CUTS)
        job = EvaluationJob(
            method, plan.main, ("recording",), (), variation, effort, plan.seed, compared
        )
    return evaluation_task(_task_name(method, variation), job, quick=plan.quick)


def _task_name(method: str, variation: Variation) -> str:
    return f"sensitivity/{method}/noise-{variation.noise:g}/every-{variation.every}"


def sweep_table(plan: StudyPlan, results: Results, sweep: Sweep) -> ResultTable:
    """Return the table of one condition, with a line for each method and value."""
    rows: list[Row] = []
    for method in varied_methods(plan):
        for value, variation in sorted(sweep.variations.items()):
            evaluation = results[_task_name(method, variation)]["recording"]
            keys: Keys = {"method": METHODS[method].title, sweep.key: value}
            rows += _rows(keys, evaluation, plan.seed)
    lines = ("method", sweep.key)
    return ResultTable(
        sweep.name, sweep.title, f"{sweep.note} {NOTE}", rows, lines, digits_of=DIGITS
    )


def sigma_energy_table(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of sigma and energies as noise grows."""
    rows: list[Row] = []
    for value, variation in _noise(plan).items():
        first = results[_task_name("sigma_cut", variation)]["recording"].metrics
        for name, cut in CUTS.items():
            metrics = results[_task_name(name, variation)]["recording"].metrics
            keys: Keys = {NOISE_NAME: value, "measure": cut.title}
            rows += sample_rows(keys, metrics, ("accuracy [%]", "AUC", "AUC contact"))
            if name != "sigma_cut":
                figure = keys | {"figure": SIGMA_DIFFERENCE}
                rows.append(difference_row(figure, metrics, first, plan.seed))
    note = (
        "One feature and one threshold, the one with the best balanced accuracy in training, by "
        "recording. Sigma: the standard deviation of the Haar details; energy: the sum of their "
        "squares. Both are of the same window of 14 samples of the same signal, so they differ "
        "only by the mean of the details. Both are on a logarithmic scale, which changes no "
        "threshold. AUC contact: stable against unstable, which depends on no threshold. The "
        "difference is paired."
    )
    lines = (NOISE_NAME, "measure")
    title = "Sigma beside energy as noise grows"
    return ResultTable("sigma_energy", title, note, rows, lines, digits_of=DIGITS)


def _rows(keys: Keys, evaluation: MethodEvaluation, seed: int) -> Iterator[Row]:
    yield from sample_rows(keys, evaluation.metrics, SAMPLE_FIGURES)
    alarms = evaluation.alarms[COMPARED]
    minutes = [alarm.stable_seconds / 60 for alarm in alarms]
    n_false = [alarm.n_under_stable for alarm in alarms]
    figure = keys | {"figure": FALSE_ALARMS_UNDER_STABLE}
    yield ratio_row(figure, n_false, minutes, seed, scale=1.0)


def _draw(table: ResultTable, sweep: Sweep, columns: Sequence[str]) -> ReportFigure:
    """Draw columns of a table over the values of a condition, one curve for each other key."""
    head = table.lines[0] if table.lines[0] != sweep.key else table.lines[1]
    groups: dict[str, dict[str, PlottedCurve]] = {}
    for column in columns:
        rows = [row for row in table.rows if row.keys["figure"] == column]
        names = dict.fromkeys(str(row.keys[head]) for row in rows)
        curves = {}
        for name in names:
            own = [row for row in rows if row.keys[head] == name]
            curves[name] = curve_of(own, sweep.key)
        if curves:
            groups[column] = curves
    caption = f"{table.title}. Bands: 95 % intervals, by bootstrap over recordings."
    return ReportFigure(f"{sweep.name}_curves", caption, draw_lines(groups, sweep.key))
