"""Decisions about a recording, with its labels: the input of all metrics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, enough_contacts, hand_states
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.truth_labels import Onsets, common_onsets
from holdfast.sensors.types import Array, Flags

Codes = npt.NDArray[np.int8]


@dataclass(frozen=True, eq=False)
class FingerDecisions:
    """Labels and decided states of one finger, or of the hand, sample by sample.

    Arrays become read-only.

    Attributes:
        times: (n,) strictly increasing [s].
        labels: (n,) codes of the labelled states; UNKNOWN without a label.
        states: (n,) codes of the decided states.
        stable_probability: (n,) probability that the contact is stable; NaN if the state is
            UNKNOWN. All NaN for a hand: its state follows from the states of its fingers.
        exact_labels: (n,) codes of the states by the truth, or by a rule without its margin; None
            if neither is known. Events are found in them, because a person draws labels with a
            margin around a disturbance.
        onsets: where the exact labels come from.
        slip: decisions about slips; None for a hand, or a model without a slip rule.
        dead: (n,) whether the finger is dead, and does not count for the hand; None for never.

    Raises:
        ValueError: the lengths of the arrays differ, or the times do not increase.
    """

    times: Array
    labels: Codes
    states: Codes
    stable_probability: Array
    exact_labels: Codes | None = None
    slip: SlipDecisions | None = None
    onsets: Onsets = "truth"
    dead: Flags | None = None

    def __post_init__(self) -> None:
        arrays: dict[str, npt.NDArray[Any]] = {
            "times": np.asarray(self.times, dtype=np.float64),
            "labels": np.asarray(self.labels, dtype=np.int8),
            "states": np.asarray(self.states, dtype=np.int8),
            "stable_probability": np.asarray(self.stable_probability, dtype=np.float64),
        }
        if self.exact_labels is not None:
            arrays["exact_labels"] = np.asarray(self.exact_labels, dtype=np.int8)
        if self.dead is not None:
            arrays["dead"] = np.asarray(self.dead, dtype=np.bool_)
        check_lengths(**arrays)
        check_times(arrays["times"])
        for name, array in arrays.items():
            view = array.view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)


@dataclass(frozen=True, eq=False)
class Decisions:
    """Decisions about one recording.

    Attributes:
        name: of the recording.
        fingers: labels and decisions of each finger, at its own times.
        hand: labels and decisions of the hand; None if they are not needed.
    """

    name: str
    fingers: Mapping[str, FingerDecisions]
    hand: FingerDecisions | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "fingers", MappingProxyType(dict(self.fingers)))

    @classmethod
    def of(cls, name: str, fingers: Mapping[str, FingerDecisions], n_model_fingers: int) -> Self:
        """Return the decisions about the fingers and the hand of a recording."""
        return cls(name, fingers, hand_decisions(fingers, n_model_fingers))

    @property
    def known_slips(self) -> dict[str, SlipDecisions]:
        """Decisions about the slips of each finger whose slips are known."""
        slips = {name: finger.slip for name, finger in self.fingers.items()}
        return {name: slip for name, slip in slips.items() if slip and slip.truth}


def hand_decisions(fingers: Mapping[str, FingerDecisions], n_model_fingers: int) -> FingerDecisions:
    """Return the labels and states of a hand, at every time of any finger.

    A finger keeps its latest code until its next sample, and is UNKNOWN before its first. The
    code of the hand follows from those of the fingers as in `holdfast.contact.hand_state`, for
    the labels, for the decided states, and for the exact labels if all fingers have them.

    Args:
        fingers: of one recording, each at its own times.
        n_model_fingers: number of fingers of the model.

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
    hand = list(fingers.values())
    times = np.unique(np.concatenate([np.empty(0), *(finger.times for finger in hand)]))

    def latest(values: Sequence[npt.NDArray[Any] | None]) -> npt.NDArray[np.int8]:
        # (n_fingers, n) latest value of each finger at each instant: index 0, before its first
        # sample, is UNKNOWN, or not dead.
        table = np.zeros((len(hand), len(times)), dtype=np.int8)
        for row, finger, finger_values in zip(table, hand, values, strict=True):
            if finger_values is not None:
                at = np.searchsorted(finger.times, times, side="right")
                row[:] = np.concatenate([[UNKNOWN], finger_values])[at]
        return table

    def of_hand(codes: Sequence[Codes], dead: Flags) -> Codes:
        table, n_alive = latest(codes), (~dead).sum(axis=0)
        unknown = ((table == UNKNOWN) & ~dead).any(axis=0) | dead.all(axis=0)
        is_last = dead.any(axis=0) & (n_alive == 1)
        n_contacts, n_able = (table == STABLE).sum(axis=0), np.where(is_last, 1, n_model_fingers)
        held = enough_contacts(n_contacts, n_able)
        return hand_states((table == UNSTABLE).any(axis=0), unknown, held)

    dead = latest([finger.dead for finger in hand]) != 0
    labels = of_hand([finger.labels for finger in hand], np.zeros_like(dead))
    # Exact labels of some fingers alone would mix events of two kinds in the hand.
    exact = [finger.exact_labels for finger in hand if finger.exact_labels is not None]
    return FingerDecisions(
        times,
        labels,
        of_hand([finger.states for finger in hand], dead),
        np.full(len(times), np.nan),
        of_hand(exact, np.zeros_like(dead)) if hand and len(exact) == len(hand) else None,
        onsets=common_onsets({finger.onsets for finger in hand}),
    )


def check_lengths(**arrays: npt.NDArray[Any]) -> None:
    """Check that all arrays are one-dimensional and have the same length.

    Raises:
        ValueError: an array is not (n,), or n differs.
    """
    if any(a.ndim != 1 for a in arrays.values()) or len({len(a) for a in arrays.values()}) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"arrays of one shape (n,) expected; given {shapes}")


def check_times(times: Array) -> None:
    """Check that times increase.

    Raises:
        ValueError: a time is not finite, or not later than the previous one.
    """
    if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
        raise ValueError("finite, strictly increasing times expected; the given times are not")
