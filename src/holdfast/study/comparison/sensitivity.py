"""Part of the study: what happens when one thing is changed.

Noise on the readings, the margin of labels, the sampling rate, the profile of the twin; and
whether the paper's sigma stands noise better than an energy does.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from holdfast.metrics.events import POSTS
from holdfast.plots.curves import Curve, draw_lines
from holdfast.study.comparison.jobs import CORE, SPLITS, Results, effort_of, job_of, judging
from holdfast.study.comparison.rows import DIGITS, difference_row, ratio_row, sample_rows
from holdfast.study.evaluation.evaluate_method import COMPARED_RATE, EvaluationJob, MethodEvaluation
from holdfast.study.evaluation.variation import Variation
from holdfast.study.methods import METHODS
from holdfast.study.methods.cuts import CUTS
from holdfast.study.plan import StudyPlan
from holdfast.study.report.html_report import ReportFigure
from holdfast.study.report.result_tables import Key, ResultTable, Row
from holdfast.study.tasks import Task
from holdfast.twin.labels import LabelRule

SHOWN = ("logreg", "zhang", "trees", "holdfast")
LEVELS = (0.0, 1.0, 2.0, 4.0, 8.0)
"""Of noise [unit of the readings]."""
EVERY = (1, 2, 3, 5)
MARGINS = (0.0, 0.05, LabelRule().margin, 0.2)
"""Of labels [s]; they are drawn with the rule's."""
SLOW = ("trees",)
"""Methods for which every other change is enough."""
SAMPLE = ("accuracy [%]", "FDR [%]", "AUC contact")
FOUND = f"slips found within {1000 * POSTS[0]:.0f} ms [%]"
IN_VAIN = "in vain under stable label, per minute"
PROFILES = ("recording", "gentle", "vigorous")
LESS = "accuracy less sigma's [points]"

Keys = dict[str, Key]


class Sweep(NamedTuple):
    """One thing that is changed.

    Attributes:
        name: of its table and figure.
        title: of both.
        key: what is changed, with its unit.
        changes: by value.
        note: how.
    """

    name: str
    title: str
    key: str
    changes: Mapping[float, Variation]
    note: str


def tasks(plan: StudyPlan) -> list[Task]:
    """What is judged under each change; what is judged without any is the comparison's."""
    named: dict[str, Task] = {}
    for sweep in sweeps(plan):
        for method in methods(plan):
            for change in _changes(sweep, method).values():
                task = _task(plan, method, change)
                named[task.name] = task
    for cut in CUTS:
        for change in _noise(plan).values():
            task = _task(plan, cut, change)
            named[task.name] = task
    return list(named.values())


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """A table for each thing that is changed, the profiles, and sigma beside energy."""
    made = [_table(plan, results, sweep) for sweep in sweeps(plan)]
    return [*made, _profiles(plan, results), _sigma_energy(plan, results)]


def figures(plan: StudyPlan, results: Results) -> list[ReportFigure]:
    """The same as curves."""
    drawn = [
        _picture(_table(plan, results, sweep), sweep, ("accuracy [%]", "AUC contact", FOUND))
        for sweep in sweeps(plan)
    ]
    sweep = Sweep("sigma_energy", "Sigma beside energy", NOISE, _noise(plan), "")
    figures = ("accuracy [%]", "AUC contact")
    return [*drawn, _picture(_sigma_energy(plan, results), sweep, figures)]


def methods(plan: StudyPlan) -> list[str]:
    """The methods that are shown."""
    return [name for name in (CORE if plan.quick else SHOWN) if name in METHODS]


NOISE = "noise"
MARGIN = "margin [s]"
RATE = "rate [Hz]"


def sweeps(plan: StudyPlan) -> list[Sweep]:
    """What is changed, one by one; the margin only where the truth tells the labels."""
    unit = plan.main.load()[0].modules[plan.main.fingers[0]].unit
    found = [
        Sweep(
            "noise",
            "Sensitivity to noise",
            NOISE,
            _noise(plan),
            f"Standard deviation of white noise added to every reading [{unit}], in training and "
            "in test; the twin's own noise is in the readings already.",
        ),
        Sweep(
            "rates",
            "Sensitivity to the sampling rate",
            RATE,
            {round(plan.main.rate / every, 1): Variation(every=every) for every in _every(plan)},
            "Every 1st, 2nd, ... sample, in training and in test. Windows keep their number of "
            "samples, so that they last longer.",
        ),
    ]
    if margins := _margins(plan):
        found.insert(
            1,
            Sweep(
                "margins",
                "Sensitivity to the margin of labels",
                MARGIN,
                margins,
                "By so much labels draw every disturbance longer at both ends, in training and "
                "in the figures by sample; slips and alarms are counted by labels without any.",
            ),
        )
    return found


def _noise(plan: StudyPlan) -> dict[float, Variation]:
    return {level: Variation(noise=level) for level in (_ends(LEVELS) if plan.quick else LEVELS)}


def _every(plan: StudyPlan) -> tuple[int, ...]:
    return (1, 3) if plan.quick else EVERY


def _margins(plan: StudyPlan) -> dict[float, Variation]:
    """By margin; the labels as they are have that of the rule. None without a truth."""
    truth = plan.main.load()[0].truth
    if truth is None or "phase" not in truth.hand:
        return {}
    usual = LabelRule().margin
    margins = (0.0, usual) if plan.quick else MARGINS
    return {each: Variation() if each == usual else Variation(margin=each) for each in margins}


def _ends(values: Sequence[float]) -> tuple[float, float]:
    return values[0], values[-1]


