"""Part of the study: all methods, and the model that ships, on recordings of a real hand.

Every method is trained on the other recordings: one recording is left out at a time. The model
that ships, `builtin:any`, is evaluated as it is, and adapted to the other recordings.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from holdfast_interop.importers import uskin_pick_move
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import Results, method_titles
from holdfast_lab.study.comparison.real_counts import (
    AUC,
    COUNT_DIGITS,
    MIN_RECORDINGS,
    MISSED_AFTER,
    RecordingCounts,
    auc_row,
    count_pairs,
    count_recordings,
    mean_auc_row,
    pair_rows,
    recording_rows,
)
from holdfast_lab.study.comparison.real_estimates import (
    MAX_REAL_FOLDS,
    RecordingEstimates,
    RecordingLabels,
    method_estimates,
    recording_labels,
)
from holdfast_lab.study.comparison.real_models import SHIPPED, Making, model_estimates
from holdfast_lab.study.evaluation.evaluate_method import HOLD_TIME
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

QUICK_REAL_METHODS = ("logreg", "holdfast", "zhang", "spectrum", "difference", "anyskin")
"""Methods of a quick study: one or two of each kind."""
STABLE_SAMPLES, SLIP_SAMPLES = "stable samples", "slip samples"
UNTOUCHED: Making = "untouched"
LABELS = "real/labels"
"""Name of the task that reads the labels."""


class Line(NamedTuple):
    """A method, or the model that ships, as one line of the tables.

    Attributes:
        method: title of the method, or name of the model.
        trained_on: what its training used; "the others" are all other real recordings.
    """

    method: str
    trained_on: str


THE_OTHERS = "the others"
MODELS: Mapping[Making, Line] = {
    "untouched": Line(SHIPPED, "the twin"),
    "adapted to one": Line(SHIPPED, "the twin, 1 other"),
    "adapted to all": Line(SHIPPED, "the twin, the others"),
    "from nothing": Line(f"features of {SHIPPED}", THE_OTHERS),
}
"""Lines of the model that ships."""

MEANING = f"""\
One recording is left out at a time (with more than {MAX_REAL_FOLDS}, several); methods
are trained on the others. {SHIPPED}, trained on the twin only, is shown as it ships, and adapted
to one or all of the others. All lines are scored on the same samples: those at which every line
has an estimate of every finger. A line without any estimate in a recording is left out there.
"Without estimate" is the share of all labelled samples at which the line itself has none. AUC:
stable against slip, samples of all fingers pooled (of the hand, for whole-hand methods); 0.5 is
chance. It pools the probabilities of all folds and fingers, so it also depends on whether their
scales agree; the mean AUC, over the recordings with slip, does not depend on the folds. Missed
slips: of the slips that begin after 0.5 s of stable, those without an alarm {MISSED_AFTER:g} s
after the onset. False alarms: under a stable label, per minute of it. Both are of the hand, at
each line's own threshold. {SHIPPED} brings its features, tare, contact threshold and hold time;
decisions of the methods are held for {HOLD_TIME:g} s. It is adapted by "holdfast train --init",
and stays as it ships where the others lack a class. Intervals: from {MIN_RECORDINGS} recordings
on.""".replace("\n", " ")
BY_RECORDING = "The figures of the table of pooled recordings, by recording."
BY_FINGER = (
    "Stable against slip, by finger, on the same samples; recordings with both classes only."
)
PAIRS = (
    f"AUC of stable against slip of each line, and of {SHIPPED} as it ships, on the samples at "
    "which these two have an estimate. So a third method that needs a long history takes no "
    f"samples away. Difference: {SHIPPED} minus the line; the interval is paired."
)
BOX_CAVEAT = (
    "These are recordings of one box, held by two flat patches of a gripper. In the recordings "
    "with slip the arm also moves faster, so slip and speed cannot be distinguished. The object "
    "is already held when the recordings begin: there is no interval without contact, and the "
    "first sample is the tare. 6 to 9 % of the samples repeat the sample before. Labels are slip, "
    "measured by a marker, and rest. No value here is the accuracy on real data."
)


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for the labels and for each line; none without real recordings."""
    if plan.real is None:
        return []
    read = Task(LABELS, recording_labels, (plan.real,), list[RecordingLabels])
    result = list[RecordingEstimates]
    models = [
        Task(_task_name(making), model_estimates, (making, plan.real, plan.seed), result, cost=10.0)
        for making in MODELS
    ]
    methods = [
        Task(_task_name(name), method_estimates, (name, plan.real, plan.seed), result, cost=5.0)
        for name in real_methods(plan, plan.real)
    ]
    return [read, *models, *methods]


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """Return the tables: pooled, by recording, by finger; none without real recordings."""
    if plan.real is None:
        return []
    # The lines of the tables, by name of the making or of the method.
    methods = real_methods(plan, plan.real).items()
    models = {str(making): line for making, line in MODELS.items()}
    lines = models | {name: Line(title, THE_OTHERS) for name, title in methods}
    estimates = {name: results[_task_name(name)] for name in lines}
    counts = count_recordings(results[LABELS], estimates)
    by_line = {lines[name]: counts_of_line for name, counts_of_line in counts.items()}
    source = plan.real.load()[0].metadata.get("source")
    note = f"{MEANING} {BOX_CAVEAT}" if source == uskin_pick_move.SOURCE else MEANING
    rows: list[Row] = []
    for line, of_line in by_line.items():
        rows.append(mean_auc_row(_keys(line), of_line, plan.seed))
        rows += recording_rows(_keys(line), of_line, plan.seed)
    heads = ("method", "trained on")
    title = "Real recordings, pooled"
    return [
        ResultTable("real", title, note, rows, heads, digits_of=COUNT_DIGITS),
        recording_table(by_line, plan.seed),
        finger_auc_table(by_line, plan.seed),
        pair_table(lines, results[LABELS], estimates, plan.seed),
    ]


