"""The words for a contact: states, reasons, causes, phases, estimates and events.

Arrays of states hold codes: the place of the state in `ContactState`. Labels use the same
codes, and an instant without a label is UNKNOWN, so that labels and decisions compare.
"""

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import cache, lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt


class ContactState(StrEnum):
    """What is known of a contact; the code of a state is its place in this list."""

    UNKNOWN = "UNKNOWN"
    NO_CONTACT = "NO_CONTACT"
    UNSTABLE = "UNSTABLE"
    STABLE = "STABLE"

    @property
    def code(self) -> int:
        """The state as a number: its place in the list of states."""
        return _STATES.index(self)


_STATES = tuple(ContactState)
UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = range(len(_STATES))
"""Codes of the states, for arrays."""


class Reason(StrEnum):
    """Why a contact's state is UNKNOWN; the code of a reason is its place in this list."""

    NONE = ""
    TARE = "tare"
    WARM_UP = "warm_up"
    GAP = "gap"
    FAULT = "fault"


class Fault(StrEnum):
    """What is wrong with a finger; bit i of a fault mask is place i here.

    Those up to TARE_DRIFT show in the readings, and the detector finds them. The others show
    in how samples arrive: a source tells them.
    """

    NOT_FINITE = "not_finite"
    STUCK = "stuck"
    SATURATED = "saturated"
    TARE_LOADED = "tare_loaded"
    DEAD = "dead"
    NOISY = "noisy"
    OUT_OF_RANGE = "out_of_range"
    TARE_DRIFT = "tare_drift"
    TAXEL_COUNT = "taxel_count"
    PACKET_GAP = "packet_gap"
    LATE = "late"
    CLOCK_JUMP = "clock_jump"


SIGNAL_FAULTS = tuple(Fault)[:8]
"""Those that show in the readings."""


class Cause(StrEnum):
    """Why a contact is not stable."""

    CLOSING = "closing"
    DISTURBANCE = "disturbance"
    SLIP = "slip"
    LOST = "lost"
    RELEASED = "released"


class Phase(StrEnum):
    """What the experiment was doing."""

    FREE = "free"
    CLOSING = "closing"
    LOCKED = "locked"
    DISTURBED = "disturbed"
    SLIPPING = "slipping"
    RELEASED = "released"


HELD_PHASES = (Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING)
"""Phases in which the hand holds the object."""

LABEL_STATES = (ContactState.STABLE, ContactState.UNSTABLE, ContactState.NO_CONTACT)
"""States that a label can have."""

CONTACT_FORCE = 0.05
"""Force on the object from which a finger counts as touching it [N]."""
SLIP_SPEED = 0.001
"""Sliding speed from which a held contact counts as slipping [m/s]."""
MERGE_GAP = 0.35
"""Two unstable intervals with a shorter gap between them are labelled as one [s]."""
UNSTABLE_MARGIN = 0.1
"""Time by which an unstable interval is extended at both ends [s]."""
MIN_CONTACT_DURATION = 0.1
"""A contact, or a loss of contact, that is shorter is not labelled [s]."""


class ContactEstimate(msgspec.Struct, frozen=True, gc=False):
    """What a detector says of one finger at one sample.

    Attributes:
        time: of the sample [s], on the clock of the source.
        state: UNKNOWN, NO_CONTACT, UNSTABLE or STABLE.
        reason: why the state is UNKNOWN; empty otherwise.
        stable_probability: that the contact is stable; NaN while UNKNOWN.
        instability: sigma, the standard deviation of the Haar details, in the unit of the
            readings; NaN without a full window.
        force: F_tip = (F_x, F_y, F_z) in the fingertip frame, in the unit of the readings.
        faults: what is wrong with the readings, or with how they arrive.
        faulty_taxels: places in the module, from 0, of taxels that are at fault by themselves;
            none where the finger as a whole is.
    """

    time: float
    state: ContactState
    reason: Reason
    stable_probability: float
    instability: float
    force: tuple[float, float, float]
    faults: tuple[Fault, ...] = ()
    faulty_taxels: tuple[int, ...] = ()


class HandEstimate(msgspec.Struct, frozen=True, gc=False):
    """What a detector says of a hand at one instant: its own state, and each finger's.

    Attributes:
        time: of the newest sample [s].
        state: of the hand, see `hand_state`.
        fingers: the latest estimate of every finger of the model.
    """

    time: float
    state: ContactState
    fingers: Mapping[str, ContactEstimate]


class ContactEvent(NamedTuple):
    """A change of a finger's contact state.

    Attributes:
        finger: whose contact it is; "hand" for the hand as a whole.
        state: the state that begins.
        previous: the state that ends.
        time: of the sample at which the new state was reported [s].
    """

    finger: str
    state: ContactState
    previous: ContactState
    time: float


