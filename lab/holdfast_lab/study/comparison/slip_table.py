"""Part of the study: the slip of single fingers, decided by each method and scored by the truth."""

from collections.abc import Iterable

import msgspec

from holdfast.metrics.slip_truth import DISTANCES
from holdfast.metrics.slips import (
    EARLIEST_ALARM,
    FALSE_ALARM_DURATION,
    FOUND_WITHIN,
    LATEST_ALARM,
    SlipMetrics,
)
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import SPLIT_TITLES, Results, method_effort
from holdfast_lab.study.comparison.rows import RowKeys
from holdfast_lab.study.evaluation.evaluate_method import EvaluationJob
from holdfast_lab.study.evaluation.evaluate_slips import (
    SLIP_RATE,
    SlipEvaluation,
    evaluate_slips,
)
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
from holdfast_lab.study.plan import StudyPlan
from holdfast_lab.tasks import Task

QUICK_SLIP_METHODS = ("holdfast", "holdfast_stability", "slip_servo", "jl_local_logreg", "anyskin",
                      "always_stable")  # fmt: skip
"""Methods of a quick study."""
TESTED_ROLES = ("others", "fresh")
"""Roles of the corpora on which the methods are tested, where they exist."""
TASK_SECONDS = {"holdfast_trees": 100.0, "slip_trees": 60.0}
"""Approximate duration of the slow tasks [s]."""
OTHER_SECONDS = 20.0
"""Approximate duration of the other tasks [s]."""
FITTED_TO, METHOD, BUDGET = "fitted to", "method", "budget"
HELD_BUDGET, QUIET_BUDGET = f"{SLIP_RATE:g}/min held", f"{SLIP_RATE:g}/min quiet"
TARGET_TITLES = {"sliding": "true sliding", "stability": "stability"}
FOUND_TITLES = {
    "before": "before",
    **{str(limit): f"within {1000 * limit:.0f} ms" for limit in FOUND_WITHIN},
}
"""Words for the times until which a slip is found, by key of the metrics."""
SLIP_KINDS = {"incipient": "", "gross": "gross, ", "over_1mm": "over 1 mm, "}
"""Begin of the heads of the columns, by name of the metric."""
FALSE_HELD, FALSE_QUIET = "false alarms per minute held", "false alarms per minute quiet"
FALSE_HAND = "false alarms per minute held, hand"
QUIET_RAISED = "quiet hold raised [%]"
N_SLIPS, N_GROSS, N_OVER_1MM = "n slips", "n gross", "n over 1 mm"
HELD_MINUTES = "held [min]"
SLIP_DIGITS = {
    "AUC": 3,
    FALSE_HELD: 2,
    FALSE_QUIET: 2,
    FALSE_HAND: 2,
    N_SLIPS: 0,
    N_GROSS: 0,
    N_OVER_1MM: 0,
}
SLIP_NOTE = (
    "Of single fingers, by the truth of each sample. A finger slides where the load-weighted speed "
    "of its contact exceeds 1 mm/s; below 0.3 mm/s it is still; between, nothing counts. Slips: "
    "share found before the first sliding, and up to 30, 50 and 100 ms after it; the same from the "
    "onset of gross slip (90 % of the load slides) and of slips over 1 mm; share found before 1 mm "
    "and 3 mm were slid. An alarm is a change of the decision to slipping; one that is more than "
    f"{EARLIEST_ALARM:g} s early finds nothing. Each begun {FALSE_ALARM_DURATION:g} s raised "
    f"outside [onset - {EARLIEST_ALARM:g} s, end + {LATEST_ALARM:g} s] of all slips is one false "
    "alarm, of all held time (pushes and glitches included) and of quiet hold; those of the hand "
    "are of all its fingers, for a minute in which it holds. Thresholds: chosen "
    f"on training recordings, out of fold, for {SLIP_RATE:g} false alarm per minute of all held "
    "time (where the budget says so, of quiet hold alone) and at most 2 % of quiet hold raised; "
    "the intervals repeat the choice. All methods are scored on the "
    f"same samples, their log odds smoothed over {SLIP_SMOOTHING:g} s and decisions held for "
    f"{SLIP_HOLD_TIME:g} s, as in the slip rule of a model. 'Stability' is our rule of stability "
    "used as a decision about slip. A global method decides alike for all fingers."
)


