"""Estimates of a whole recording, as arrays."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import repeat
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

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
from holdfast.errors import require_extras
from holdfast.kernel import _extension
from holdfast.kernel.structs import Structs, n_mask_words, struct_type
from holdfast.recordings import Recording
from holdfast.sensors import taxel_numbers
from holdfast.sensors.types import Array, Flags

if TYPE_CHECKING:
    from pandas import DataFrame

STATE_BY_CODE = tuple(ContactState)
REASON_BY_CODE = tuple(Reason)
Mask = TypeVar("Mask", int, bytes)
CAUSE_BY_CODE: tuple[Cause | None, ...] = (None, *CAUSES)


class FingerEstimates(_extension.Estimates, Mapping[str, ContactEstimate]):
    """Estimates of the fingers of a hand by name: made from a copy of C structs when read."""

    __slots__ = ()

    def __reduce__(self) -> tuple[type, tuple[dict[str, ContactEstimate]]]:
        return dict, (dict(self),)

    def __repr__(self) -> str:
        return repr(dict(self))


class EstimateTypes(NamedTuple):
    """Objects that the extension uses; it reads them by these names.

    Attributes:
        fingers: index of each finger by its name.
        note: function called with (time, states before, states after) at a change of state.
        hand: type of the estimate of a hand.
        estimates: type of the estimates of its fingers.
        contact: type of the estimate of a finger.
        states: by code, as the two that follow.
        reasons: by code.
        causes: by code.
        faults_of: returns the faults of a mask.
        taxels_of: returns the taxels of a mask.
        array_type: of the samples that it reads without Python.
    """

    fingers: Mapping[str, int]
    note: Callable[[tuple[float, bytes, bytes]], None]
    hand: type[HandEstimate] = HandEstimate
    estimates: type[FingerEstimates] = FingerEstimates
    contact: type[ContactEstimate] = ContactEstimate
    states: tuple[ContactState, ...] = STATE_BY_CODE
    reasons: tuple[Reason, ...] = REASON_BY_CODE
    causes: tuple[Cause | None, ...] = CAUSE_BY_CODE
    faults_of: Callable[[int], tuple[Fault, ...]] = faults_of
    taxels_of: Callable[[int], tuple[int, ...]] = taxels_of
    array_type: type[np.ndarray[Any, Any]] = np.ndarray


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
        faulty_taxels: (n, n_words) bit i % 64 of word i // 64 is set if the taxel at index i is
            faulty by itself; `taxels_of(words)` of `holdfast.contact` are the indices.
        cause: (n,) codes of the causes while UNSTABLE, or while it slides: `Cause(code)`; 0
            without a cause.
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
    faults: npt.NDArray[np.int32]
    faulty_taxels: npt.NDArray[np.uint64]
    cause: npt.NDArray[np.int8]
    slip_probability: Array | None = None
    slip_speed: Array | None = None
    slip_distance: Array | None = None

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        return f"FingerTrace({len(self)} samples)"

    @property
    def is_dead(self) -> Flags:
        """(n,) whether the readings never changed: the finger does not count for the hand."""
        dead = self.faults >> tuple(Fault).index(Fault.DEAD) & 1
        return np.asarray((dead == 1) & ~self.faulty_taxels.any(axis=1))

    def estimate(self, k: int) -> ContactEstimate:
        """Return the estimate of sample k."""
        return self.estimates(slice(k, k + 1 or None))[0]

    def estimates(self, rows: slice = slice(None)) -> list[ContactEstimate]:
        """Return the estimates of these samples."""
        # None instead of a column: the model has no such head.
        slip_columns = (self.slip_probability, self.slip_speed, self.slip_distance)
        slips = (
            repeat(None) if column is None else column[rows].tolist() for column in slip_columns
        )
        columns = (
            column[rows] if column is self.faulty_taxels else column[rows].tolist()
            for column in self[:-3]
        )
        return [
            ContactEstimate(
                time, STATE_BY_CODE[state], REASON_BY_CODE[reason], probability, sigma,
                tuple(force), faults_of(faults), taxels_of(taxels) if faults else (),
                CAUSE_BY_CODE[cause], *slip,
            )
            for time, state, reason, probability, sigma, force, faults, taxels, cause, *slip in zip(
                *columns, *slips, strict=False
            )
        ]  # fmt: skip


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

    def __repr__(self) -> str:
        return f"Detection({self.name!r}, {len(self.times)} samples of {', '.join(self.fingers)})"

    def to_frame(self) -> "DataFrame":
        """Return the estimates as a pandas DataFrame: a row for each finger and sample.

        Rows are in the order of time, then of the fingers. The columns are those of `holdfast
        detect --json`, with `force_x`, `force_y` and `force_z` for the force, and `hand`, the
        state of the hand at that time. States, reasons, causes and faults are words; several
        faults, or numbers of faulty taxels (from 1), are one text with commas. What is not known,
        and what the model does not estimate, is missing (NaN).

        Raises:
            MissingExtra: pandas is not installed.
        """
        require_extras("pandas")
        import pandas as pd

        def words(codes: npt.NDArray[Any], kind: type[StrEnum]) -> Any:  # noqa: ANN401 (of pandas)
            return pd.Categorical.from_codes(codes, [word.value for word in kind])

        def texts(masks: Sequence[Mask], names: Callable[[Mask], Iterable[object]]) -> list[str]:
            text_of_mask = {mask: ", ".join(map(str, names(mask))) for mask in set(masks)}
            return [text_of_mask[mask] for mask in masks]

        parts = []
        for finger, trace in self.fingers.items():
            # A fault of the whole finger names no taxel, as in `ContactEstimate`.
            taxels = np.where(trace.faults[:, None] != 0, trace.faulty_taxels, 0)
            slips = {
                name: nan if getattr(trace, name) is None else getattr(trace, name)
                for name in ("slip_probability", "slip_speed", "slip_distance")
            }
            columns = {
                "time": trace.times,
                "finger": finger,
                "state": words(trace.state, ContactState),
                "reason": words(trace.reason, Reason),
                "stable_probability": trace.stable_probability,
                "instability": trace.instability,
                **{f"force_{axis}": trace.force[:, k] for k, axis in enumerate("xyz")},
                "faults": texts(trace.faults.tolist(), faults_of),
                "faulty_taxels": texts(
                    [words.tobytes() for words in taxels],
                    lambda words: taxel_numbers(taxels_of(words)),
                ),
                "cause": words(trace.cause - 1, Cause),  # -1, which is no cause, is missing
                **slips,
                "hand": words(self.hand[np.searchsorted(self.times, trace.times)], ContactState),
            }
            parts.append(pd.DataFrame(columns))
        return pd.concat(parts).sort_values("time", kind="stable", ignore_index=True)


class Chunk(NamedTuple):
    """Estimates of successive instants that the kernel filled.

    Attributes:
        times: (n,) [s].
        present: (n, n_fingers) True for each finger with a sample at that instant.
        estimates: (n, n_fingers) of `holdfast_finger_estimate`.
        hand: (n,) codes of the hand's state.
    """

    times: Array
    present: Flags
    estimates: npt.NDArray[np.void]
    hand: Array


SPEED_FIELDS = ("slip_speed", "slip_distance")
SMALL_TYPES = {"state": np.int8, "reason": np.int8, "cause": np.int8, "faults": np.int32}
"""Types of fields of a trace that have others in `holdfast_finger_estimate`."""


def detection_of(
    recording: Recording, fingers: Sequence[str], rules: Structs, chunks: Iterable[Chunk]
) -> Detection:
    """Join the chunks of a recording; a chunk is not used after the next one comes.

    Args:
        recording: all its samples are in the chunks.
        fingers: in the order of the columns.
        rules: (n_fingers,) of `holdfast_rule`: without a head, its columns are None.
        chunks: at least one, in order of time.
    """
    # The traces are allocated once, as the number of samples of each finger is known.
    kind, traces = struct_type("holdfast_finger_estimate"), dict[str, FingerTrace]()
    for finger, (_, slip, speed, _) in zip(fingers, rules["heads"]["n_outputs"], strict=True):
        n = recording.modules[finger].n_samples if finger in recording.modules else 0
        if n:
            # A mask has the words that the sensor needs.
            n_words = n_mask_words(recording.modules[finger].sensor.n_taxels)
            shapes = {name: (n, *kind[name].shape) for name in FingerTrace._fields[1:]}
            shapes["faulty_taxels"] = n, n_words
            columns: dict[str, npt.NDArray[Any]] = {
                name: np.empty(shape, SMALL_TYPES.get(name, kind[name].base))
                for name, shape in shapes.items()
                if (slip or name != "slip_probability") and (speed or name not in SPEED_FIELDS)
            }
            traces[finger] = FingerTrace(recording.modules[finger].times, **columns)
    times, hand = list[Array](), list[npt.NDArray[np.int8]]()
    ends = dict.fromkeys(traces, 0)  # rows of each finger that are filled
    for chunk in chunks:
        times.append(chunk.times)
        hand.append(chunk.hand.astype(np.int8))
        for index, finger in enumerate(fingers):
            rows = chunk.estimates[chunk.present[:, index], index]
            if len(rows):
                part = slice(ends[finger], ends[finger] + len(rows))
                ends[finger] = part.stop
                for name, column in traces[finger]._asdict().items():
                    if column is not None and name != "times":
                        used = column.shape[-1] if name == "faulty_taxels" else None
                        column[part] = rows[name][..., :used] if used else rows[name]
    return Detection(recording.name, traces, np.concatenate(times), np.concatenate(hand))
