"""Confident learning (Northcutt 2021): which labels the probabilities contradict, sample by sample.

The probabilities have to come from a classifier that has not seen the sample. A class's
threshold is the mean probability that its own samples get:

    t_j = mean of p(j | x) over the samples labelled j

A label is contradicted where some other class reaches its threshold, and the class with the
highest probability among those that do is not the label's.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNKNOWN
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
