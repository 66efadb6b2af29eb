"""What was decided about a recording, beside its labels: the input of all metrics."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, enough_contacts, hand_states
from holdfast.sensors.types import Array

Codes = npt.NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class FingerDecisions:
    """The labels of one finger, or of the hand, and what was decided, sample by sample.

    Arrays become read-only.

    Attributes:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the label's state; UNKNOWN where there is none.
        states: (n,) codes of the decided state.
        stable_probability: (n,) that the contact is stable; NaN where the state is UNKNOWN,
            and all NaN for a hand, whose state comes from its fingers'.

    Raises:
        ValueError: the arrays differ in length, or the times do not increase.
    """

    times: Array
    labels: Codes
    states: Codes
    stable_probability: Array

    def __post_init__(self) -> None:
        arrays: dict[str, npt.NDArray[Any]] = {
            "times": np.asarray(self.times, dtype=np.float64),
            "labels": np.asarray(self.labels, dtype=np.int8),
            "states": np.asarray(self.states, dtype=np.int8),
            "stable_probability": np.asarray(self.stable_probability, dtype=np.float64),
        }
        check_lengths(**arrays)
        check_times(arrays["times"])
        for name, array in arrays.items():
            view = array.view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)


@dataclass(frozen=True, eq=False)
class Decisions:
    """What was decided about one recording.

    Attributes:
        name: of the recording.
        fingers: labels and decisions of each finger, each at its own times.
        hand: those of the hand; None where they are not asked for.
    """

    name: str
    fingers: Mapping[str, FingerDecisions]
    hand: FingerDecisions | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "fingers", MappingProxyType(dict(self.fingers)))

    @classmethod
    def of(cls, name: str, fingers: Mapping[str, FingerDecisions], n_model_fingers: int) -> Self:
        """The decisions of a recording, with the hand's made from the fingers'."""
        return cls(name, fingers, hand_decisions(fingers, n_model_fingers))


def hand_decisions(fingers: Mapping[str, FingerDecisions], n_model_fingers: int) -> FingerDecisions:
    """The hand's labels and states out of its fingers', at every time of any finger.

    A finger holds its latest code until its next sample, and is UNKNOWN before its first. The
    hand's code follows from the fingers' codes as in `holdfast.contact.hand_state`, for the
    labels as for the decided states.

    Args:
        fingers: of one recording, each at its own times.
        n_model_fingers: how many fingers the model has.

    Returns:
        Codes at the merged times; the probabilities are NaN.

    Example:
        >>> def finger(times, codes):
        ...     return FingerDecisions(times, codes, codes, np.full(len(times), np.nan))
        >>> thumb = finger([0.0, 0.2], [STABLE, UNSTABLE])
        >>> index = finger([0.1, 0.3], [STABLE, STABLE])
        >>> hand_decisions({"thumb": thumb, "index": index}, 2).states.tolist()
        [0, 3, 2, 2]
    """
    each = list(fingers.values())
    times = np.unique(np.concatenate([np.empty(0), *(finger.times for finger in each)]))
    labels = [_held(finger.times, finger.labels, times) for finger in each]
    states = [_held(finger.times, finger.states, times) for finger in each]
    return FingerDecisions(
        times,
        _hand_states(labels, len(times), n_model_fingers),
        _hand_states(states, len(times), n_model_fingers),
        np.full(len(times), np.nan),
    )


def check_lengths(**arrays: npt.NDArray[Any]) -> None:
    """Refuses arrays that are not of one length.

    Raises:
        ValueError: an array is not (n,), with the same n for all.
    """
    if any(a.ndim != 1 for a in arrays.values()) or len({len(a) for a in arrays.values()}) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"arrays of one shape (n,) expected; given {shapes}")


def check_times(times: Array) -> None:
    """Refuses times that do not increase.

    Raises:
        ValueError: a time is not finite, or not after the one before.
    """
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise ValueError("finite, strictly increasing times expected; these are not")


def _held(times: Array, codes: Codes, at: Array) -> Codes:
    """The latest code at each instant; UNKNOWN before the first."""
    padded = np.concatenate([np.array([UNKNOWN], dtype=np.int8), codes])
    return padded[np.searchsorted(times, at, side="right")]


def _hand_states(codes: list[Codes], n_times: int, n_model_fingers: int) -> Codes:
    """Return the state of the hand at every instant, from (n_times,) codes of each finger."""
    table = np.array(codes, dtype=np.int8).reshape(len(codes), n_times)
    unstable, unknown = (table == UNSTABLE).any(axis=0), (table == UNKNOWN).any(axis=0)
    held = enough_contacts((table == STABLE).sum(axis=0), n_model_fingers)
    return hand_states(unstable, unknown, held)
