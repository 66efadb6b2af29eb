"""The loop: from estimates to a hand, with guard, watchdog and log."""

import math
from collections.abc import Callable
from contextlib import nullcontext, suppress
from types import TracebackType
from typing import Self

from msgspec import structs

from holdfast.contact import HandEstimate
from holdfast.control.command import GripCommand, GripReason, LoopState
from holdfast.control.controller import GripController
from holdfast.control.guard import CommandGuard, safe_command
from holdfast.control.hands import Hand
from holdfast.control.watchdog import Watchdog
from holdfast.errors import HandError

Log = Callable[[str, float], None]
"""Function that gets each event of the loop as a text and its time [s]."""


class GripLoop:
    """Loop that commands one hand, estimate by estimate.

    Leaving it as a context manager sends a last command: the scales as they are after a normal
    end, the safe command after an exception.

    Args:
        controller: makes the commands.
        hand: an open hand; it gets commands only if `armed`.
        armed: whether commands are sent; otherwise it is a dry run.
        watchdog: started watchdog; None for a hand that needs none, as the twin.
        log: gets all events of the loop.

    Attributes:
        last: the last command; None before the first.
        n_sent: number of commands that were sent; a hand gets no command twice, see `Hand`.
    """

    _now = -math.inf

    def __init__(
        self,
        controller: GripController,
        hand: Hand,
        *,
        armed: bool = False,
        watchdog: Watchdog | None = None,
        log: Log | None = None,
    ) -> None:
        self.controller, self.hand, self.armed = controller, hand, armed
        self.guard = CommandGuard(controller.limits)
        self.last: GripCommand | None = None
        self.n_sent = 0
        self._stays_open = False  # after a stop or fault that opened the hand and was ended
        self._watchdog = watchdog
        self._log = log or (lambda text, time: None)

    @property
    def stopped(self) -> bool:
        """Whether `stop` was called, and not `resume` after it."""
        return self.guard.stopped

    def stop(self) -> None:
        """Replace every command by the safe one, from the next step until `resume`.

        It may be called in any thread, also while `step` runs. Only `step` sends: call it next,
        without data with an estimate that has no fingers.
        """
        self.guard.stop()

    def resume(self) -> None:
        """End a stop or a fault, by the decision of a person.

        A hand that was opened is released once more, which ends its grip, and gets no command
        until it holds something again: a reset must not close it.
        """
        self._stays_open = self.last is not None and self.last.release
        self.controller.resume()
        self.guard.resume()

    def step(self, estimate: HandEstimate, time: float) -> GripCommand:
        """Update the controller, check its command and send it.

        Args:
            estimate: the newest estimate, or the last one again.
            time: time now, on the clock of the source [s]. One before that of an earlier step
                counts as the same: a sample may be late by more than the time between two
                steps. If the clock of the source jumps back, its samples become stale.

        Raises:
            HandError: the hand refuses the command, or the watchdog has taken over.
        """
        if self.stopped:
            self.controller.stop()
        if math.isfinite(time):
            self._now = time = max(self._now, time)
        command = self.controller.update(estimate, time)
        for event in self.controller.events():
            self._log(str(event), event.time)
        violated = self.guard.violation
        admitted = self.guard.admit(command)
        if self.guard.violation != violated:
            self._log(f"grip FAULT (limit): {self.guard.violation}", time)
        before, self.last = self.last, admitted or self.last or command
        self._stays_open = self._stays_open and self.last.state is LoopState.IDLE
        if self._stays_open:
            self.last = structs.replace(self.last, release=True)
        repeats = self._stays_open and before is not None and before.state is LoopState.IDLE
        if self.armed:
            self._send(self.last, is_new=admitted is not None and not repeats)
        return self.last

    def _send(self, command: GripCommand, *, is_new: bool) -> None:
        """Send a heartbeat, and the command if it is new."""
        if self._watchdog is not None:
            self._watchdog.beat(command)
        if is_new:
            self.n_sent += self.hand.send(command)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the hand in a safe state."""
        if not self.armed or self.last is None:
            return
        failed = kind is not None and self.controller.limits.on_fault == "open"
        release = failed or self.last.release
        with suppress(HandError) if kind else nullcontext():
            self.hand.send(safe_command(self.last, GripReason.NONE, release=release))
