"""What the page, the recorder and ROS see of a loop that controls the grip of a hand."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Literal, Protocol

from msgspec import Struct

Number = float | None
"""A number, or null if there is none (NaN and infinity are written as null)."""


class GripLimits(Struct, frozen=True, kw_only=True, gc=False):
    """Limits of the controller, see `holdfast.grip.Limits`; null for no limit."""

    min_scale: float
    max_scale: float
    rise: float
    fall: float
    cooldown: float
    max_force: Number
    stale_after: float
    fault_after: float
    recovery: Number
    on_fault: Literal["hold", "open"]
    max_rate: float


class GripFinger(Struct, frozen=True, kw_only=True, gc=False):
    """Newest command of a finger.

    Attributes:
        scale: force as a multiple of that when the grip began.
        highest: highest scale that this finger may get.
        reason: why the force rises or falls; empty where it stays.
    """

    scale: float
    highest: float
    reason: str


class GripEntry(Struct, frozen=True, gc=False):
    """Event of the loop; time on the clock of the source [s]."""

    time: Number
    text: str


class GripFault(Struct, frozen=True, kw_only=True, gc=False):
    """Explanation of a fault for a person, see `holdfast.live.loop.grip_faults`.

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
    """

    hand: str
    law: str
    armed: bool
    limits: GripLimits
    state: str
    reason: str
    stopped: bool
    released: bool
    time: Number
    fingers: dict[str, GripFinger]
    n_sent: int
    failure: str
    events: list[GripEntry]
    fault: GripFault | None = None


GripListener = Callable[[str, float], None]
"""Function that gets each event of a loop as a text, and its time [s]. It must return at once."""


class Grip(Protocol):
    """A loop that runs beside a session."""

    def document(self) -> GripDocument:
        """Return the state."""

    def stop(self) -> "Future[None]":
        """Bring the hand into its safe state at once; the result is there when it was sent."""

    def reset(self) -> "Future[None]":
        """End a stop or a fault."""

    def add_listener(self, listener: GripListener) -> None:
        """Call `listener` with every event from now on."""
