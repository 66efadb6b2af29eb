"""Estimated against true causes of a model, sample by sample, while a hand holds the object."""

from collections.abc import Sequence

import numpy as np

from holdfast.contact import CAUSES, CONTACT_FORCE, SLIP_CODE, UNSTABLE, Cause
from holdfast.detector import detect
from holdfast.metrics.slip_truth import (
    NOT_HELD,
    SLIDING,
    STILL,
    has_slip_truth,
    slip_truth,
)
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Integers
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.comparison.rows import ratio_row

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
        place = np.clip(np.searchsorted(truth.times, trace.times, side="right") - 1, 0, None)
        causes = np.select(
            [known.codes == SLIDING, (known.codes == STILL) & pushed[place], known.codes == STILL],
            [0, 1, 2],
            default=NOT_HELD,
        )
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
    for name, table in tables.items():
        for k, true_cause in enumerate(TRUE_CAUSES):
            keys: dict[str, Key] = {"model": name, "true cause": true_cause}
            whole = table[:, k].sum(axis=1)
            for j, estimated in enumerate(ESTIMATED):
                if is_given[j]:
                    figure = {"figure": f"{estimated} [%]"}
                    rows.append(ratio_row(keys | figure, table[:, k, j], whole, seed))
            n_samples = Row(keys | {"figure": "samples"}, float(whole.sum()), None, len(whole))
            rows.append(n_samples)
    note = (
        "Of single fingers that hold the object, at samples whose state is UNSTABLE or whose slip "
        "decision is raised: share of each estimated cause. Slip: the finger slides at over "
        "1 mm/s. Disturbance: an outside force acts and the finger is still (below 0.3 mm/s). "
        "Neither: the finger is still and nothing acts on the object, as after a disturbance and "
        "in glitches of the hand's controller."
    )
    digits = {"samples": 0}
    return ResultTable(
        "causes", "Causes by sample", note, rows, ("model", "true cause"), digits_of=digits
    )
