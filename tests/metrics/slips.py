"""Decisions about slips that tests make."""

import math

import numpy as np

from holdfast.metrics.slip_truth import SLIDING, STILL, Slip, SlipDecisions, SlipTruth

RATE = 100.0


def decisions(raised, slips=(), *, seconds=10.0, codes=None, quiet=None, probability=None):
    """Return decisions that are raised in some intervals [s]."""
    n = round(seconds * RATE)
    times = np.arange(n) / RATE
    mask = np.zeros(n, dtype=bool)
    for start, end in raised:
        mask[round(start * RATE) : round(end * RATE)] = True
    if codes is None:
        codes = np.full(n, STILL, dtype=np.int8)
        for slip in slips:
            codes[round(slip.onset * RATE) : round(slip.end * RATE)] = SLIDING
    truth = SlipTruth(codes, codes == STILL if quiet is None else quiet, tuple(slips), "truth")
    values = np.where(mask, 0.9, 0.1) if probability is None else probability
    return SlipDecisions(times, values, mask, 0.0, truth)


def slip(onset=5.0, end=6.0, gross=math.nan, reached=(math.nan, math.nan)):
    return Slip(onset, end, gross, 5e-4 if math.isnan(reached[0]) else 2e-3, reached)
