"""How often what was given a probability was so, in sums that can be pooled."""

from collections.abc import Sequence

import numpy as np

from holdfast.contact import STABLE, UNKNOWN
from holdfast.metrics.decisions import FingerDecisions
from holdfast.sensors.types import Array

N_BINS = 10
"""Of probabilities from 0 to 1."""


def calibration_sums(judged: Sequence[FingerDecisions]) -> Array:
    """What the reliability of probabilities is counted from.

    Args:
        judged: any fingers; samples without a label or a decision are left out.

    Returns:
        (10, 3) for each bin of probabilities: their sum, the samples labelled stable, and all
        samples. Sums over recordings may be added.
    """
    known = [(each, (each.labels != UNKNOWN) & (each.states != UNKNOWN)) for each in judged]
    score = np.concatenate([np.empty(0), *(each.stable_probability[rows] for each, rows in known)])
    stable = np.concatenate([np.empty(0), *(each.labels[rows] == STABLE for each, rows in known)])
    bins = np.clip((score * N_BINS).astype(int), 0, N_BINS - 1)
    columns = (score, stable, np.ones(len(bins)))
    sums = [np.bincount(bins, weights=each, minlength=N_BINS) for each in columns]
    return np.column_stack(sums).astype(np.float64)  # of nothing, bincount gives integers