class StateChanges:
    """Find the changes of several contact states, sample by sample or in chunks.

    All states begin as UNKNOWN.

    Args:
        names: of the fingers, in the order of the states.

    Example:
        >>> changes = StateChanges(["thumb"])
        >>> changes.update([ContactState.UNKNOWN], time=0.0)
        []
        >>> (event,) = changes.update([ContactState.STABLE], time=0.1)
        >>> event.finger, event.state.value, event.previous.value, event.time
        ('thumb', 'STABLE', 'UNKNOWN', 0.1)
        >>> len(changes.update_chunk(np.array([0.2, 0.3]), np.array([[STABLE], [UNSTABLE]])))
        1
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._states = [ContactState.UNKNOWN] * len(self._names)

    def update(self, states: list[ContactState], time: float) -> list[ContactEvent]:
        """Return the changes from the previous states to `states` at one sample.

        Args:
            states: one for each name.
            time: of the sample [s].
        """
        previous = self._states
        if states == previous:
            return []
        self._states = states
        return [
            ContactEvent(name, new, old, time)
            for name, new, old in zip(self._names, states, previous, strict=True)
            if new is not old
        ]

    def update_chunk(
        self, times: npt.NDArray[np.float64], codes: npt.NDArray[np.integer[Any]]
    ) -> list[ContactEvent]:
        """Return all changes within consecutive samples, oldest first.

        Args:
            times: (n,) of the samples [s].
            codes: (n, n_names) codes of the states.
        """
        if not len(times):
            return []
        codes = np.vstack([[state.code for state in self._states], codes])
        rows, columns = np.nonzero(codes[1:] != codes[:-1])
        self._states = [_STATES[code] for code in codes[-1]]
        return [
            ContactEvent(self._names[column], _STATES[new], _STATES[old], time)
            for column, new, old, time in zip(
                columns.tolist(),
                codes[rows + 1, columns].tolist(),
                codes[rows, columns].tolist(),
                times[rows].tolist(),
                strict=True,
            )
        ]


def hand_state(codes: npt.NDArray[np.integer[Any]], n_model_fingers: int) -> int:
    """The state of a hand, from the codes of its fingers' states.

    UNSTABLE if any finger is, else UNKNOWN if any is, else STABLE if at least two fingers are
    in contact (one, where the model has one), else NO_CONTACT.

    Args:
        codes: (n_fingers,) state codes.
        n_model_fingers: how many fingers the model has.

    Returns:
        The code of the hand's state.

    Example:
        >>> hand_state(np.array([STABLE, STABLE, NO_CONTACT], dtype=np.int8), 3) == STABLE
        True
    """
    n_stable = 0
    n_unknown = 0
    for code in codes:
        if code == UNSTABLE:
            return UNSTABLE
        n_unknown += code == UNKNOWN
        n_stable += code == STABLE
    if n_unknown > 0:
        return UNKNOWN
    return STABLE if n_stable >= min(2, n_model_fingers) else NO_CONTACT


@cache
def faults_of(mask: int) -> tuple[Fault, ...]:
    """The faults whose bits a mask has, in the order of `Fault`."""
    return tuple(fault for bit, fault in enumerate(Fault) if mask >> bit & 1)


@lru_cache(maxsize=4096)
def taxels_of(mask: int) -> tuple[int, ...]:
    """The taxels whose bits a mask has: bit i is taxel i."""
    return tuple(taxel for taxel in range(mask.bit_length()) if mask >> taxel & 1)


def with_faults(
    estimate: HandEstimate,
    faults: Mapping[str, tuple[Fault, ...]],
    n_model_fingers: int,
    reason: Reason = Reason.FAULT,
) -> HandEstimate:
    """The estimate with what is wrong with how samples arrive.

    Args:
        estimate: by the readings alone.
        faults: of the fingers that become UNKNOWN; of others nothing is known, and they are
            passed over.
        n_model_fingers: how many fingers the model has.
        reason: that those fingers are given.

    Returns:
        The same object where no finger of it is named.

    Example:
        >>> finger = ContactEstimate(1.0, ContactState.STABLE, Reason.NONE, 0.9, 2.0, (1, 0, 0))
        >>> hand = HandEstimate(1.0, ContactState.STABLE, {"thumb": finger})
        >>> late = with_faults(hand, {"thumb": (Fault.LATE,)}, n_model_fingers=1)
        >>> late.state, late.fingers["thumb"].faults
        (<ContactState.UNKNOWN: 'UNKNOWN'>, (<Fault.LATE: 'late'>,))
    """
    named = estimate.fingers.keys() & faults.keys()
    if not named:
        return estimate
    fingers = {
        name: _with_faults(finger, faults[name], reason) if name in named else finger
        for name, finger in estimate.fingers.items()
    }
    codes = np.array([finger.state.code for finger in fingers.values()], dtype=np.int64)
    return HandEstimate(estimate.time, _STATES[hand_state(codes, n_model_fingers)], fingers)


def _with_faults(
    finger: ContactEstimate, faults: tuple[Fault, ...], reason: Reason
) -> ContactEstimate:
    both = {*finger.faults, *faults}
    return msgspec.structs.replace(
        finger,
        state=ContactState.UNKNOWN,
        reason=reason,
        stable_probability=math.nan,
        faults=tuple(fault for fault in Fault if fault in both),
    )
