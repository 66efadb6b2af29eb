"""Contact states, reasons, faults, causes, phases, estimates and events.

Arrays of states hold codes: the position of the state in `ContactState`. Labels use the same
codes. An instant without a label is UNKNOWN, so that labels and decisions can be compared.
"""

import math
from collections.abc import Mapping
from enum import StrEnum
from functools import cache, lru_cache
from numbers import Integral
from typing import Any, NamedTuple, Self

import msgspec
import numpy as np
import numpy.typing as npt


class _Coded(StrEnum):
    """Words that arrays hold as codes. `ContactState(3)` is the state of that code."""

    @classmethod
    def _missing_(cls, value: object) -> Self | None:
        first = cls._first_code()
        if not isinstance(value, Integral) or not first <= int(value) < first + len(cls):
            return None
        return tuple(cls)[int(value) - first]

    @classmethod
    def _first_code(cls) -> int:
        return 0


class ContactState(_Coded):
    """State of a contact. The code of a state is its position in this list.

    Example:
        >>> ContactState(3), Reason(4), Cause(3)
        (<ContactState.STABLE: 'STABLE'>, <Reason.FAULT: 'fault'>, <Cause.SLIP: 'slip'>)
    """

    UNKNOWN = "UNKNOWN"
    NO_CONTACT = "NO_CONTACT"
    UNSTABLE = "UNSTABLE"
    STABLE = "STABLE"

    @property
    def code(self) -> int:
        """Position of the state in the list of states."""
        return _STATES.index(self)


_STATES = tuple(ContactState)
UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = range(len(_STATES))
"""Codes of the states, for arrays."""


class Reason(_Coded):
    """Reason why a state is UNKNOWN, or UNSTABLE whatever the probability of stability.

    LOAD: a large share of the load comes or goes. HOLD: the finger was unstable within the hold
    time of the model, or STABLE has not lasted yet. The code of a reason is its position in this
    list.
    """

    NONE = ""
    TARE = "tare"
    WARM_UP = "warm_up"
    GAP = "gap"
    FAULT = "fault"
    LOAD = "load"
    HOLD = "hold"


