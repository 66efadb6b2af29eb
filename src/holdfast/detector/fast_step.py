"""One update of a detector in one call: a sample is copied, processed and reported."""

from collections.abc import Callable
from typing import Any, NamedTuple

from numba import config

from holdfast.compiled import compiled_step
from holdfast.detector.address_table import kept_by, reader_of
from holdfast.detector.arrays import REPORT_CODE, STATE, DecisionMemory, DecisionRule
from holdfast.detector.decision_rule import fill_report, hand_code, step
from holdfast.detector.sample_arrays import copy_samples
from holdfast.features.arrays import Flags1, Floats2, Integers1, Layout, Memory, Output
from holdfast.sensors.types import Integers

CHANGED = 4
"""Is added to the state of the hand if any state has changed."""
UNREADABLE = -1
"""Is returned instead of a state if a sample is in a form that `fast_step` cannot read."""


class StepArrays(NamedTuple):
    """All that `fast_step` needs: memory, constants, the sample, and the report that it fills."""

    layout: Layout
    memory: Memory
    output: Output
    rule: DecisionRule
    decision: DecisionMemory
    readings: Floats2  # (n_taxels, 3) of all fingers
    present: Flags1  # (n_fingers,)
    report: Floats2  # (n_fingers, REPORT_WIDTH), by `fill_report`
    known_types: Integers1  # of holdfast.detector.sample_arrays


read_arrays = reader_of(StepArrays)


@compiled_step
@kept_by(StepArrays)
def fast_step(table: Integers, time: float, samples: int) -> int:
    """Process one sample as `step` does, and fill the report.

    Args:
        table: of `StepArrays`, by `table_of`.
        time: of the sample [s].
        samples: address of a tuple with the readings of every finger, which are copied first;
            0 if the readings of some fingers are in the table already.

    Returns:
        The code of the hand's state, plus `CHANGED` if any state has changed; or `UNREADABLE`,
        and nothing has changed.
    """
    layout, memory, output, rule, decision, readings, present, report, known = read_arrays(table)
    if samples != 0:
        if not copy_samples(samples, layout.offsets, known, readings):
            return UNREADABLE
        present[:] = True
    before = hand_code(decision, rule)
    for f in range(len(present)):
        report[f, REPORT_CODE] = decision.codes[f, STATE]
    hand = step(layout, memory, output, rule, decision, readings, present, time)
    changed = hand != before
    for f in range(len(present)):
        changed |= report[f, REPORT_CODE] != decision.codes[f, STATE]
        fill_report(memory, output, decision, report, f)
    return hand + CHANGED * changed


STEP_SIGNATURE = "int64(int64[:, ::1], float64, int64)"


def compiled_fast_step() -> Callable[[Integers, float, int], int]:
    """Return `fast_step` for its argument types, so that a call does not look for them.

    If numba does not compile (`NUMBA_DISABLE_JIT=1`), `Detector.run` works slowly and `update`
    fails: it needs addresses, which only compiled code can read.
    """
    dispatcher: Any = fast_step
    entry: Callable[[Integers, float, int], int] = dispatcher
    if not getattr(config, "DISABLE_JIT", 0):
        entry = dispatcher.compile(STEP_SIGNATURE)
    return entry
