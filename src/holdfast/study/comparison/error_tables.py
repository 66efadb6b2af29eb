"""Tables of the comparison by circumstance: phase, grip force, direction of the push."""

from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from holdfast.contact import Phase
from holdfast.sensors.types import Array
from holdfast.study.comparison.jobs import SPLITS, Results, found, titles
from holdfast.study.comparison.rows import ratio_row
from holdfast.study.evaluation.error_breakdown import AXES, ErrorBreakdown, GripErrors
from holdfast.study.plan import StudyPlan
from holdfast.study.report.result_tables import Key, ResultTable, Row
from holdfast.twin.labels import LabelRule

DIRECTIONS = (*AXES, "oblique")
QUARTERS = ("lightest quarter", "second", "third", "firmest quarter")
SHOWN = ("recording", "others")
DOUBTED, TRUSTED = "stable called otherwise [%]", "not stable called stable [%]"

Keys = dict[str, Key]
Line = tuple[Keys, Sequence[ErrorBreakdown]]


def phases(plan: StudyPlan, results: Results) -> ResultTable:
    """Errors by what was going on."""
    rows: list[Row] = []
    for keys, parts in _lines(plan, results):
        for phase in map(str, Phase):
            n, wrong = np.array([each.phases.get(phase, (0, 0)) for each in parts]).T
            if n.sum():
                rows.append(ratio_row(keys | {"phase": phase}, wrong, n, plan.seed))
    note = "Wrong samples of those in each phase of the true course of things; of all fingers."
    title = "Errors by phase [%]"
    return ResultTable("phases", title, note, rows, ("on", "method"), column="phase")


def force(plan: StudyPlan, results: Results) -> ResultTable:
    """Errors by how firm the grip is: the paper says that it does not matter."""
    rows: list[Row] = []
    lines = [line for line in _lines(plan, results) if any(each.grips for each in line[1])]
    edges = quarters(lines[0][1]) if lines else np.empty(0)
    for keys, parts in lines:
        for place, quarter in enumerate(QUARTERS):
            for about, pair in ((DOUBTED, (0, 1)), (TRUSTED, (2, 3))):
                n, wrong = _of_quarter(parts, edges, place, pair)
                figure = keys | {"error": about, "grip": quarter}
                rows.append(ratio_row(figure, wrong, n, plan.seed))
    bounds = ", ".join(f"{edge:.2f}" for edge in edges)
    note = (
        "Quarters of fingers in recordings by the mean of their true contact force while the "
        f"object is locked, of the recordings judged by recording (bounds {bounds} N). While the "
        "object is held; of methods that judge fingers."
    )
    return ResultTable(
        "force", "Errors by grip force [%]", note, rows, ("on", "error", "method"), column="grip"
    )


def directions(plan: StudyPlan, results: Results) -> ResultTable:
    """Disturbances missed by where they push to: the paper says all possible directions."""
    rows: list[Row] = []
    counts: dict[str, int] = dict.fromkeys(DIRECTIONS, 0)
    for keys, parts in _lines(plan, results):
        pushes = [[p for p in each.pushes if p.n] for each in parts]
        for direction in DIRECTIONS:
            own = [[p for p in each if p.direction == direction] for each in pushes]
            n, wrong = (
                [sum(p.n for p in each) for each in own],
                [sum(p.wrong for p in e) for e in own],
            )
            if sum(n):
                rows.append(ratio_row(keys | {"direction": direction}, wrong, n, plan.seed))
                counts[direction] = counts[direction] or sum(len(each) for each in own)
    told = ", ".join(f"{direction} {n}" for direction, n in counts.items() if n)
    note = (
        "Samples labelled not stable, during a disturbance, that are called stable; of all "
        "fingers. Directions of the mean outside force in the world, within 30 degrees; gravity "
        f"pulls down. Disturbances by recording: {told or 'none'}."
    )
    title = "Disturbed called stable, by direction [%]"
    return ResultTable("directions", title, note, rows, ("on", "method"), column="direction")


def quarters(parts: Sequence[ErrorBreakdown]) -> Array:
    """The three forces [N] that part the fingers which hold something into quarters."""
    forces = [grip.force for grip in _holding(parts)]
    return np.quantile(forces, (0.25, 0.5, 0.75)) if forces else np.empty(0)


def _holding(parts: Sequence[ErrorBreakdown]) -> Iterator[GripErrors]:
    every = chain.from_iterable(each.grips for each in parts)
    return (grip for grip in every if grip.force > LabelRule().contact)


def _of_quarter(
    parts: Sequence[ErrorBreakdown], edges: Array, place: int, pair: tuple[int, int]
) -> Array:
    """(2, n_recordings) samples, and wrong ones, of the fingers in one quarter."""
    counts = np.zeros((2, len(parts)))
    for column, each in enumerate(parts):
        for grip in _holding([each]):
            if np.searchsorted(edges, grip.force) == place:
                counts[:, column] += [grip.counts[k] for k in pair]
    return counts


def _lines(plan: StudyPlan, results: Results) -> Iterator[Line]:
    for name, title in titles(plan).items():
        for key, judged in found(plan, results, name):
            if key in SHOWN and any(each.phases for each in judged.breakdown):
                yield {"on": SPLITS[key], "method": title}, judged.breakdown