class Fault(_Coded):
    """Fault of a finger. Bit i of a fault mask is position i in this list: `Fault(i)`.

    The detector finds the faults up to TARE_DRIFT, and those from OFFSET to REZEROED, in the
    readings. A source reports the others, which concern the arrival of samples.
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
    RATE = "rate"
    OFFSET = "offset"
    REPEATED = "repeated"
    FIELD = "field"
    INVALID = "invalid"
    EQUAL_TAXELS = "equal_taxels"
    COPIED = "copied"
    REZEROED = "rezeroed"
    SLOW = "slow"


class Cause(_Coded):
    """Cause of a contact that is not stable. The first has code 1; 0 is no cause."""

    CLOSING = "closing"
    DISTURBANCE = "disturbance"
    SLIP = "slip"
    LOST = "lost"
    RELEASED = "released"
    GLITCH = "glitch"

    @classmethod
    def _first_code(cls) -> int:
        return 1


CAUSES = tuple(Cause)
"""Causes in the order of their codes, which begin at 1; 0 is no cause."""
SLIP_CODE = CAUSES.index(Cause.SLIP) + 1
"""Code of the cause slip."""


class Phase(StrEnum):
    """Phase of an experiment."""

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
GLITCH_DURATION = 0.1
"""A disturbance that begins within this time after a glitch of the hand's controller has the glitch
as its cause [s]."""


class ContactEstimate(msgspec.Struct, frozen=True, gc=False):
    """Estimate of one finger at one sample.

    Attributes:
        time: time of the sample, on the clock of the source [s].
        state: UNKNOWN, NO_CONTACT, UNSTABLE or STABLE.
        reason: why the state is UNKNOWN, or why it is UNSTABLE although the probability is high;
            else empty.
        stable_probability: probability that the contact is stable; NaN while UNKNOWN.
        instability: sigma, the standard deviation of the Haar details [unit of the readings];
            NaN without a full window.
        force: F_tip = (F_x, F_y, F_z) in the fingertip frame [unit of the readings].
        faults: faults of the readings, or of their arrival. A finger with faults may have a state:
            taxels that carry less than half of its load are left out.
        faulty_taxels: indices in the readings of the module, from 0, of the taxels that are
            faulty by themselves; empty where the finger as a whole is faulty. Documents and
            messages have the numbers of these taxels, from 1 (`sensors.taxel_numbers`).
        cause: the likely cause while UNSTABLE, for a model that tells causes apart; else None.
            With a slip rule it is `slip` whenever the finger is decided to slide, also before
            the state becomes UNSTABLE.
        slip_probability: probability that the finger slides; NaN while UNKNOWN, None for a model
            without a slip rule.
        slip_speed: speed at which the finger slides [mm/s], 0 while it is not decided to slide;
            NaN while UNKNOWN, None for a model without a speed rule.
        slip_distance: distance slid since the slip began, the sum of this speed over time [mm];
            likewise.
    """

    time: float
    state: ContactState
    reason: Reason
    stable_probability: float
    instability: float
    force: tuple[float, float, float]
    faults: tuple[Fault, ...] = ()
    faulty_taxels: tuple[int, ...] = ()
    cause: Cause | None = None
    slip_probability: float | None = None
    slip_speed: float | None = None
    slip_distance: float | None = None

    @property
    def is_dead(self) -> bool:
        """Whether the readings of the finger never changed: it does not count for the hand."""
        return Fault.DEAD in self.faults and not self.faulty_taxels


class HandEstimate(msgspec.Struct, frozen=True, gc=False):
    """Estimate of a hand at one instant: its own state and the estimate of each finger.

    Attributes:
        time: time of the newest sample [s].
        state: state of the hand, see `hand_state`.
        fingers: the latest estimate of every finger of the model.
    """

    time: float
    state: ContactState
    fingers: Mapping[str, ContactEstimate]


class ContactEvent(NamedTuple):
    """Change of the contact state of a finger or of the hand.

    Attributes:
        finger: name of the finger; "hand" for the hand as a whole.
        state: the state that begins.
        previous: the state that ends.
        time: time of the sample at which the new state was reported [s].
    """

    finger: str
    state: ContactState
    previous: ContactState
    time: float


TIME_TOLERANCE = 1e-6
"""Times that differ by less are equal [s]; covers rounding errors of float64."""
LASTING_DURATION = 0.1
"""Time that a state must last to be shown as a change to a person [s]."""


class StateChanges:
    """Find the changes of the contact states of fingers and of the hand.

    With a minimum duration, only changes that lasted are found, without flicker: when the new
    state has lasted so long, with the time at which it began. A state that returns earlier is no
    change. This is for people: for control it comes too late. All states begin as UNKNOWN.

    Args:
        min_duration: minimum time that a new state must last [s].

    Raises:
        ValueError: the duration is negative or not finite.

    Example:
        >>> changes = StateChanges()
        >>> changes.update({"thumb": ContactState.UNKNOWN}, time=0.0)
        []
        >>> (event,) = changes.update({"thumb": ContactState.STABLE}, time=0.1)
        >>> event.finger, event.state.value, event.previous.value, event.time
        ('thumb', 'STABLE', 'UNKNOWN', 0.1)

        Only a change that lasted:

        >>> lasting = StateChanges(min_duration=0.2)
        >>> [len(lasting.update({"thumb": ContactState.STABLE}, t)) for t in (0.0, 0.1, 0.2)]
        [0, 0, 1]
    """

    def __init__(self, min_duration: float = 0.0) -> None:
        if not (math.isfinite(min_duration) and min_duration >= 0):
            raise ValueError(f"a duration of at least 0 s expected, {min_duration} given")
        self._shortest = min_duration - TIME_TOLERANCE
        # By name: the state that was reported, and the latest of all, which may not last, with the
        # time at which it began.
        self._reported: dict[str, ContactState] = {}
        self._latest: dict[str, tuple[ContactState, float]] = {}

    def update(self, states: Mapping[str, ContactState], time: float) -> list[ContactEvent]:
        """Return the changes to `states` at one sample.

        Args:
            states: by name.
            time: of the sample; it does not decrease [s].
        """
        events = []
        for name, state in states.items():
            latest, begin = self._latest.get(name, (ContactState.UNKNOWN, -math.inf))
            if state is not latest:
                begin = time
                self._latest[name] = state, time
            previous = self._reported.get(name, ContactState.UNKNOWN)
            if state is not previous and time - begin >= self._shortest:
                self._reported[name] = state
                # The time at which the state began, not that at which it has lasted.
                events.append(ContactEvent(name, state, previous, begin))
        return events


MIN_HOLDING_FINGERS = 2
"""Fingers in stable contact from which the hand is STABLE; one, for a model of one finger, or where
all others are dead."""


def hand_state(codes: npt.NDArray[np.integer[Any]], n_model_fingers: int, n_dead: int = 0) -> int:
    """Return the state of a hand, from the codes of its fingers' states.

    The state is UNSTABLE if any finger is UNSTABLE, else UNKNOWN if any finger is UNKNOWN, else
    STABLE if at least two fingers are in contact (one, for a model of one finger, or if only one
    is not dead), else NO_CONTACT. Dead fingers do not count, and a hand of these is UNKNOWN. The
    rule is that of `kernel/detector.c`.

    Args:
        codes: (n_fingers,) codes of the states of the fingers that are not dead.
        n_model_fingers: number of fingers of the model.
        n_dead: number of dead fingers.

    Returns:
        The code of the hand's state.

    Example:
        >>> hand_state(np.array([STABLE, STABLE, NO_CONTACT], dtype=np.int8), 3) == STABLE
        True
    """
    unknown = UNKNOWN in codes or (n_dead > 0 and not len(codes))
    n_able = 1 if n_dead and len(codes) == 1 else n_model_fingers
    held = enough_contacts(np.sum(codes == STABLE), n_able)
    return int(hand_states(*np.array([[UNSTABLE in codes], [unknown], [held]]))[0])


def hand_states(
    unstable: npt.NDArray[np.bool_], unknown: npt.NDArray[np.bool_], held: npt.NDArray[np.bool_]
) -> npt.NDArray[np.int8]:
    """Return the states of a hand at many instants, by the rule of `hand_state`.

    Args:
        unstable: (n,) True where a finger is UNSTABLE.
        unknown: (n,) True where a finger is UNKNOWN.
        held: (n,) True where enough fingers are in contact, see `enough_contacts`.

    Returns:
        (n,) codes of the hand's state.

    Example:
        >>> calm = np.array([False, False])
        >>> held = enough_contacts(np.array([1, 2]), n_model_fingers=3)
        >>> hand_states(calm, calm, held).tolist() == [NO_CONTACT, STABLE]
        True
    """
    # UNSTABLE comes first: a finger that slips must not be hidden by one that is UNKNOWN.
    order = [unstable, unknown, held]
    return np.select(order, [UNSTABLE, UNKNOWN, STABLE], NO_CONTACT).astype(np.int8)


def enough_contacts(
    n_contacts: npt.NDArray[np.integer[Any]], n_model_fingers: int | npt.NDArray[np.integer[Any]]
) -> npt.NDArray[np.bool_]:
    """Return where enough fingers are in contact to hold an object.

    Args:
        n_contacts: (n,) number of fingers in contact.
        n_model_fingers: number of fingers of the model; (n,) 1 where only one is not dead.
    """
    return np.asarray(n_contacts >= np.minimum(MIN_HOLDING_FINGERS, n_model_fingers))


@cache
def faults_of(mask: int) -> tuple[Fault, ...]:
    """Return the faults whose bits are set in a mask, in the order of `Fault`."""
    return tuple(fault for bit, fault in enumerate(Fault) if mask >> bit & 1)


MAX_TAXELS = 512
"""Maximum number of taxels of a sensor in a model or a detector: of a mask in the C kernel."""


def taxels_of(words: bytes | npt.NDArray[np.uint64]) -> tuple[int, ...]:
    """Return the indices of the taxels in a mask: bit i % 64 of word i // 64 is taxel i, from 0.

    Example:
        >>> taxels_of(np.array([0b101, 1 << 6], dtype=np.uint64))
        (0, 2, 70)
    """
    return _taxels_of(bytes(words))


@lru_cache(maxsize=4096)
def _taxels_of(words: bytes) -> tuple[int, ...]:
    octets = np.frombuffer(words, np.uint64).astype("<u8").view(np.uint8)
    return tuple(np.flatnonzero(np.unpackbits(octets, bitorder="little")).tolist())


def with_faults(
    estimate: HandEstimate,
    faults: Mapping[str, tuple[Fault, ...]],
    n_model_fingers: int,
    reason: Reason = Reason.FAULT,
) -> HandEstimate:
    """Return the estimate with faults in the arrival of samples added.

    Args:
        estimate: estimate from the readings alone.
        faults: faults of the fingers that become UNKNOWN. Fingers that the estimate does not
            have are ignored.
        n_model_fingers: number of fingers of the model.
        reason: reason that those fingers get.

    Returns:
        The same object if none of its fingers has such a fault.

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
    fingers = dict(estimate.fingers)
    for name in named:
        finger = fingers[name]
        both = {*finger.faults, *faults[name]}
        # All values of an UNKNOWN state are NaN; None stays, as the model has no such rule.
        fingers[name] = msgspec.structs.replace(
            finger,
            state=ContactState.UNKNOWN,
            reason=reason,
            stable_probability=math.nan,
            slip_probability=None if finger.slip_probability is None else math.nan,
            slip_speed=None if finger.slip_speed is None else math.nan,
            slip_distance=None if finger.slip_distance is None else math.nan,
            cause=None,
            faults=tuple(fault for fault in Fault if fault in both),
        )
    states = [finger.state.code for finger in fingers.values() if not finger.is_dead]
    codes, n_dead = np.array(states, dtype=np.int64), len(fingers) - len(states)
    return HandEstimate(estimate.time, _STATES[hand_state(codes, n_model_fingers, n_dead)], fingers)
