"""Where a label should begin or end by the probabilities: the likeliest place of an edge."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from holdfast.labelling.spans import ROUNDING, Span
from holdfast.sensors.types import Array

REACH = 0.5
"""The place of an edge is looked for within this [s] of where it is drawn."""

FLOOR = 0.01
"""Probabilities are at least this in a likelihood ratio: no sample decides alone."""

SPREADS = 2.0
"""Shifts within so many standard deviations of the usual one are usual."""

NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median distance from the median."""

Kind = tuple[int, int]
"""The codes of the states before and after an edge."""


class Edge(NamedTuple):
    """The border of two labels of different states.

    Attributes:
        at: where it is drawn [s].
        best: its likeliest place [s].
        low: the earliest that was looked at [s].
        high: the latest [s].
        kind: the codes of the states before and after it.
    """

    at: float
    best: float
    low: float
    high: float
    kind: Kind


def edges_of(spans: Sequence[Span], times: Array, probabilities: Array) -> Iterator[Edge]:
    """The edges of a labelling, each with its likeliest place.

    Between state p before and q after, that is the time t within 0.5 s of the edge, and within
    the two labels, at which the samples are likeliest:

        sum(log p(x_k), t_k < t) + sum(log q(x_k), t_k >= t)

    Args:
        spans: in order of time.
        times: (n,) of the samples [s].
        probabilities: (n, 3) of no contact, unstable, stable; NaN where there are none.

    Yields:
        One for every two spans that touch.
    """
    likelihood = np.log(np.clip(np.where(np.isnan(probabilities), 1.0, probabilities), FLOOR, 1.0))
    for before, after in pairwise(spans):
        if after.start - before.end > ROUNDING:
            continue
        low = max(before.start, after.start - REACH)
        high = min(after.end, after.start + REACH)
        first, last = np.searchsorted(times, (low - ROUNDING, high - ROUNDING))
        kind = (before.code, after.code)
        ratio = likelihood[first:last, kind[0] - 1] - likelihood[first:last, kind[1] - 1]
        gain = np.concatenate([[0.0], np.cumsum(ratio)])
        places = np.append(times[first:last], high)
        yield Edge(after.start, float(places[gain.argmax()]), low, high, kind)


class Typical(NamedTuple):
    """What the edges of one kind have in common.

    Attributes:
        shift: median of likeliest place minus drawn place [s].
        spread: standard deviation of that, by the median distance from the median [s].
    """

    shift: float
    spread: float


def typical_shifts(edges: Sequence[Edge]) -> dict[Kind, Typical]:
    """How far from where they are drawn the likeliest places of edges usually are, by kind.

    A classifier sees a window of the past, and whoever labels leaves margins: what all edges
    of a kind have in common is no error of one of them.
    """
    shifts: dict[Kind, list[float]] = {}
    for edge in edges:
        shifts.setdefault(edge.kind, []).append(edge.best - edge.at)
    return {kind: _typical(np.array(found)) for kind, found in shifts.items()}


def shift_of(edge: Edge, typical: Typical) -> float:
    """From where an edge is drawn to where it belongs [s]; above 0 is later.

    0 where that is within two standard deviations of what is usual.
    """
    shift = min(max(edge.best - typical.shift, edge.low), edge.high) - edge.at
    return shift if abs(shift) > SPREADS * typical.spread else 0.0


def _typical(shifts: Array) -> Typical:
    median = float(np.median(shifts))
    return Typical(median, NORMAL * float(np.median(np.abs(shifts - median))))