def _changes(sweep: Sweep, method: str) -> dict[float, Variation]:
    """The changes that a method is judged under: a slow one under every other."""
    every = list(sweep.changes.items())
    kept = every if method not in SLOW else every[:: 2 if len(every) > 2 else 1]
    plain = [(value, change) for value, change in every if change == Variation()]
    return dict(sorted({**dict(kept), **dict(plain)}.items()))


def _task(plan: StudyPlan, method: str, change: Variation) -> Task:
    job = _job(plan, method, change)
    return judging(_name(method, change), job, quick=plan.quick)


def _name(method: str, change: Variation) -> str:
    margin = "" if change.margin is None else f"/margin-{change.margin:g}"
    return f"sensitivity/{method}/noise-{change.noise:g}/every-{change.every}{margin}"


def _job(plan: StudyPlan, method: str, change: Variation) -> EvaluationJob:
    """Unchanged it is the job of the comparison, which is so done once."""
    if method in METHODS and change == Variation():
        return job_of(plan, method)
    effort = effort_of(plan, method)
    return EvaluationJob(method, plan.main, ("recording",), (), change, effort, plan.seed)


def _table(plan: StudyPlan, results: Results, sweep: Sweep) -> ResultTable:
    rows: list[Row] = []
    for method in methods(plan):
        for value, change in _changes(sweep, method).items():
            judged: MethodEvaluation = results[_name(method, change)]["recording"]
            keys: Keys = {"method": METHODS[method].title, sweep.key: value}
            rows += _figures(keys, judged, plan.seed)
    lines = ("method", sweep.key)
    return ResultTable(
        sweep.name, sweep.title, f"{sweep.note} {_NOTE}", rows, lines, digits_of=DIGITS
    )


_NOTE = (
    f"By recording. Slips and alarms in vain: at the threshold for {COMPARED_RATE:g} false alarm "
    "per minute under a stable label in training, chosen anew each time."
)


def _profiles(plan: StudyPlan, results: Results) -> ResultTable:
    rows: list[Row] = []
    for method in methods(plan):
        judged = results[_name(method, Variation())]
        for key in PROFILES:
            name = plan.corpora[key].name if key in plan.corpora else key
            if name in judged:
                on = "same profile, by recording" if key == "recording" else SPLITS[key]
                keys: Keys = {"method": METHODS[method].title, "on": on}
                rows += _figures(keys, judged[name], plan.seed)
    note = (
        "Fitted to main, judged where the hand grips and the operator pushes otherwise, without "
        "anything fitted anew; slips and alarms at the threshold chosen on main."
    )
    title = "Sensitivity to the profile"
    return ResultTable("profiles", title, note, rows, ("method", "on"), digits_of=DIGITS)


def _sigma_energy(plan: StudyPlan, results: Results) -> ResultTable:
    rows: list[Row] = []
    for value, change in _noise(plan).items():
        first = results[_name("sigma_cut", change)]["recording"].metrics
        for name, cut in CUTS.items():
            metrics = results[_name(name, change)]["recording"].metrics
            keys: Keys = {NOISE: value, "measure": cut.title}
            rows += sample_rows(keys, metrics, ("accuracy [%]", "AUC", "AUC contact"))
            if name != "sigma_cut":
                rows.append(difference_row(keys | {"figure": LESS}, metrics, first, plan.seed))
    note = (
        "One feature and one cut, the one with the best balanced accuracy in training, by "
        "recording. Sigma: the standard deviation of the Haar details; energy: their sum of "
        "squares; of the same window of 14 samples of the same signal, so that they differ by "
        "the mean of the details alone; on a log scale, which moves no cut. AUC contact: "
        "stable against unstable, which no cut and no contact threshold touches. The "
        "difference is paired."
    )
    lines = (NOISE, "measure")
    title = "Sigma beside energy as noise grows"
    return ResultTable("sigma_energy", title, note, rows, lines, digits_of=DIGITS)


def _figures(keys: Keys, judged: MethodEvaluation, seed: int) -> Iterator[Row]:
    yield from sample_rows(keys, judged.metrics, SAMPLE)
    heard = judged.calm
    slips = [len(each.slips) for each in heard]
    if sum(slips):
        about = keys | {"figure": FOUND}
        yield ratio_row(about, [each.n_found(POSTS[0]) for each in heard], slips, seed)
    minutes = [each.stable_seconds / 60 for each in heard]
    about = keys | {"figure": IN_VAIN}
    yield ratio_row(about, [each.under_stable for each in heard], minutes, seed, scale=1.0)


def _picture(table: ResultTable, sweep: Sweep, figures: Sequence[str]) -> ReportFigure:
    head = table.lines[0] if table.lines[0] != sweep.key else table.lines[1]
    groups: dict[str, dict[str, Curve]] = {}
    for figure in figures:
        rows = [row for row in table.rows if row.keys["figure"] == figure]
        names = dict.fromkeys(str(row.keys[head]) for row in rows)
        curves = {n: _curve([r for r in rows if r.keys[head] == n], sweep.key) for n in names}
        if curves:
            groups[figure] = curves
    caption = f"{table.title}. Bands: 95 % intervals, by bootstrap over recordings."
    return ReportFigure(f"{sweep.name}_curves", caption, draw_lines(groups, sweep.key))


def _curve(rows: Sequence[Row], key: str) -> Curve:
    rows = sorted(rows, key=lambda row: float(row.keys[key]))
    ends = [row.interval or (None, None) for row in rows]
    x, y, low, high = (
        np.array([np.nan if each is None else float(each) for each in values])
        for values in (
            [float(row.keys[key]) for row in rows],
            [row.ours for row in rows],
            [low for low, _ in ends],
            [high for _, high in ends],
        )
    )
    return Curve(x, y, low, high)
