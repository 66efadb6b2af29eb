"""Table of our own method against the strongest baseline, by sample and by event.

The strongest baseline is the one with the fewest errors on the very recordings that are shown.
So the choice favours the baselines.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from holdfast.metrics import Metrics
from holdfast.metrics.events import POST_DURATIONS
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.event_tables import FALSE_ALARMS_UNDER_STABLE
from holdfast_lab.study.comparison.jobs import (
    SPLIT_TITLES,
    Results,
    method_results,
    method_titles,
)
from holdfast_lab.study.comparison.rows import correct_and_all, quotient_row, ratio_row
from holdfast_lab.study.evaluation.alarm_labels import EVENT, FALSE_ALARM, LEFT_OUT
from holdfast_lab.study.evaluation.evaluate_method import (
    COMPARED,
    COMPARED_RATE,
    MethodEvaluation,
)
from holdfast_lab.study.methods import PAPER_FAMILY, RIVALS
from holdfast_lab.study.plan import StudyPlan

OURS = "holdfast"
"""Name of our own method."""
FAMILY, EVERY = "the paper's family", "all other methods"
RATIO = "ratio of errors"
CountPairs = list[tuple[int, int]]
"""Errors, and all samples or events, of each recording."""


class Measure(NamedTuple):
    """A kind of error.

    Attributes:
        title: with its unit.
        left_out: what is not counted.
        counts: errors and all samples or events of each recording; None if there are none.
        reading: of glitches, if the errors are of events.
    """

    title: str
    left_out: str
    counts: Callable[[MethodEvaluation], CountPairs | None]
    reading: str = ""


def table(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of our method against the strongest baselines, on unseen objects."""
    rows = [row for measure in MEASURES for row in measure_rows(plan, results, measure)]
    posts = f"{1000 * POST_DURATIONS[0]:.0f} ms"
    note = (
        "Errors of holdfast and of the baseline that has the fewest errors on the same "
        "recordings: among the paper's method and its variants (both classifiers, with balanced "
        "and with unweighted classes; log F_a with log sigma, and with the largest of the hand "
        "too; the energy of the details), and among all other methods. By sample: at each "
        f"method's own threshold. By event: the hand, missed until {posts} after the onset, at "
        f"the threshold chosen for {COMPARED_RATE:g} false alarm per minute under a stable label "
        "in training; the false alarms that result are given. The ratio is that of the baseline "
        "to ours; its interval is paired: a resample draws the same recordings for both. What is "
        "left out is left out of numerator and denominator. A glitch is a jump of the hand's own "
        "controller: an event, a false alarm, or left out."
    )
    lines = ("on", "error", "left out", "baseline of", "baseline")
    title = "Ours against the strongest baseline"
    digits = {RATIO: 2, FALSE_ALARMS_UNDER_STABLE: 1}
    return ResultTable("strongest", title, note, rows, lines, digits_of=digits)


def strongest_of_family(
    plan: StudyPlan, results: Results, key: str, *, as_hand: bool
) -> tuple[str, MethodEvaluation] | None:
    """Return the most accurate method of the paper's family on a split or corpus, by name.

    Args:
        plan: of the study.
        results: of its tasks.
        key: of the split or corpus, of `SPLIT_TITLES`.
        as_hand: compare hands, not what the methods decide for.
    """
    found = {n: e for n, e in _evaluations(plan, results, key).items() if n in PAPER_FAMILY}
    counts = {n: sample_errors(e.hand if as_hand else e.metrics) or [] for n, e in found.items()}
    name = _fewest_errors(counts)
    return None if name is None else (name, found[name])


