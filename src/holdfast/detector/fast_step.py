"""One update of a detector from Python, with all arrays by their addresses in one table.

A compiled function unwraps every array that it receives, at 50 ns each. For the twenty arrays of
a detector that is a fifth of an update. So `fast_step` receives one table of addresses. The
caller must keep the arrays, and must not resize or replace them while the table is in use.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba.np.numpy_support import carray

from holdfast.compiled import compiled_step, compiled_view
from holdfast.detector.decision_rule import (
    CAUSE,
    PROBABILITY,
    STATE,
    UNSTABLE,
    DecisionMemory,
    DecisionRule,
    hand_code,
    step,
)
from holdfast.detector.sample_arrays import KNOWN_TYPES, copy_samples, pointer
from holdfast.features.arrays import (
    FAULTS,
    LAST_TIME,
    REASON,
    SIGMA,
    Array,
    Flags,
    Integers,
    Layout,
    Memory,
    Output,
)

MAX_AXES = 3
REPORT_WIDTH = 7
CHANGED = 4
"""Is added to the state of the hand if any state has changed."""
UNREADABLE = -1
"""Is returned instead of a state if a sample is in a form that `fast_step` cannot read."""


@compiled_step
def estimate_code(state: int, reason: int, faults: int, cause: int) -> int:
    """Return state, reason, faults and cause as one number; `split_code` is the inverse."""
    return state + 4 * (reason + 8 * (faults + 2**16 * cause))


def split_code(code: int) -> tuple[int, int, int, int]:
    """Return state, reason, faults and cause.

    Example:
        >>> split_code(estimate_code(2, 0, 5, 3))
        (2, 0, 5, 3)
    """
    return code % 4, code // 4 % 8, code // 32 % 2**16, code // 2**21


class StepArrays(NamedTuple):
    """All that `fast_step` needs: memory, constants, the sample, and the report that it fills."""

    layout: Layout
    memory: Memory
    output: Output
    rule: DecisionRule
    decision: DecisionMemory
    readings: Array  # (n_taxels, 3) of all fingers
    present: Flags  # (n_fingers,)
    report: Array  # (n_fingers, REPORT_WIDTH) time, estimate code, probability, sigma, force

    def table(self) -> tuple[Integers, list[npt.NDArray[Any]]]:
        """Return the table for `fast_step`, and the arrays that must live as long."""
        layout, rule = self.layout, self.rule
        integers = np.array(
            [layout.tare_kind, rule.n_model_fingers, layout.alike, layout.n_levels], dtype=np.int64
        )
        floats = np.array(
            [layout.tare_seconds, layout.period, rule.hysteresis, rule.min_duration, rule.hold]
        )
        arrays = [
            integers, floats, *layout[:7], *self.memory[:7], *self.output,
            rule.weights, rule.n_weights, rule.limits, *self.decision[:2],
            self.readings, self.present, self.report,
            *layout[11:14], *self.memory[7:12], rule.causes, self.decision.scores, KNOWN_TYPES,
            self.memory.blocks,
        ]  # fmt: skip
        return table_of(arrays), arrays


def table_of(arrays: Sequence[npt.NDArray[Any]]) -> npt.NDArray[np.int64]:
    """Return (n_arrays, 4) the address and the shape of each array.

    Raises:
        ValueError: an array is not contiguous.
    """
    table = np.zeros((len(arrays), 1 + MAX_AXES), dtype=np.int64)
    for row, array in zip(table, arrays, strict=True):
        if not array.flags.c_contiguous:
            raise ValueError("contiguous arrays expected")
        row[0] = array.ctypes.data
        row[1 : 1 + array.ndim] = array.shape
    return table


@compiled_view
def floats1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Return array i of the table: float64, one axis."""
    return carray(pointer(table[i, 0]), (table[i, 1],), np.float64)


