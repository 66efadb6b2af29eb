"""Where probabilities contradict labels: sample by sample, and at the edges of labels.

The probabilities must come from a classifier that has not seen the sample.

Samples: confident learning (Northcutt 2021). The threshold of a state is the mean probability
that its own samples get:

    t_j = mean of p(j | x) over the samples labelled j

A label is contradicted if another state reaches its threshold, and the state with the highest
probability among those that do is not the label's.

Edges: the likeliest time of the change from one label to the next.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import TIME_TOLERANCE, UNKNOWN
from holdfast.labelling.review.spans import Span
from holdfast.sensors.types import Array

Codes = npt.NDArray[np.int8]

N_STATES = 3
"""Columns of all probabilities here: no contact, unstable, stable; code = column + 1."""

MAX_EDGE_SHIFT = 0.5
"""Largest distance between an edge and its likeliest time [s]."""

MIN_STATE_PROBABILITY = 0.01
"""Least probability in a likelihood ratio, so that no single sample decides."""

USUAL_DEVIATIONS = 2.0
"""Shifts within this number of standard deviations of the usual shift are usual."""

DEVIATIONS_PER_MEDIAN = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

StateChange = tuple[int, int]
"""Codes of the states before and after an edge."""


def confident_thresholds(labels: npt.NDArray[np.integer[Any]], probabilities: Array) -> Array:
    """Return the mean probability that each state's own samples get.

    Args:
        labels: (n,) codes of the labelled states; UNKNOWN without a label.
        probabilities: (n, 3) of no contact, unstable, stable; NaN if unknown.

    Returns:
        (3,) thresholds; infinite for a state without a labelled sample of known probability.

    Example:
        >>> probabilities = np.array([[0.0, 0.8, 0.2], [0.0, 0.6, 0.4], [0.0, 0.1, 0.9]])
        >>> confident_thresholds(np.array([2, 2, 3]), probabilities).round(3).tolist()
        [inf, 0.7, 0.9]
    """
    known = np.isfinite(probabilities).all(axis=1)
    thresholds = np.full(N_STATES, np.inf)
    for state in range(N_STATES):
        own = known & (labels == state + 1)
        if own.any():
            thresholds[state] = probabilities[own, state].mean()
    return thresholds


def contradictions(
    labels: npt.NDArray[np.integer[Any]], probabilities: Array, thresholds: Array
) -> Codes:
    """Return the expected state of each sample whose label is contradicted.

    Args:
        labels: (n,) codes of the labelled states; UNKNOWN without a label.
        probabilities: (n, 3) of no contact, unstable, stable; NaN if unknown.
        thresholds: (3,) from `confident_thresholds`.

    Returns:
        (n,) codes; UNKNOWN if the label is not contradicted.

    Example:
        >>> labels = np.array([2, 2, 3, 3])
        >>> probabilities = np.array([[0, 0.9, 0.1], [0, 0.1, 0.9], [0, 0.8, 0.2], [0, 0.5, 0.5]])
        >>> contradictions(labels, probabilities, np.array([1.0, 0.7, 0.8])).tolist()
        [0, 3, 2, 0]
    """
    confident = np.where(probabilities >= thresholds, probabilities, -np.inf)  # NaN never is
    expected = confident.argmax(axis=1) + 1
    suspect = np.isfinite(confident).any(axis=1) & (labels != UNKNOWN) & (expected != labels)
    return np.where(suspect, expected, UNKNOWN).astype(np.int8)


class Edge(NamedTuple):
    """The border between two labels of different states.

    Attributes:
        time: of the labels [s].
        likeliest: time by the probabilities [s].
        low: earliest time that is considered [s].
        high: latest time that is considered [s].
        change: codes of the states before and after it.
    """

    time: float
    likeliest: float
    low: float
    high: float
    change: StateChange


def edges_of(spans: Sequence[Span], times: Array, probabilities: Array) -> Iterator[Edge]:
    """Yield the edges of labels, each with its likeliest time.

    Between state p before and q after, that is the time t within 0.5 s of the edge, and within
    the two labels, that maximizes the likelihood of the samples:

        sum(log p(x_k), t_k < t) + sum(log q(x_k), t_k >= t)

    Args:
        spans: in order of time.
        times: (n,) of the samples [s].
        probabilities: (n, 3) of no contact, unstable, stable; NaN if unknown.

    Yields:
        An edge for every two adjacent spans.
    """
    # An unknown sample has a log likelihood of 0 under both states, so that it decides nothing.
    known = np.where(np.isnan(probabilities), 1.0, probabilities)
    likelihood = np.log(np.clip(known, MIN_STATE_PROBABILITY, 1.0))
    for before, after in pairwise(spans):
        if after.start - before.end > TIME_TOLERANCE:
            continue
        low = max(before.start, after.start - MAX_EDGE_SHIFT)
        high = min(after.end, after.start + MAX_EDGE_SHIFT)
        first, last = np.searchsorted(times, (low - TIME_TOLERANCE, high - TIME_TOLERANCE))
        change = (before.code, after.code)
        ratio = likelihood[first:last, change[0] - 1] - likelihood[first:last, change[1] - 1]
        gain = np.concatenate([[0.0], np.cumsum(ratio)])
        candidates = np.append(times[first:last], high)
        yield Edge(after.start, float(candidates[gain.argmax()]), low, high, change)


class UsualShift(NamedTuple):
    """The shift that edges between the same two states have in common.

    Attributes:
        median: of the likeliest time minus the time of the label [s].
        deviation: standard deviation, from the median absolute deviation [s].
    """

    median: float
    deviation: float


def usual_shifts(edges: Sequence[Edge]) -> dict[StateChange, UsualShift]:
    """Return the usual shift of edges, by change of state.

    Classifiers see a window of the past, and people leave margins. A shift that all edges of a
    change have in common is therefore no error of a single edge.
    """
    shifts: dict[StateChange, list[float]] = {}
    for edge in edges:
        shifts.setdefault(edge.change, []).append(edge.likeliest - edge.time)
    usual = {}
    for change, found in shifts.items():
        # Medians: the errors that are looked for must not move what is usual.
        median = float(np.median(found))
        apart = float(np.median(np.abs(np.array(found) - median)))
        usual[change] = UsualShift(median, DEVIATIONS_PER_MEDIAN * apart)
    return usual


def unusual_shift(edge: Edge, usual: UsualShift) -> float:
    """Return the shift of an edge beyond the usual one [s]; above 0 if it belongs later.

    The result is 0 if the shift is within two standard deviations of the usual one.
    """
    shift = min(max(edge.likeliest - usual.median, edge.low), edge.high) - edge.time
    return shift if abs(shift) > USUAL_DEVIATIONS * usual.deviation else 0.0