def real_methods(plan: StudyPlan, real: Corpus) -> dict[str, str]:
    """Return the titles of the methods that are trained on real recordings, by name."""
    one_finger = len(real.fingers) < 2
    return {
        name: title
        for name, title in method_titles(plan).items()
        if not (METHODS[name].whole_hand and one_finger)
        and not (plan.quick and name not in QUICK_REAL_METHODS)
    }


def recording_table(by_line: Mapping[Line, Sequence[RecordingCounts]], seed: int) -> ResultTable:
    """Return the table of the figures of each recording."""
    rows = [
        row
        for line, counts in _each_recording(by_line)
        for row in recording_rows({"recording": counts.name} | _keys(line), [counts], seed)
    ]
    lines = ("recording", "method", "trained on")
    title = "Real recordings, one by one"
    return ResultTable("real_recordings", title, BY_RECORDING, rows, lines, digits_of=COUNT_DIGITS)


def finger_auc_table(by_line: Mapping[Line, Sequence[RecordingCounts]], seed: int) -> ResultTable:
    """Return the table of the AUC of each finger in each recording."""
    rows: list[Row] = []
    for line, counts in _each_recording(by_line):
        for finger, unit in counts.fingers.items():
            keys = {"recording": counts.name, "finger": finger} | _keys(line)
            if unit.scores.auc is not None:
                rows.append(auc_row({**keys, "figure": AUC}, [unit.scores], seed))
                rows.append(Row({**keys, "figure": STABLE_SAMPLES}, len(unit.scores.stable)))
                rows.append(Row({**keys, "figure": SLIP_SAMPLES}, len(unit.scores.slip)))
    rows.sort(key=lambda row: (str(row.keys["recording"]), str(row.keys["finger"])))
    lines = ("recording", "finger", "method", "trained on")
    digits = {AUC: 2, STABLE_SAMPLES: 0, SLIP_SAMPLES: 0}
    title = "Real recordings, finger by finger"
    return ResultTable("real_fingers", title, BY_FINGER, rows, lines, digits_of=digits)


def pair_table(
    lines: Mapping[str, Line],
    labels: Sequence[RecordingLabels],
    estimates: Mapping[str, Sequence[RecordingEstimates]],
    seed: int,
) -> ResultTable:
    """Return the table of the model that ships beside each other line."""
    rows: list[Row] = []
    for name, line in lines.items():
        if name != UNTOUCHED:
            pairs = count_pairs(labels, estimates[UNTOUCHED], estimates[name])
            rows += pair_rows({"recording": "all"} | _keys(line), pairs, seed)
            for pair in pairs:
                if pair.first.auc is not None:
                    rows += pair_rows({"recording": pair.name} | _keys(line), [pair], seed)
    heads = ("recording", "method", "trained on")
    title = "Real recordings, pair by pair"
    return ResultTable("real_pairs", title, PAIRS, rows, heads, digits=2)


def _each_recording(
    by_line: Mapping[Line, Sequence[RecordingCounts]],
) -> Iterator[tuple[Line, RecordingCounts]]:
    """Yield all lines of the first labelled recording, then those of the next."""
    for counts in zip(*by_line.values(), strict=True):
        if any(unit.n_labelled for count in counts for unit in count.units):
            yield from zip(by_line, counts, strict=True)


def _keys(line: Line) -> dict[str, Key]:
    return {"method": line.method, "trained on": line.trained_on}


def _task_name(line: str) -> str:
    return f"real/{line}"