def measure_rows(plan: StudyPlan, results: Results, measure: Measure) -> Iterator[Row]:
    """Yield the rows of one kind of error: ours, the baseline's and their ratio."""
    key = "others" if "others" in plan.corpora else "object"
    evaluations = _evaluations(plan, results, key)
    counts = {name: measure.counts(evaluation) for name, evaluation in evaluations.items()}
    known = {name: each for name, each in counts.items() if each and sum(n for _, n in each)}
    if OURS not in known:
        return
    titles = method_titles(plan)
    # Chosen for each measure and group alone: the rival is the best at the very thing shown.
    for group, names in ((FAMILY, PAPER_FAMILY), (EVERY, RIVALS)):
        best = _fewest_errors({n: known[n] for n in names if n in known})
        if best is None:
            continue
        keys: dict[str, Key] = {"on": SPLIT_TITLES[key], "error": measure.title}
        keys |= {"left out": measure.left_out, "baseline of": group, "baseline": titles[best]}
        ours, base = np.array(known[OURS]), np.array(known[best])
        yield ratio_row(keys | {"figure": "holdfast [%]"}, ours[:, 0], ours[:, 1], plan.seed)
        yield ratio_row(keys | {"figure": "baseline [%]"}, base[:, 0], base[:, 1], plan.seed)
        yield quotient_row(keys | {"figure": RATIO}, base, ours, plan.seed)
        if measure.reading:
            # Misses alone say nothing: a method that alarms all the time misses none.
            for who, name in (("holdfast", OURS), ("baseline", best)):
                alarms = evaluations[name].readings[measure.reading][COMPARED]
                figure = f"{who}, {FALSE_ALARMS_UNDER_STABLE}"
                n = [alarm.n_under_stable for alarm in alarms]
                minutes = [alarm.stable_seconds / 60 for alarm in alarms]
                yield ratio_row(keys | {"figure": figure}, n, minutes, plan.seed, scale=1.0)


def _evaluations(plan: StudyPlan, results: Results, key: str) -> dict[str, MethodEvaluation]:
    """Return the evaluations of all methods on a split or corpus, by name."""
    evaluations = {name: dict(method_results(plan, results, name)) for name in method_titles(plan)}
    return {name: by_split[key] for name, by_split in evaluations.items() if key in by_split}


def _fewest_errors(counts: dict[str, CountPairs]) -> str | None:
    """Return the name with the smallest share of errors; the first of equals."""
    shares = {
        name: sum(wrong for wrong, _ in errors) / max(sum(n for _, n in errors), 1)
        for name, errors in counts.items()
    }
    return min(shares, key=lambda name: shares[name], default=None)


def sample_errors(metrics: Metrics | None) -> CountPairs | None:
    """Return the wrong samples, and all, of each recording; None without metrics."""
    if metrics is None:
        return None
    return [(n - n_correct, n) for n_correct, n in correct_and_all(metrics).values()]


def held_errors(evaluation: MethodEvaluation) -> CountPairs | None:
    """Return the errors of fingers while the hand holds the object."""
    # Before the grasp and after the release every method is right, which hides the differences.
    if evaluation.fingers is None:
        return None
    return [(n_wrong, n) for n, n_wrong in evaluation.held]


def missed_events(reading: str) -> Callable[[MethodEvaluation], CountPairs]:
    """Return a function from an evaluation to its missed events and all events."""
    return lambda evaluation: [
        (alarms.n_missed(POST_DURATIONS[0]), len(alarms.delays))
        for alarms in evaluation.readings[reading][COMPARED]
    ]


NOTHING = "nothing"
MEASURES = (
    Measure("samples of fingers [%]", NOTHING, lambda one: sample_errors(one.fingers)),
    Measure("samples of hands [%]", NOTHING, lambda one: sample_errors(one.hand)),
    Measure("samples of fingers [%]", "samples at which nothing is held", held_errors),
    Measure("events, a glitch is an event [%]", NOTHING, missed_events(EVENT), EVENT),
    Measure("events, a glitch is a false alarm [%]", NOTHING, missed_events(FALSE_ALARM),
            FALSE_ALARM),
    Measure("events [%]", "glitches", missed_events(LEFT_OUT), LEFT_OUT),
)  # fmt: skip
"""The kinds of errors in the table: without any exclusion, then with exclusions."""
