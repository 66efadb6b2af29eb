"""Commands of a grip controller: values without behaviour."""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

import msgspec


class LoopState(StrEnum):
    """State of the loop.

    IDLE: no grip yet. HOLD: the force does not change. REACT: the force rises.
    RELAX: the force falls. FAULT: the hand holds its last command or opens, see `Limits`.
    """

    IDLE = "IDLE"
    HOLD = "HOLD"
    REACT = "REACT"
    RELAX = "RELAX"
    FAULT = "FAULT"


class GripReason(StrEnum):
    """Reason of a change of force, or of a fault.

    RELEASED: the hand opened, and the grip is over. Of the faults, STALE: no sample in time.
    FROZEN: readings repeat exactly. BEHIND: the loop was not stepped for too long. HAND: the hand
    sends nothing.
    """

    NONE = ""
    UNSTABLE = "unstable"
    SLIP = "slip"
    LOAD = "load"
    MARGIN = "margin"
    RELAX = "relax"
    STALE = "stale"
    FROZEN = "frozen"
    BEHIND = "behind"
    HAND = "hand"
    NOT_FINITE = "not_finite"
    CLOCK = "clock"
    FINGER_FAULT = "finger_fault"
    LOST = "lost"
    RELEASED = "released"
    OVERLOAD = "overload"
    LIMIT = "limit"
    WATCHDOG = "watchdog"


class FingerCommand(msgspec.Struct, frozen=True, gc=False):
    """Command of one finger.

    Attributes:
        scale: force of the finger as a multiple of its force when the grip began. A hand turns
            it into the largest torque of each joint, efforts or set-points.
        reason: why the force rises or falls; empty where it stays.
    """

    scale: float
    reason: GripReason = GripReason.NONE


class GripCommand(msgspec.Struct, frozen=True, gc=False):
    """Command of a hand at one instant.

    Attributes:
        time: time of the update, on the clock of the source [s].
        state: state of the loop.
        fingers: command of each finger.
        release: True if the hand shall open; the scales have no meaning then.
        reason: why the state is FAULT; empty otherwise.
    """

    time: float
    state: LoopState
    fingers: Mapping[str, FingerCommand]
    release: bool = False
    reason: GripReason = GripReason.NONE


class GripEvent(NamedTuple):
    """Change of the loop, for the log: a new state, or the beginning of a rise of force.

    Attributes:
        time: time of the update [s].
        state: state of the loop.
        finger: finger whose force begins to rise; empty for a change of the state alone.
        scale: force scale of that finger, before it rises; NaN for a change of the state alone.
        reason: why.
    """

    time: float
    state: LoopState
    finger: str
    scale: float
    reason: GripReason


def event_texts(events: Sequence[GripEvent], n_fingers: int) -> list[tuple[float, str]]:
    """Return the time [s] and the text of each event; a reaction of several fingers is one.

    Args:
        events: of the same update.
        n_fingers: number of fingers of the grip.

    Example:
        >>> rise = GripEvent(1.0, LoopState.REACT, "thumb", 1.5, GripReason.SLIP)
        >>> state = rise._replace(finger="")
        >>> event_texts([rise, rise._replace(finger="index", scale=1.8), state], 2)
        [(1.0, 'grip REACT: all fingers rise from 1.50 to 1.80 x the first force (slip)')]
    """
    texts = []
    rises: dict[GripReason, list[GripEvent]] = {}
    for event in events:
        if event.finger:
            rises.setdefault(event.reason, []).append(event)
        elif event.state is not LoopState.REACT or not rises:
            why = f" ({event.reason})" if event.reason else ""
            texts.append((event.time, f"grip {event.state}{why}"))
    for reason, rising in rises.items():
        names = [event.finger for event in rising]
        who = "all fingers" if 1 < n_fingers == len(names) else ", ".join(names)
        low, high = (f"{f(event.scale for event in rising):.2f}" for f in (min, max))
        scales = low if low == high else f"{low} to {high}"
        verb = "rises" if len(names) == 1 else "rise"
        text = f"grip REACT: {who} {verb} from {scales} x the first force ({reason})"
        texts.append((rising[0].time, text))
    return texts
