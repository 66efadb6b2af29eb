"""Tables of the comparison by event: detection delay, false alarms and glitches."""

from collections.abc import Iterator, Sequence

import numpy as np

from holdfast.metrics.events import EARLY_TOLERANCE, LATE_TOLERANCE, POST_DURATIONS
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import (
    GLITCH_RATE_SPLITS,
    REFERENCE_METHOD,
    SPLIT_TITLES,
    Results,
    method_results,
    method_titles,
)
from holdfast_lab.study.comparison.rows import count_row, quantile_row, ratio_row
from holdfast_lab.study.evaluation.alarm_labels import READINGS
from holdfast_lab.study.evaluation.alarms import AlarmStatistics
from holdfast_lab.study.evaluation.evaluate_method import (
    COMPARED,
    COMPARED_RATE,
    HOLD_TIME,
    LASTING,
    OWN,
)
from holdfast_lab.study.evaluation.held_object import GlitchCount
from holdfast_lab.study.plan import StudyPlan

SHOWN_THRESHOLDS = (OWN, LASTING, COMPARED)
READING = "a glitch is"
"""Key of the tables: how glitches of the hand's controller count."""
FALSE_ALARMS = "false alarms per minute"
FALSE_ALARMS_UNDER_STABLE = "false alarms under stable label, per minute"
FALSE_ALARMS_OF_GLITCH = "of a glitch"
OTHER_FALSE_ALARMS = "other false alarms"
ALREADY_NOT_STABLE = "already not stable at onset [%]"
SLIP_MEDIAN, SLIP_P95 = "slip distance median [mm]", "slip distance 95 % [mm]"
MILLIMETRES = 1e3

GLITCH_NOTE = (
    "A glitch is a jump of the set point in the hand's own controller. 'An event': it is labelled "
    "unstable, and to detect it is right, as in the paper. 'A false alarm': it is labelled "
    "stable, because nothing outside the hand acts, as a user sees it. 'Left out': alarms that "
    f"belong to a glitch (from {1000 * EARLY_TOLERANCE:.0f} ms before it to "
    f"{LATE_TOLERANCE:g} s after it), the "
    "stable label of that time are not counted. Thresholds are chosen for each reading."
)
THRESHOLD_NOTE = (
    f"Thresholds: the method's own; the same with states held not stable for {HOLD_TIME:g} s "
    "more, so that one disturbance is one alarm; and, held as long, the highest threshold with "
    f"at most {COMPARED_RATE:g} false alarm per minute under a stable label in training, where "
    "each training recording is scored by a fit without it."
)

Keys = dict[str, Key]


