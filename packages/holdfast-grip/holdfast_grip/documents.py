"""Documents of the grip loop, for the live page and other programs."""

from typing import TYPE_CHECKING

from msgspec import Struct

from holdfast.live.documents import Number, document_type
from holdfast_grip.command import FingerCommand, GripReason, LoopState
from holdfast_grip.limits import Limits

if TYPE_CHECKING:
    GripLimits = Limits

    class GripFinger(FingerCommand, frozen=True, kw_only=True):
        """Command of a finger, see below."""

        highest: float

else:
    GripLimits = document_type(
        "GripLimits",
        Limits,
        "Limits of the controller, see `holdfast_grip.Limits`; null for no limit.",
        nullable=lambda name: name == "recovery",
    )
    GripFinger = document_type(
        "GripFinger",
        FingerCommand,
        """Newest command of a finger.

    Attributes:
        scale: force as a multiple of that when the grip began.
        highest: highest scale that this finger may get.
        reason: why the force rises or falls; empty where it stays.
    """,
        added=[("highest", float)],
        at=1,
    )


class GripEntry(Struct, frozen=True, gc=False):
    """Event of the loop; time on the clock of the source [s]."""

    time: Number
    text: str


class GripFault(Struct, frozen=True, kw_only=True, gc=False):
    """Explanation of a fault for a person, see `holdfast_grip.loop.grip_faults`.

    Attributes:
        reason: of the fault; "ended" if the loop has ended for good.
        happened: what happened, and what it means.
        commanded: what the hand is commanded now.
        continues: what goes on without a reset.
        reset: what a reset does.
    """

    reason: str
    happened: str
    commanded: str
    continues: str
    reset: str


class GripDocument(Struct, frozen=True, kw_only=True, gc=False):
    """State and newest command of the loop.

    Attributes:
        hand: URI of the hand.
        law: name of the law of grip force.
        armed: whether commands are sent; otherwise it is a dry run.
        limits: of the controller.
        state: IDLE, HOLD, REACT, RELAX or FAULT.
        reason: why the state is FAULT; empty otherwise.
        stopped: whether the loop was stopped, and not reset after it.
        released: whether the hand is commanded to be open.
        time: of the newest command, on the clock of the source [s]; null before the first.
        fingers: newest command of each finger.
        n_sent: number of commands that were sent.
        failure: why the loop has ended for good; empty while it runs.
        events: newest events, oldest first.
        fault: explanation of the fault; null if there is none.
        waiting: what the hand lacks before the grip begins; empty from when it has begun.
    """

    hand: str
    law: str
    armed: bool
    limits: GripLimits
    state: LoopState
    reason: GripReason
    stopped: bool
    released: bool
    time: Number
    fingers: dict[str, GripFinger]
    n_sent: int
    failure: str
    events: list[GripEntry]
    fault: GripFault | None = None
    waiting: str = ""