@compiled_view
def floats2(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Return array i of the table: float64, two axes."""
    return carray(pointer(table[i, 0]), (table[i, 1], table[i, 2]), np.float64)


@compiled_view
def floats3(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.float64]:
    """Return array i of the table: float64, three axes."""
    shape = (table[i, 1], table[i, 2], table[i, 3])
    return carray(pointer(table[i, 0]), shape, np.float64)


@compiled_view
def integers1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Return array i of the table: int64, one axis."""
    return carray(pointer(table[i, 0]), (table[i, 1],), np.int64)


@compiled_view
def integers2(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Return array i of the table: int64, two axes."""
    return carray(pointer(table[i, 0]), (table[i, 1], table[i, 2]), np.int64)


@compiled_view
def integers3(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.int64]:
    """Return array i of the table: int64, three axes."""
    shape = (table[i, 1], table[i, 2], table[i, 3])
    return carray(pointer(table[i, 0]), shape, np.int64)


@compiled_view
def flags1(table: npt.NDArray[np.int64], i: int) -> npt.NDArray[np.bool_]:
    """Return array i of the table: bool, one axis."""
    return carray(pointer(table[i, 0]), (table[i, 1],), np.bool_)


@compiled_step
def fast_step(table: Integers, time: float, samples: int) -> int:
    """Process one sample as `step` does, and fill the report.

    Args:
        table: of `StepArrays.table`.
        time: of the sample [s].
        samples: address of a tuple with the readings of every finger, which are copied first;
            0 if the readings of some fingers are in the table already.

    Returns:
        The code of the hand's state, plus `CHANGED` if any state has changed; or `UNREADABLE`,
        and nothing has changed.
    """
    kind, numbers = integers1(table, 0), floats1(table, 1)
    layout = Layout(
        integers1(table, 2), floats3(table, 3), floats2(table, 4), integers3(table, 5),
        floats2(table, 6), integers2(table, 7), flags1(table, 8), kind[2] != 0, kind[0],
        numbers[0], numbers[1], integers1(table, 27), floats2(table, 28), floats2(table, 29),
        kind[3],
    )  # fmt: skip
    readings, present, report = floats2(table, 24), flags1(table, 25), floats2(table, 26)
    if samples != 0:
        if not copy_samples(samples, layout.offsets, integers1(table, 37), table[24, 0]):
            return UNREADABLE
        present[:] = True
    memory = Memory(
        floats2(table, 9), floats2(table, 10), floats2(table, 11), floats3(table, 12),
        integers2(table, 13), floats2(table, 14), floats2(table, 15), floats3(table, 30),
        floats2(table, 31), floats3(table, 32), floats2(table, 33), floats3(table, 34),
        floats3(table, 38),
    )  # fmt: skip
    output = Output(floats2(table, 16), floats2(table, 17), integers2(table, 18))
    rule = DecisionRule(
        floats2(table, 19), integers1(table, 20), floats3(table, 35), floats2(table, 21),
        numbers[2], numbers[3], numbers[4], kind[1],
    )  # fmt: skip
    decision = DecisionMemory(integers2(table, 22), floats2(table, 23), floats2(table, 36))
    before = hand_code(decision, rule)
    for f in range(len(present)):
        report[f, 1] = decision.codes[f, STATE]
    hand = step(layout, memory, output, rule, decision, readings, present, time)
    changed = hand != before
    for f in range(len(present)):
        state, status = decision.codes[f, STATE], output.status[f]
        changed |= report[f, 1] != state
        cause = decision.codes[f, CAUSE] if state == UNSTABLE else 0
        report[f, 0] = memory.levels[f, LAST_TIME]
        report[f, 1] = estimate_code(state, status[REASON], status[FAULTS], cause)
        report[f, 2] = decision.values[f, PROBABILITY]
        report[f, 3] = output.values[f, SIGMA]
        for axis in range(3):
            report[f, 4 + axis] = output.values[f, axis]
    return hand + CHANGED * changed


STEP_SIGNATURE = "int64(int64[:, ::1], float64, int64)"


def compiled_fast_step() -> Callable[[Integers, float, int], int]:
    """Return `fast_step` for its argument types: a call need not find them out."""
    dispatcher: Any = fast_step
    entry: Callable[[Integers, float, int], int] = dispatcher.compile(STEP_SIGNATURE)
    return entry