def events(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of events: missed, delay and false alarms."""
    rows: list[Row] = []
    # The easiest and the hardest split, to keep the table short.
    shown = ("recording", "others" if "others" in plan.corpora else "object")
    for keys, alarms in _lines(plan, results, SHOWN_THRESHOLDS, shown):
        rows += event_rows(keys, alarms, plan.seed)
    note = (
        "Of the hand, by labels without margin. An event is the end of a hold of at least half a "
        "second; an alarm is the end of the state STABLE. Missed: no alarm until that time after "
        "the onset; a missed event counts as an infinite delay. A hand that is already not "
        "called stable at the onset has no alarm to give; how often this is so is a column. "
        f"{THRESHOLD_NOTE} False alarms, per minute of stable label: all; under a stable label; "
        f"of those, the ones that belong to a glitch, and the others. {GLITCH_NOTE}"
    )
    return ResultTable(
        "events",
        "Events",
        note,
        rows,
        ("on", "threshold", READING, "method"),
        digits_of=EVENT_DIGITS,
    )


def glitch_rates(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of events on corpora that differ in the rate of glitches."""
    rows: list[Row] = []
    splits = GLITCH_RATE_SPLITS if "glitch-0" in plan.corpora else ()
    for keys, alarms in _lines(plan, results, (COMPARED,), splits):
        del keys["threshold"]
        every = event_rows(keys, alarms, plan.seed)
        rows += [row for row in every if row.keys["figure"] in GLITCH_RATE_FIGURES]
    note = (
        "The rate of glitches is a free choice of the twin. Grasps of unseen objects with 0 "
        "and 1 glitches a minute, and with 7 ('unseen objects'); methods and thresholds are fitted "
        "to main, as everywhere. The grasps of different rates are not the same draws. At the "
        f"threshold for {COMPARED_RATE:g} false alarm per minute under a stable label in training. "
        f"{GLITCH_NOTE}"
    )
    lines = ("on", READING, "method")
    title = "Sensitivity to the rate of glitches"
    return ResultTable("glitch_rates", title, note, rows, lines, digits_of=EVENT_DIGITS)


def glitches(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of what the truth contains after a glitch: how often the object slides."""
    rows: list[Row] = []
    for key, evaluation in method_results(plan, results, REFERENCE_METHOD):
        counts = evaluation.glitches
        # By object the recordings are those of the split by recording, with the same truth.
        if key != "object" and any(count.grasped_seconds for count in counts):
            rows += glitch_rows({"on": SPLIT_TITLES[key]}, counts, plan.seed)
    note = (
        "By the truth of the recordings, while the hand holds the object; no method is involved. "
        "The object slides if it moves on a finger at over 1 mm/s within 0.1 s after a jump of "
        "the controller's set point; the distance counts until that sliding stops."
    )
    title = "Glitches and the slips that they cause"
    return ResultTable("glitches", title, note, rows, ("on",), digits_of=EVENT_DIGITS)


def event_rows(keys: Keys, alarms: Sequence[AlarmStatistics], seed: int) -> Iterator[Row]:
    """Yield the rows of one line of the table of events."""
    n_events = [len(alarm.delays) for alarm in alarms]
    for post in POST_DURATIONS:
        figure = {"figure": f"missed at {1000 * post:.0f} ms [%]"}
        yield ratio_row(keys | figure, [alarm.n_missed(post) for alarm in alarms], n_events, seed)
    not_stable = [alarm.n_events_not_stable for alarm in alarms]
    yield ratio_row(keys | {"figure": ALREADY_NOT_STABLE}, not_stable, n_events, seed)
    delays = [alarm.delays for alarm in alarms]
    yield quantile_row(keys | {"figure": "delay median [s]"}, delays, 0.5, seed)
    yield quantile_row(keys | {"figure": "delay 95 % [s]"}, delays, 0.95, seed)
    minutes = [alarm.stable_seconds / 60 for alarm in alarms]
    counts = {
        FALSE_ALARMS: [alarm.n_false_alarms for alarm in alarms],
        FALSE_ALARMS_UNDER_STABLE: [alarm.n_under_stable for alarm in alarms],
        FALSE_ALARMS_OF_GLITCH: [alarm.n_of_glitch for alarm in alarms],
        OTHER_FALSE_ALARMS: [alarm.n_under_stable - alarm.n_of_glitch for alarm in alarms],
    }
    for head, count in counts.items():
        yield ratio_row(keys | {"figure": head}, count, minutes, seed, scale=1.0)
    yield count_row(keys | {"figure": "events"}, n_events)


GLITCH_RATE_FIGURES = (
    f"missed at {1000 * POST_DURATIONS[0]:.0f} ms [%]",
    f"missed at {1000 * POST_DURATIONS[-1]:.0f} ms [%]",
    FALSE_ALARMS_UNDER_STABLE,
    FALSE_ALARMS_OF_GLITCH,
    "events",
)
EVENT_DIGITS = {
    **dict.fromkeys(("delay median [s]", "delay 95 % [s]"), 3),
    **dict.fromkeys((SLIP_MEDIAN, SLIP_P95), 2),
    **dict.fromkeys(("events", "glitches"), 0),
}


def _lines(
    plan: StudyPlan, results: Results, thresholds: Sequence[str], splits: Sequence[str]
) -> Iterator[tuple[Keys, list[AlarmStatistics]]]:
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            if key not in splits:
                continue
            for threshold in thresholds:
                for reading in READINGS:
                    keys: Keys = {"on": SPLIT_TITLES[key], "threshold": threshold}
                    keys |= {READING: reading, "method": title}
                    yield keys, evaluation.readings[reading][threshold]


def glitch_rows(keys: Keys, counts: Sequence[GlitchCount], seed: int) -> Iterator[Row]:
    """Yield the rows of one line of the table of glitches."""
    n = [len(count.distances) for count in counts]
    minutes = [count.grasped_seconds / 60 for count in counts]
    yield ratio_row(keys | {"figure": "glitches per minute held"}, n, minutes, seed, scale=1.0)
    for figure, least in (("object slides [%]", 0.0), ("by 0.1 mm or more [%]", 1e-4)):
        slid = [int((np.array(count.distances) > least).sum()) for count in counts]
        yield ratio_row(keys | {"figure": figure}, slid, n, seed)
    distances = [[MILLIMETRES * d for d in count.distances if d] for count in counts]
    yield quantile_row(keys | {"figure": SLIP_MEDIAN}, distances, 0.5, seed)
    yield quantile_row(keys | {"figure": SLIP_P95}, distances, 0.95, seed)
    yield count_row(keys | {"figure": "glitches"}, n)
