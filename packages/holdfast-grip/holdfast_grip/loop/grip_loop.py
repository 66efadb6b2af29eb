"""The loop: from estimates to a hand, with guard, watchdog and log."""

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Self

from msgspec import structs

from holdfast.contact import HandEstimate
from holdfast_grip.command import GripCommand, GripReason, LoopState, event_texts
from holdfast_grip.controller import GripController
from holdfast_grip.errors import HandError
from holdfast_grip.guard import CommandGuard, safe_command
from holdfast_grip.hands import HandDevice
from holdfast_grip.loop.watchdog import Watchdog

MAX_CLOCK_STEP = 0.5
"""Time by which the clock of a source may go ahead from one step to the next [s]. The loop is
stepped while nothing arrives, so a larger step is a jump."""

Log = Callable[[str, float], None]
"""Function that gets each event of the loop as a text and its time [s]."""


class GripLoop:
    """Loop that commands one hand, estimate by estimate.

    Leaving it as a context manager sends a last command: the scales as they are after a normal
    end, the safe command after an exception. Before each command, the watchdog gets a heartbeat;
    without one in time, the loop sends only the safe command.

    Args:
        controller: makes the commands.
        hand: an open hand; it gets commands only if `armed`.
        armed: whether commands are sent; otherwise it is a dry run.
        watchdog: started watchdog; None for a hand that needs none, as the twin.
        log: gets all events of the loop.

    Attributes:
        last: the last command; None before the first.
        n_sent: number of commands that were sent; a hand gets no command twice, see `HandDevice`.
    """

    # Newest time of a step; infinite before the first one.
    _now = -math.inf
    _ahead = math.nan  # the time of the last step, if the clock jumped to it
    # Newest command that left, whose scales the safe command keeps.
    _sent: GripCommand | None = None

    def __init__(
        self,
        controller: GripController,
        hand: HandDevice,
        *,
        armed: bool = False,
        watchdog: Watchdog | None = None,
        log: Log | None = None,
    ) -> None:
        self.controller, self.hand, self.armed = controller, hand, armed
        self.guard = CommandGuard(controller.limits)
        self.last: GripCommand | None = None
        self.n_sent = 0
        self._watchdog = watchdog
        self._log = log or (lambda text, time: None)

    def step(
        self,
        estimate: HandEstimate,
        time: float,
        fault: GripReason = GripReason.NONE,
        clock: float = math.nan,
    ) -> GripCommand:
        """Update the controller, check its command and send it.

        Args:
            estimate: the newest estimate, or the last one again.
            time: time now, on the clock of the source [s]. One before that of an earlier step
                counts as the same: a sample may be late by more than the time between two
                steps. If the clock of the source jumps back, its samples become stale; if it
                jumps ahead, that is a fault, and only the second time in a row is accepted.
            fault: a fault outside the estimates, as that of a loop which is behind.
            clock: time now on a clock of the host, for the highest rate of commands [s]; NaN
                where time passes by the samples alone.

        Raises:
            HandError: the hand refuses the command, the watchdog has taken over, or a finger is
                dead while the grip of an armed loop has not begun.
        """
        if self.armed and self.controller.state is LoopState.IDLE:
            _check_alive(estimate)
        if self.armed and self.hand.silent:
            fault = fault or GripReason.HAND
        for angles in self.hand.joint_reports():
            self.controller.observe(angles)
        self.controller.report(fault)
        command = self._update(estimate, time)
        law = self.controller.law
        if law.notice:
            self._log(f"grip: {law.notice}", command.time)
            law.notice = ""
        violated = self.guard.violation
        admitted = self.guard.admit(command, clock)
        if self.guard.violation != violated:
            self._log(f"grip FAULT (limit): {self.guard.violation}", command.time)
        self.last = admitted or self.last or command
        if self.armed:
            self._beat(self.last)
            if admitted is not None:
                self.n_sent += self.hand.send(self.last)
                self._sent = self.last
                if self._watchdog is not None:
                    # If this process was stopped between heartbeat and command, the watchdog has
                    # taken over before the command left: the loop ends with the safe command.
                    self._watchdog.check()
        return self.last

    def follow(self, estimate: HandEstimate, time: float) -> None:
        """Update the controller with an estimate that is not the newest, and send nothing.

        So a loop that is behind misses no slip, contact or fault, and sends no old command.

        Args:
            estimate: an estimate; a newer one follows at once.
            time: of the estimate, on the clock of the source [s].
        """
        violated = self.guard.violation
        command = self.guard.check(self._update(estimate, time))
        if self.guard.violation != violated:
            self._log(f"grip FAULT (limit): {self.guard.violation}", command.time)

    def make_safe(self) -> None:
        """Send the safe command, and no heartbeat; it makes no difference whether the hand fails.

        It holds the scales that were sent last, not those of a command that never left.
        """
        base = self._sent or self.last
        if not self.armed or base is None:
            return
        release = base.release or self.controller.limits.on_fault == "open"
        # A hand that got no command keeps its own force: only a release is sent to it.
        if release or self._sent is not None:
            with suppress(Exception):
                self.hand.send(safe_command(base, GripReason.NONE, release=release))

    def _update(self, estimate: HandEstimate, time: float) -> GripCommand:
        """Update the controller; return its command, whose time is finite."""
        command = self.controller.update(estimate, self._advance(time))
        n_fingers = len(self.controller.loaded_fingers)
        for at, text in event_texts(self.controller.events(), n_fingers):
            self._log(text, self._finite(at))
        if not math.isfinite(command.time):  # JSON and the messages of hands have no NaN
            command = structs.replace(command, time=self._finite(command.time))
        return command

    def _advance(self, time: float) -> float:
        """Return the time of a step, which never decreases; NaN if the clock jumped ahead."""
        if not math.isfinite(time):
            return math.nan
        # One stamp far ahead is a fault; a second one that continues it is a new clock.
        if -math.inf < self._now < time - MAX_CLOCK_STEP:
            ahead, self._ahead = self._ahead, time
            if not ahead <= time <= ahead + MAX_CLOCK_STEP:
                return math.nan
        self._ahead = math.nan
        self._now = max(self._now, time)
        return self._now

    def _finite(self, time: float) -> float:
        """Return a time, or that of the last good step if it is no number; 0 without one."""
        if math.isfinite(time):
            return time
        return self._now if math.isfinite(self._now) else 0.0

    def _beat(self, command: GripCommand) -> None:
        if self._watchdog is not None:
            self._watchdog.beat(command)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        """Leave the hand in a safe state."""
        if not self.armed or self.last is None:
            return
        if kind is not None:
            self.make_safe()
            return
        try:
            self._beat(self.last)
        except HandError:
            self.make_safe()
            raise
        command = safe_command(self.last, GripReason.NONE, release=self.last.release)
        self.hand.send(command)


def _check_alive(estimate: HandEstimate) -> None:
    """Raise `HandError` if the readings of a finger never changed."""
    if dead := [name for name, finger in estimate.fingers.items() if finger.is_dead]:
        raise HandError(
            f"{', '.join(dead)}: the readings have not changed since the start (dead), so no grip "
            "begins: check the cable, or leave the module out of the source (fingers=...)"
        )
