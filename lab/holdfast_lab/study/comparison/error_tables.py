"""Tables of the comparison by circumstance: phase, grip force, direction of the disturbance."""

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from holdfast.contact import CONTACT_FORCE, Phase
from holdfast.sensors.types import Array
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.jobs import SPLIT_TITLES, Results, method_results, method_titles
from holdfast_lab.study.comparison.rows import ratio_row
from holdfast_lab.study.evaluation.error_breakdown import (
    OBLIQUE,
    PULL_DIRECTIONS,
    ErrorBreakdown,
    GripErrors,
)
from holdfast_lab.study.plan import StudyPlan

QUARTERS = ("lightest quarter", "second", "third", "firmest quarter")
SHOWN_SPLITS = ("recording", "others")
STABLE_MISSED = "stable called otherwise [%]"
NOT_STABLE_MISSED = "not stable called stable [%]"
ERROR_KINDS = (STABLE_MISSED, NOT_STABLE_MISSED)

Keys = dict[str, Key]
Line = tuple[Keys, Sequence[ErrorBreakdown]]


def phases(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of errors by phase of the experiment."""
    rows: list[Row] = []
    for keys, breakdowns in _lines(plan, results):
        for phase in map(str, Phase):
            n, wrong = np.array([breakdown.phases.get(phase, (0, 0)) for breakdown in breakdowns]).T
            if n.sum():
                rows.append(ratio_row(keys | {"phase": phase}, wrong, n, plan.seed))
    note = "Share of wrong samples in each phase of the true course of the grasp; all fingers."
    title = "Errors by phase [%]"
    return ResultTable("phases", title, note, rows, ("on", "method"), column="phase")


def force(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of errors by grip force. The paper states that it has no influence."""
    rows: list[Row] = []
    lines = [line for line in _lines(plan, results) if any(errors.grips for errors in line[1])]
    # Of the first line, for the grips are those of the recordings, whatever the method.
    edges = force_quartiles(lines[0][1]) if lines else np.empty(0)
    for keys, breakdowns in lines:
        for quarter, title in enumerate(QUARTERS):
            for kind in ERROR_KINDS:
                # Samples, and wrong ones, of the fingers in this quarter, by recording.
                counts = np.zeros((2, len(breakdowns)))
                for column, errors in enumerate(breakdowns):
                    for grip in _holding_grips([errors]):
                        if np.searchsorted(edges, grip.force) == quarter:
                            missed = grip.stable if kind == STABLE_MISSED else grip.not_stable
                            counts[:, column] += missed
                n, wrong = counts
                figure = keys | {"error": kind, "grip": title}
                rows.append(ratio_row(figure, wrong, n, plan.seed))
    bounds = ", ".join(f"{edge:.2f}" for edge in edges)
    note = (
        "Quarters of the fingers by the mean of their true contact force while the object is "
        f"locked, over the recordings evaluated by recording (limits {bounds} N). Samples while "
        "the object is held; methods that decide for fingers."
    )
    return ResultTable(
        "force", "Errors by grip force [%]", note, rows, ("on", "error", "method"), column="grip"
    )


def directions(plan: StudyPlan, results: Results) -> ResultTable:
    """Return the table of missed disturbances by direction. The paper states: all are found."""
    rows: list[Row] = []
    n_disturbances: dict[str, int] = {}
    for keys, breakdowns in _lines(plan, results):
        for direction in (*PULL_DIRECTIONS, OBLIQUE):
            # The counts of the disturbances in a direction that have labelled samples.
            events = [
                [count for name, count in breakdown.disturbances if count[0] and name == direction]
                for breakdown in breakdowns
            ]
            n = [sum(n for n, _ in of_recording) for of_recording in events]
            wrong = [sum(wrong for _, wrong in of_recording) for of_recording in events]
            if sum(n):
                rows.append(ratio_row(keys | {"direction": direction}, wrong, n, plan.seed))
                # The first line counts: it has the recordings evaluated by recording.
                n_disturbances.setdefault(direction, sum(map(len, events)))
    ordered = [each for each in (*PULL_DIRECTIONS, OBLIQUE) if each in n_disturbances]
    counts = ", ".join(f"{direction} {n_disturbances[direction]}" for direction in ordered)
    note = (
        "Share of the samples labelled not stable, during a disturbance, that are called stable; "
        "all fingers. Directions of the mean outside force in the world frame, within 30 degrees; "
        f"gravity acts downwards. Disturbances by recording: {counts or 'none'}."
    )
    title = "Disturbed called stable, by direction [%]"
    return ResultTable("directions", title, note, rows, ("on", "method"), column="direction")


def force_quartiles(breakdowns: Sequence[ErrorBreakdown]) -> Array:
    """Return the three quartiles of the force of the fingers that hold the object [N]."""
    forces = [grip.force for grip in _holding_grips(breakdowns)]
    return np.quantile(forces, (0.25, 0.5, 0.75)) if forces else np.empty(0)


def _holding_grips(breakdowns: Sequence[ErrorBreakdown]) -> Iterator[GripErrors]:
    grips = chain.from_iterable(breakdown.grips for breakdown in breakdowns)
    return (grip for grip in grips if grip.force > CONTACT_FORCE)


def _lines(plan: StudyPlan, results: Results) -> Iterator[Line]:
    for name, title in method_titles(plan).items():
        for key, evaluation in method_results(plan, results, name):
            if key in SHOWN_SPLITS and any(errors.phases for errors in evaluation.breakdown):
                yield {"on": SPLIT_TITLES[key], "method": title}, evaluation.breakdown