def tasks(plan: StudyPlan) -> list[Task]:
    """Return the tasks that evaluate each method."""
    names = slip_methods(plan)
    tests = tuple(plan.corpora[role] for role in TESTED_ROLES if role in plan.corpora)
    every = []
    for name in names:
        # By object where objects are known; the split by recording only stands in for it.
        job = EvaluationJob(
            name, plan.main, ("object", "recording"), tests, effort=method_effort(plan),
            seed=plan.seed, compared=names, slips=True,
        )  # fmt: skip
        cost = TASK_SECONDS.get(name, OTHER_SECONDS) * (0.5 if plan.quick else 1.0)
        result = dict[str, SlipEvaluation]
        every.append(Task(f"slips/{name}", evaluate_slips, (job,), result, cost=cost))
    return every


def slip_methods(plan: StudyPlan) -> tuple[str, ...]:
    """Return the names of the compared methods; those for hands need two fingers."""
    one_finger = len(plan.main.fingers) < 2
    names = QUICK_SLIP_METHODS if plan.quick else tuple(SLIP_METHODS)
    return tuple(n for n in names if not (SLIP_METHODS[n].method.whole_hand and one_finger))


def tables(plan: StudyPlan, results: Results) -> list[ResultTable]:
    """Return the table of slips; none if no slips are known."""
    rows: list[Row] = []
    for name in slip_methods(plan):
        evaluations: dict[str, SlipEvaluation] = results[f"slips/{name}"]
        for role in ("main", *TESTED_ROLES):
            corpus = plan.corpora.get(role)
            if corpus is not None and corpus.name in evaluations:
                evaluation = evaluations[corpus.name]
                keys = {"on": SPLIT_TITLES[evaluation.split or role], **method_keys(name)}
                rows += slip_rows({**keys, BUDGET: HELD_BUDGET}, evaluation)
                quiet = msgspec.structs.replace(evaluation, summary=evaluation.quiet_budget)
                rows += slip_rows({**keys, BUDGET: QUIET_BUDGET}, quiet)
    if not rows:
        return []
    lines = ("on", BUDGET, FITTED_TO, METHOD)
    return [ResultTable("slips", "Slips of fingers", SLIP_NOTE, rows, lines, digits_of=SLIP_DIGITS)]


def method_keys(name: str) -> dict[str, Key]:
    """Return the keys of the rows of a method."""
    slip_method = SLIP_METHODS[name]
    return {FITTED_TO: TARGET_TITLES[slip_method.target], METHOD: slip_method.method.title}


def slip_rows(keys: RowKeys, evaluation: SlipEvaluation) -> list[Row]:
    """Return the rows of one line of the table of slips.

    Args:
        keys: of the rows, but for their figure.
        evaluation: of a method.
    """
    n = evaluation.n_recordings
    pooled, intervals = evaluation.summary.pooled, evaluation.summary.intervals
    # Head of the column, and where its value and its interval are: a field, and a key of it.
    shares: list[tuple[str, str, str | None]] = [
        (f"{begin}{words} [%]", kind, limit)
        for kind, begin in SLIP_KINDS.items()
        for limit, words in FOUND_TITLES.items()
    ]
    for distance, name in zip(DISTANCES, ("before_1mm", "before_3mm"), strict=True):
        shares.append((f"before {1000 * distance:g} mm [%]", name, None))
    shares.append((QUIET_RAISED, "raised_quiet", None))
    shares.append((FALSE_HELD, "false_alarms_per_minute", "held"))
    shares.append((FALSE_QUIET, "false_alarms_per_minute", "quiet"))
    rows = []
    for head, field, key in shares:
        value = getattr(pooled, field)
        interval = None if intervals is None else getattr(intervals, field)
        if key is not None:
            value, interval = value[key], None if interval is None else interval[key]
        rows.append(Row({**keys, "figure": head}, value, None, n, interval))
    counts = {
        FALSE_HAND: hand_rate(evaluation.summary.fingers.values()),
        "AUC": pooled.auc,
        N_SLIPS: pooled.n,
        N_GROSS: pooled.n_gross,
        N_OVER_1MM: pooled.n_over_1mm,
        HELD_MINUTES: pooled.held_minutes,
    }
    return rows + [Row({**keys, "figure": name}, value, None, n) for name, value in counts.items()]


def hand_rate(fingers: Iterable[SlipMetrics]) -> float | None:
    """Return the false alarms of all fingers per minute in which the hand holds."""
    rates = [(finger.false_alarms_per_minute["held"], finger.held_minutes) for finger in fingers]
    held = max((minutes for _, minutes in rates), default=0.0)
    return sum((rate or 0.0) * minutes for rate, minutes in rates) / held if held else None
