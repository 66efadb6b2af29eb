"""Confident learning (Northcutt 2021): which labels the probabilities contradict, sample by sample.

The probabilities have to come from a classifier that has not seen the sample. A class's
threshold is the mean probability that its own samples get:

    t_j = mean of p(j | x) over the samples labelled j

A label is contradicted where some other class reaches its threshold, and the class with the
highest probability among those that do is not the label's.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNKNOWN
from holdfast.labelling.review.spans import TIME_TOLERANCE, Span
from holdfast.sensors.types import Array

Codes = npt.NDArray[np.int8]

N_STATES = 3
"""No contact, unstable, stable: the columns of all probabilities here; code = column + 1."""


def confident_thresholds(labels: npt.NDArray[np.integer[Any]], probabilities: Array) -> Array:
    """The mean probability that each state's own samples get.

    Args:
        labels: (n,) codes of the labels' states; UNKNOWN where there is none.
        probabilities: (n, 3) of no contact, unstable, stable; NaN where there are none.

    Returns:
        (3,) thresholds; infinite for a state that no judged sample is labelled with.

    Example:
        >>> probabilities = np.array([[0.0, 0.8, 0.2], [0.0, 0.6, 0.4], [0.0, 0.1, 0.9]])
        >>> confident_thresholds(np.array([2, 2, 3]), probabilities).round(3).tolist()
        [inf, 0.7, 0.9]
    """
    judged = np.isfinite(probabilities).all(axis=1)
    thresholds = np.full(N_STATES, np.inf)
    for state in range(N_STATES):
        own = judged & (labels == state + 1)
        if own.any():
            thresholds[state] = probabilities[own, state].mean()
    return thresholds


def contradictions(
    labels: npt.NDArray[np.integer[Any]], probabilities: Array, thresholds: Array
) -> Codes:
    """The state that a sample's probabilities stand for, where that is not the label's.

    Args:
        labels: (n,) codes of the labels' states; UNKNOWN where there is none.
        probabilities: (n, 3) of no contact, unstable, stable; NaN where there are none.
        thresholds: (3,) from `confident_thresholds`.

    Returns:
        (n,) codes; UNKNOWN where the label is not contradicted.

    Example:
        >>> labels = np.array([2, 2, 3, 3])
        >>> probabilities = np.array([[0, 0.9, 0.1], [0, 0.1, 0.9], [0, 0.8, 0.2], [0, 0.5, 0.5]])
        >>> contradictions(labels, probabilities, np.array([1.0, 0.7, 0.8])).tolist()
        [0, 3, 2, 0]
    """
    confident = np.where(probabilities >= thresholds, probabilities, -np.inf)  # NaN is never
    likely = confident.argmax(axis=1) + 1
    suspect = np.isfinite(confident).any(axis=1) & (labels != UNKNOWN) & (likely != labels)
    return np.where(suspect, likely, UNKNOWN).astype(np.int8)


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
        if after.start - before.end > TIME_TOLERANCE:
            continue
        low = max(before.start, after.start - REACH)
        high = min(after.end, after.start + REACH)
        first, last = np.searchsorted(times, (low - TIME_TOLERANCE, high - TIME_TOLERANCE))
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
