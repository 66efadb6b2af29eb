"""Tables of the comparison by event: alarms, how late and how many in vain, and slips."""

from collections.abc import Callable, Iterator, Sequence

from holdfast.metrics.events import POSTS
from holdfast.study.comparison.jobs import SPLITS, Results, found, titles
from holdfast.study.comparison.rows import count_row, quantile_row, ratio_row
from holdfast.study.evaluation.alarm_statistics import AFTER_GLITCH, AlarmStatistics
from holdfast.study.evaluation.evaluate_method import COMPARED_RATE, HOLD_TIME, MethodEvaluation
from holdfast.study.plan import StudyPlan
from holdfast.study.report.result_tables import Key, ResultTable, Row

THRESHOLDS: dict[str, Callable[[MethodEvaluation], list[AlarmStatistics]]] = {
    "own": lambda judged: judged.own,
    f"own, held {HOLD_TIME:g} s": lambda judged: judged.held,
    f"for {COMPARED_RATE:g}/min": lambda judged: judged.calm,
    f"for {COMPARED_RATE:g}/min, jumps apart": lambda judged: judged.spared,
}
OF_SLIPS = tuple(THRESHOLDS)[1:]
SHOWN = ("recording", "object", "others")
UNDER_STABLE = "in vain under stable label, per minute"

Keys = dict[str, Key]


def events(plan: StudyPlan, results: Results) -> ResultTable:
    """Onsets of instability, and alarms in vain."""
    rows: list[Row] = []
    for keys, heard in _lines(plan, results, tuple(THRESHOLDS), _of_events(plan)):
        rows += _missed(keys, heard, plan.seed)
        rows += _delays(keys, heard, plan.seed)
        rows += _in_vain(keys, heard, plan.seed)
        rows.append(count_row(keys | {"figure": "events"}, [len(each.delays) for each in heard]))
    note = (
        "Of the hand, by labels without margin. An event: a hold of half a second that ends; an "
        "alarm: the hand is stable no more. Missed: no alarm until that long after the onset; a "
        "missed event counts as infinitely late. Thresholds: the method's own, sample by sample; "
        f"the same where not stable is told for {HOLD_TIME:g} s more, so that one disturbance is "
        "one alarm; and, held as long, the most "
        f"watchful one that gives {COMPARED_RATE:g} false alarm per minute under a stable label in "
        "training, each training recording judged without itself; 'jumps apart': those right "
        "after a jump of the controller's set point not counted in choosing it. In vain, per "
        "minute of stable "
        "label: all; under a stable label; of those, within "
        f"{AFTER_GLITCH:g} s after a jump of the controller's set point, which changes the force "
        "abruptly while the labels call it stable; and the rest."
    )
    digits = dict.fromkeys(("delay median [s]", "delay 95 % [s]"), 3) | {"events": 0}
    lines = ("on", "threshold", "method")
    return ResultTable("events", "Events", note, rows, lines, digits_of=digits)


def slips(plan: StudyPlan, results: Results) -> ResultTable:
    """Slips found in time, where false alarms are few."""
    rows: list[Row] = []
    for keys, heard in _lines(plan, results, OF_SLIPS, SHOWN):
        n = [len(each.slips) for each in heard]
        for post in POSTS:
            about = keys | {"figure": f"found within {1000 * post:.0f} ms [%]"}
            rows.append(ratio_row(about, [each.n_found(post) for each in heard], n, plan.seed))
        about = keys | {"figure": "stable called otherwise [%]"}
        doubted, stable = [e.n_doubted for e in heard], [e.n_stable for e in heard]
        rows.append(ratio_row(about, doubted, stable, plan.seed))
        rows += [row for row in _in_vain(keys, heard, plan.seed) if _under_stable(row)]
        rows.append(count_row(keys | {"figure": "slips"}, n))
    note = (
        "A slip: the object begins to slide on a finger (over 1 mm/s) that it has rested on for "
        "half a second, in a hand that holds it. Found: the hand is not called stable at some "
        "sample from the onset on, until that late; being so already, from what led to the slip, "
        "counts. So the share of stable samples that are not called stable stands beside it. "
        f"Thresholds: for {COMPARED_RATE:g} false alarm per minute under a stable label in "
        "training; 'jumps apart': those right after a jump of the controller's set point not "
        "counted in choosing it."
    )
    lines = ("on", "threshold", "method")
    return ResultTable("slips", "Slips found", note, rows, lines, digits_of={"slips": 0})


def _lines(
    plan: StudyPlan, results: Results, thresholds: Sequence[str], shown: Sequence[str]
) -> Iterator[tuple[Keys, list[AlarmStatistics]]]:
    for name, title in titles(plan).items():
        for key, judged in found(plan, results, name):
            if key not in shown:
                continue
            for threshold in thresholds:
                keys: Keys = {"on": SPLITS[key], "threshold": threshold, "method": title}
                yield keys, THRESHOLDS[threshold](judged)


def _of_events(plan: StudyPlan) -> tuple[str, ...]:
    """The mildest and the hardest test: the table is long."""
    return "recording", "others" if "others" in plan.corpora else "object"


def _missed(keys: Keys, heard: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    n = [len(each.delays) for each in heard]
    for post in POSTS:
        about = keys | {"figure": f"missed at {1000 * post:.0f} ms [%]"}
        yield ratio_row(about, [each.n_missed(post) for each in heard], n, seed)


def _delays(keys: Keys, heard: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    delays = [each.delays for each in heard]
    yield quantile_row(keys | {"figure": "delay median [s]"}, delays, 0.5, seed)
    yield quantile_row(keys | {"figure": "delay 95 % [s]"}, delays, 0.95, seed)


def _in_vain(keys: Keys, heard: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    minutes = [each.stable_seconds / 60 for each in heard]
    counts = {
        "in vain per minute": [each.false_alarms for each in heard],
        UNDER_STABLE: [each.under_stable for each in heard],
        "after a jump": [each.follows_jump for each in heard],
        "the rest": [each.under_stable - each.follows_jump for each in heard],
    }
    for figure, count in counts.items():
        yield ratio_row(keys | {"figure": figure}, count, minutes, seed, scale=1.0)


def _under_stable(row: Row) -> bool:
    return row.keys["figure"] in (UNDER_STABLE, "the rest")
