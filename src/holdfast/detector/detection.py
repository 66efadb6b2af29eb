"""Estimates of a whole recording, as arrays."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    CAUSES,
    Cause,
    ContactEstimate,
    ContactState,
    Fault,
    HandEstimate,
    Reason,
    faults_of,
    taxels_of,
)
from holdfast.detector.arrays import (
    NO_SLIP_RULE,
    NO_SPEED_RULE,
    REPORT_CODE,
    REPORT_DISTANCE,
    REPORT_FORCE,
    REPORT_PROBABILITY,
    REPORT_SIGMA,
    REPORT_SLIP,
    REPORT_SPEED,
    REPORT_TIME,
)
from holdfast.detector.decision_rule import TraceRows, estimate_code, split_code
from holdfast.kernel import _extension
from holdfast.model import FingerModel
from holdfast.sensors.types import Array, Integers

STATE_BY_CODE = tuple(ContactState)
REASON_BY_CODE = tuple(Reason)
CAUSE_BY_CODE: tuple[Cause | None, ...] = (None, *CAUSES)


Decision = tuple[ContactState, Reason, tuple[Fault, ...], Cause | None]


class DecisionCache(dict[float, Decision]):
    """State, reason, faults and cause by the code that the kernel reports, of the codes so far."""

    def __missing__(self, code: float) -> Decision:
        state, reason, faults, cause = split_code(int(code))
        self[code] = (
            STATE_BY_CODE[state], REASON_BY_CODE[reason], faults_of(faults), CAUSE_BY_CODE[cause]
        )  # fmt: skip
        return self[code]


_DECISIONS = DecisionCache()
Name = TypeVar("Name", str, int)


def estimates_of(
    names: Iterable[Name], report: Iterable[Sequence[float]], taxel_masks: Integers
) -> dict[Name, ContactEstimate]:
    """Return the estimates of rows of a report, see `decision_rule.fill_report`.

    Args:
        names: of the rows: fingers, or numbers of samples.
        report: rows of `REPORT_WIDTH` numbers.
        taxel_masks: bits of the faulty taxels of each row.
    """
    estimates: dict[Name, ContactEstimate] = {}
    known = _DECISIONS
    for name, row in zip(names, report, strict=False):
        time, code, probability, sigma, x, y, z, slip, speed, distance = row
        state, reason, faults, cause = known[code]
        taxels = taxels_of(int(taxel_masks[len(estimates)])) if faults else ()
        if speed == NO_SPEED_RULE:
            estimates[name] = ContactEstimate(
                time, state, reason, probability, sigma, (x, y, z), faults, taxels, cause,
                None if slip == NO_SLIP_RULE else slip,
            )  # fmt: skip
        else:
            estimates[name] = ContactEstimate(
                time, state, reason, probability, sigma, (x, y, z), faults, taxels, cause,
                slip, speed, distance,
            )  # fmt: skip
    return estimates


class FingerEstimates(_extension.Estimates, Mapping[str, ContactEstimate]):
    """Estimates of the fingers of a hand by name: made from a copy of C structs when read."""

    __slots__ = ()

    def __reduce__(self) -> tuple[type, tuple[dict[str, ContactEstimate]]]:
        return dict, (dict(self),)

    def __repr__(self) -> str:
        return repr(dict(self))


def makers(fingers: Sequence[str], parts: Sequence[FingerModel]) -> tuple[object, ...]:
    """Return what makes the Python objects of an estimate, in the order of module_detector.c."""
    places = {finger: place for place, finger in enumerate(fingers)}
    return (
        HandEstimate, FingerEstimates, ContactEstimate, STATE_BY_CODE, REASON_BY_CODE,
        CAUSE_BY_CODE, faults_of, taxels_of, places, _slip_heads(parts),
    )  # fmt: skip


def _slip_heads(parts: Sequence[FingerModel]) -> tuple[int, ...]:
    """Return how many heads of slips each finger has: `slip`, and then `slip_speed`."""
    return tuple(
        0 if part.slip is None else 1 if part.head("slip_speed") is None else 2 for part in parts
    )


def rows_of(
    estimates: npt.NDArray[np.void], hand: Array, parts: Sequence[FingerModel]
) -> TraceRows:
    """Return the rows of estimates (n, n_fingers) and states of the hand that C filled."""
    rows = TraceRows.empty(*estimates.shape)
    fields = (estimates[name].astype(np.int64) for name in ("state", "reason", "faults", "cause"))
    rows.report[..., REPORT_CODE] = estimate_code(*fields)
    for column, name in (
        (REPORT_TIME, "time"), (REPORT_PROBABILITY, "probability"), (REPORT_SIGMA, "sigma"),
        (REPORT_SLIP, "slip"), (REPORT_SPEED, "speed"), (REPORT_DISTANCE, "distance"),
    ):  # fmt: skip
        rows.report[..., column] = estimates[name]
    rows.report[..., REPORT_FORCE : REPORT_FORCE + 3] = estimates["force"]
    heads = np.array(_slip_heads(parts))
    has_no_slip, has_no_speed = heads < 1, heads < 2
    rows.report[:, has_no_slip, REPORT_SLIP] = NO_SLIP_RULE
    rows.report[:, has_no_speed, REPORT_SPEED] = NO_SPEED_RULE
    rows.report[:, has_no_speed, REPORT_DISTANCE] = NO_SPEED_RULE
    rows.taxels[...] = estimates["taxels"]
    rows.hand[...] = hand
    return rows


class FingerTrace(NamedTuple):
    """Estimates of one finger over a recording: one row for each sample of its module.

    Attributes:
        times: (n,) [s].
        state: (n,) codes of `ContactState`; `ContactState(code)` is the state.
        reason: (n,) codes of `Reason`; `Reason(code)` is the reason.
        stable_probability: (n,); NaN while UNKNOWN.
        instability: (n,) sigma [unit of the readings].
        force: (n, 3) F_tip in the fingertip frame [unit of the readings].
        faults: (n,) bits in the order of `Fault`; `faults_of(bits)` of `holdfast.contact` are the
            faults.
        faulty_taxels: (n,) bit i is set if the taxel at index i is faulty by itself.
        cause: (n,) codes of the causes while UNSTABLE, or while it slides; 0 for none, of which
            any other is `Cause(code)`.
        slip_probability: (n,); NaN while UNKNOWN. None for a model without a slip rule.
        slip_speed: (n,) speed of the slip [mm/s]; 0 while the finger does not slide, NaN while
            UNKNOWN. None for a model without a speed rule.
        slip_distance: (n,) slid since the slip began [mm]; likewise.
    """

    times: Array
    state: npt.NDArray[np.int8]
    reason: npt.NDArray[np.int8]
    stable_probability: Array
    instability: Array
    force: Array
    faults: npt.NDArray[np.int16]
    faulty_taxels: Integers
    cause: npt.NDArray[np.int8]
    slip_probability: Array | None = None
    slip_speed: Array | None = None
    slip_distance: Array | None = None

    def __len__(self) -> int:
        return len(self.times)

    def estimate(self, k: int) -> ContactEstimate:
        """Return the estimate of sample k."""
        return self.estimates(slice(k, k + 1 or None))[0]

    def estimates(self, rows: slice = slice(None)) -> list[ContactEstimate]:
        """Return the estimates of these samples."""
        fields = (self.state, self.reason, self.faults, self.cause)
        codes = estimate_code(*(field[rows].astype(np.int64) for field in fields))
        slips = [
            np.full(len(self), missing) if column is None else column
            for column, missing in (
                (self.slip_probability, NO_SLIP_RULE),
                (self.slip_speed, NO_SPEED_RULE),
                (self.slip_distance, NO_SPEED_RULE),
            )
        ]
        columns = (self.times, self.stable_probability, self.instability, *self.force.T, *slips)
        times, *numbers = (column[rows] for column in columns)
        report = np.column_stack([times, codes, *numbers]).tolist()
        numbered = estimates_of(range(len(report)), report, self.faulty_taxels[rows])
        return list(numbered.values())


@dataclass(frozen=True)
class Detection:
    """Estimates of a whole recording.

    Attributes:
        name: of the recording.
        fingers: trace of each finger that the recording has.
        times: (n,) instants at which any finger had a sample [s].
        hand: (n,) codes of the hand's state at those instants.
    """

    name: str
    fingers: Mapping[str, FingerTrace]
    times: Array
    hand: npt.NDArray[np.int8]


def detection_of(
    name: str,
    fingers: Sequence[str],
    chunks: Sequence[tuple[Array, npt.NDArray[np.bool_], TraceRows]],
) -> Detection:
    """Join the chunks that the compiled rule filled.

    Args:
        name: of the recording.
        fingers: in the order of the columns.
        chunks: times, present fingers and rows of each chunk.
    """
    if not chunks:
        return Detection(name, {}, np.empty(0), np.empty(0, dtype=np.int8))
    rows = TraceRows(*(np.concatenate(x) for x in zip(*(c[2] for c in chunks), strict=True)))
    times = np.concatenate([chunk[0] for chunk in chunks])
    present = np.concatenate([chunk[1] for chunk in chunks])
    found = {}
    for place, finger in enumerate(fingers):
        own = present[:, place]
        if own.any():
            found[finger] = _trace_of(times[own], rows.report[own, place], rows.taxels[own, place])
    return Detection(name, found, times, rows.hand)


def _trace_of(times: Array, report: Array, taxels: Integers) -> FingerTrace:
    state, reason, faults, cause = split_code(report[:, REPORT_CODE].astype(np.int64))
    return FingerTrace(
        times,
        state.astype(np.int8),
        reason.astype(np.int8),
        report[:, REPORT_PROBABILITY].copy(),
        report[:, REPORT_SIGMA].copy(),
        report[:, REPORT_FORCE : REPORT_FORCE + 3].copy(),
        faults.astype(np.int16),
        taxels,
        cause.astype(np.int8),
        _column(report, REPORT_SLIP, NO_SLIP_RULE),
        _column(report, REPORT_SPEED, NO_SPEED_RULE),
        _column(report, REPORT_DISTANCE, NO_SPEED_RULE),
    )


def _column(report: Array, place: int, missing: float) -> Array | None:
    """Return a copy of a column of the report; None if the model has no rule for it."""
    column = report[:, place].copy()
    return None if (column == missing).any() else column
