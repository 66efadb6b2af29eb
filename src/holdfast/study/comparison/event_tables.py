"""Tables of the comparison by event: detection delay, false alarms and slips."""

from collections.abc import Callable, Iterator, Sequence

from holdfast.metrics.events import POST_DURATIONS
from holdfast.study.comparison.jobs import SPLIT_TITLES, Results, method_results, method_titles
from holdfast.study.comparison.rows import count_row, quantile_row, ratio_row
from holdfast.study.evaluation.alarm_statistics import JUMP_EFFECT_TIME, AlarmStatistics
from holdfast.study.evaluation.evaluate_method import COMPARED_RATE, HOLD_TIME, MethodEvaluation
from holdfast.study.plan import StudyPlan
from holdfast.study.report.result_tables import Key, ResultTable, Row

ALARMS_BY_THRESHOLD: dict[str, Callable[[MethodEvaluation], list[AlarmStatistics]]] = {
    "own": lambda evaluation: evaluation.alarms,
    f"own, held {HOLD_TIME:g} s": lambda evaluation: evaluation.held_alarms,
    f"for {COMPARED_RATE:g}/min": lambda evaluation: evaluation.compared_alarms,
    f"for {COMPARED_RATE:g}/min, jumps apart": lambda evaluation: evaluation.alarms_without_jumps,
}
SLIP_THRESHOLDS = tuple(ALARMS_BY_THRESHOLD)[1:]
SLIP_SPLITS = ("recording", "object", "others")
FALSE_ALARMS = "in vain per minute"
FALSE_ALARMS_UNDER_STABLE = "in vain under stable label, per minute"
FALSE_ALARMS_AFTER_JUMP = "after a jump"
OTHER_FALSE_ALARMS = "the rest"

Keys = dict[str, Key]


def events(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of events: missed, delay and false alarms."""
    rows: list[Row] = []
    for keys, alarms in _lines(plan, results, tuple(ALARMS_BY_THRESHOLD), _event_splits(plan)):
        rows += _missed_rows(keys, alarms, plan.seed)
        rows += _delay_rows(keys, alarms, plan.seed)
        rows += _false_alarm_rows(keys, alarms, plan.seed)
        rows.append(count_row(keys | {"figure": "events"}, [len(each.delays) for each in alarms]))
    note = (
        "Of the hand, by labels without margin. An event is the end of a hold of at least half a "
        "second; an alarm is the end of the state STABLE. Missed: no alarm until that time after "
        "the onset; a missed event counts as an infinite delay. Thresholds: the method's own; the "
        f"same with states held not stable for {HOLD_TIME:g} s more, so that one disturbance is "
        "one alarm; and, held as long, the highest threshold with at most "
        f"{COMPARED_RATE:g} false alarm per minute under a stable label in training, where each "
        "training recording is scored by a fit without it. 'Jumps apart': alarms right after a "
        "jump of the controller's set point are not counted when the threshold is chosen. 'In "
        "vain' are false alarms, per minute of stable label: all; under a stable label; of those, "
        f"within {JUMP_EFFECT_TIME:g} s after a jump of the controller's set point, which changes "
        "the force abruptly while the label is stable; and the rest."
    )
    digits = dict.fromkeys(("delay median [s]", "delay 95 % [s]"), 3) | {"events": 0}
    lines = ("on", "threshold", "method")
    return ResultTable("events", "Events", note, rows, lines, digits_of=digits)


def slips(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of slips found in time, at thresholds with few false alarms."""
    rows: list[Row] = []
    for keys, alarms in _lines(plan, results, SLIP_THRESHOLDS, SLIP_SPLITS):
        n_slips = [len(each.slip_delays) for each in alarms]
        for post in POST_DURATIONS:
            found = [each.n_slips_found(post) for each in alarms]
            figure = {"figure": f"found within {1000 * post:.0f} ms [%]"}
            rows.append(ratio_row(keys | figure, found, n_slips, plan.seed))
        not_stable = [each.n_not_called_stable for each in alarms]
        stable = [each.n_stable for each in alarms]
        figure = {"figure": "stable called otherwise [%]"}
        rows.append(ratio_row(keys | figure, not_stable, stable, plan.seed))
        rows += [row for row in _false_alarm_rows(keys, alarms, plan.seed) if _is_of_slips(row)]
        rows.append(count_row(keys | {"figure": "slips"}, n_slips))
    note = (
        "A slip: the object begins to slide on a finger (over 1 mm/s) after the hand has held it "
        "without sliding for half a second. Found: at some sample from the onset until that time "
        "the hand is not called stable. A hand that is already not called stable at the onset "
        "counts as found, so the share of stable samples that are not called stable is given too. "
        f"Thresholds: for {COMPARED_RATE:g} false alarm per minute under a stable label in "
        "training. 'Jumps apart': alarms right after a jump of the controller's set point are not "
        "counted when the threshold is chosen. 'In vain' are false alarms."
    )
    lines = ("on", "threshold", "method")
    return ResultTable("slips", "Slips found", note, rows, lines, digits_of={"slips": 0})


def _lines(
    plan: StudyPlan, results: Results, thresholds: Sequence[str], splits: Sequence[str]
) -> Iterator[tuple[Keys, list[AlarmStatistics]]]:
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            if key not in splits:
                continue
            for threshold in thresholds:
                keys: Keys = {"on": SPLIT_TITLES[key], "threshold": threshold, "method": title}
                yield keys, ALARMS_BY_THRESHOLD[threshold](evaluation)


def _event_splits(plan: StudyPlan) -> tuple[str, ...]:
    """Return the easiest and the hardest split, to keep the table short."""
    return "recording", "others" if "others" in plan.corpora else "object"


def _missed_rows(keys: Keys, alarms: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    n_events = [len(each.delays) for each in alarms]
    for post in POST_DURATIONS:
        figure = {"figure": f"missed at {1000 * post:.0f} ms [%]"}
        yield ratio_row(keys | figure, [each.n_missed(post) for each in alarms], n_events, seed)


def _delay_rows(keys: Keys, alarms: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    delays = [each.delays for each in alarms]
    yield quantile_row(keys | {"figure": "delay median [s]"}, delays, 0.5, seed)
    yield quantile_row(keys | {"figure": "delay 95 % [s]"}, delays, 0.95, seed)


def _false_alarm_rows(keys: Keys, alarms: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    minutes = [each.stable_seconds / 60 for each in alarms]
    counts = {
        FALSE_ALARMS: [each.n_false_alarms for each in alarms],
        FALSE_ALARMS_UNDER_STABLE: [each.n_under_stable for each in alarms],
        FALSE_ALARMS_AFTER_JUMP: [each.n_after_jump for each in alarms],
        OTHER_FALSE_ALARMS: [each.n_under_stable - each.n_after_jump for each in alarms],
    }
    for figure, count in counts.items():
        yield ratio_row(keys | {"figure": figure}, count, minutes, seed, scale=1.0)


def _is_of_slips(row: Row) -> bool:
    return row.keys["figure"] in (FALSE_ALARMS_UNDER_STABLE, OTHER_FALSE_ALARMS)
