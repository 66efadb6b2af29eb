"""Estimated against true causes of a model, sample by sample, while a hand holds the object."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from holdfast.contact import CAUSES, CONTACT_FORCE, SLIP_CODE, UNSTABLE, Cause
from holdfast.detector import detect
from holdfast.metrics.slip_truth import NOT_HELD, SLIDING, STILL, has_slip_truth, slip_truth
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Integers
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.rows import count_row, ratio_row
from holdfast_lab.study.evaluation.error_breakdown import latest_rows

TRUE_CAUSES = (Cause.SLIP.value, Cause.DISTURBANCE.value, "neither")
"""True causes of a sample that is held: the finger slides; an outside force acts and the finger
is still; the finger is still and no outside force acts."""
NO_CAUSE = "none"
ESTIMATED = (NO_CAUSE, *(cause.value for cause in CAUSES))
"""Estimated causes, in the order of their codes."""


def count_causes(model: Model, recording: Recording) -> Integers:
    """Return the number of raised samples by true and by estimated cause.

    A sample is raised if its state is UNSTABLE, or if the finger is decided to slide. Samples
    that creep, between still and sliding, do not count.

    Args:
        model: that estimates.
        recording: with a truth.

    Returns:
        (n_true, n_estimated), in the order of `TRUE_CAUSES` and `ESTIMATED`; 0 without a truth.
    """
    counts = np.zeros((len(TRUE_CAUSES), len(ESTIMATED)), dtype=np.int64)
    truth = recording.truth
    if truth is None or "outside_force" not in truth.hand:
        return counts
    pushed = np.linalg.norm(truth.hand["outside_force"], axis=1) > CONTACT_FORCE
    for finger, trace in detect(model, recording).fingers.items():
        known = slip_truth(recording, finger, trace.times)
        if known is None or not has_slip_truth(truth, finger):
            continue
        still, now = known.codes == STILL, pushed[latest_rows(truth, trace.times)]
        causes = np.select([known.codes == SLIDING, still & now, still], [0, 1, 2], NOT_HELD)
        raised = (trace.state == UNSTABLE) | (trace.cause == SLIP_CODE)
        counted = raised & (causes != NOT_HELD)
        np.add.at(counts, (causes[counted], trace.cause[counted]), 1)
    return counts


def cause_table(models: dict[str, Sequence[Integers]], seed: int = 0) -> ResultTable:
    """Return the shares of the estimated causes of each true cause [%].

    Args:
        models: counts of each recording, see `count_causes`, by name of the model.
        seed: of the bootstrap.
    """
    rows: list[Row] = []
    tables = {
        name: np.array(recordings).reshape(-1, len(TRUE_CAUSES), len(ESTIMATED))
        for name, recordings in models.items()
    }
    is_given = np.any([table.any(axis=(0, 1)) for table in tables.values()], axis=0)
    for (name, table), (k, true_cause) in product(tables.items(), enumerate(TRUE_CAUSES)):
        keys: dict[str, Key] = {"model": name, "true cause": true_cause}
        n_samples = table[:, k].sum(axis=1)
        for j in np.flatnonzero(is_given):
            figure = keys | {"figure": f"{ESTIMATED[j]} [%]"}
            rows.append(ratio_row(figure, table[:, k, j], n_samples, seed))
        rows.append(count_row(keys | {"figure": "samples"}, n_samples.tolist()))
    note = (
        "Of single fingers that hold the object, at samples whose state is UNSTABLE or whose slip "
        "decision is raised: share of each estimated cause. Slip: the finger slides at over "
        "1 mm/s. Disturbance: an outside force acts and the finger is still (below 0.3 mm/s). "
        "Neither: the finger is still and nothing acts on the object, as after a disturbance and "
        "in glitches of the hand's controller."
    )
    lines = ("model", "true cause")
    return ResultTable("causes", "Causes by sample", note, rows, lines, digits_of={"samples": 0})
