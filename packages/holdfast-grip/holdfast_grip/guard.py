"""Last check of every command before it leaves. It trusts no controller. No I/O, no clock."""

import math
from collections.abc import Mapping

from holdfast_grip.command import FingerCommand, GripCommand, GripReason, LoopState
from holdfast_grip.limits import SLACK, Limits


class CommandGuard:
    """Check of commands against the limits, and limit of their rate.

    A command beyond the limits is replaced by the safe command: the last good scales, or
    release. From then on every command is.

    Args:
        limits: the same as those of the controller.

    Attributes:
        violation: what the first refused command violated; empty if none was.

    Example:
        >>> guard = CommandGuard(Limits(max_scale=2.0))
        >>> bad = GripCommand(0.0, LoopState.HOLD, {"thumb": FingerCommand(7.0)})
        >>> guard.admit(bad).fingers["thumb"].scale, guard.violation
        (1.0, 'thumb: a scale of 7 given, 0.8 to 2 expected')
    """

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.violation = ""
        self._scales: dict[str, float] = {}
        self._checked_at = self._sent_at = self._sent_at_clock = -math.inf
        # State and reason sent last; only a new FAULT is never held back.
        self._sent = LoopState.IDLE, GripReason.NONE

    def admit(self, command: GripCommand, clock: float = math.nan) -> GripCommand | None:
        """Return the command to send.

        Args:
            command: of the controller.
            clock: time now on a clock of the host, which a burst of samples does not advance [s];
                NaN where time passes by the samples alone.

        Returns:
            The command; the safe command in its place; or None if the last one was sent less
            than a period of `Limits.max_rate` ago, on either clock. A new FAULT, or a new reason
            of it, is never held back.
        """
        command = self.check(command)
        # On either clock; a clock that went back, and one of NaN, holds nothing back.
        period = (1.0 - SLACK) / self.limits.max_rate
        early = (
            0.0 <= command.time - self._sent_at < period
            or 0.0 <= clock - self._sent_at_clock < period
        )
        kind = command.state, command.reason
        if early and (command.state is not LoopState.FAULT or kind == self._sent):
            return None
        self._sent_at, self._sent_at_clock, self._sent = command.time, clock, kind
        return command

    def check(self, command: GripCommand) -> GripCommand:
        """Return a command that is not sent, or the safe command in its place."""
        # The first violation stays: later ones may only follow from it.
        self.violation = self.violation or self._violation(command)
        if self.violation:
            # Before the first good command the hand has its own force, a scale of 1.
            names: Mapping[str, object] = self._scales or command.fingers
            fingers = {name: FingerCommand(self._scales.get(name, 1.0)) for name in names}
            release = self.limits.on_fault == "open"
            command = GripCommand(command.time, LoopState.FAULT, fingers, release, GripReason.LIMIT)
        self._scales = {name: target.scale for name, target in command.fingers.items()}
        if math.isfinite(command.time):
            # Never back: the time until the next command would allow a larger rise.
            self._checked_at = max(self._checked_at, command.time)
        return command

    def _violation(self, command: GripCommand) -> str:
        limits = self.limits
        elapsed = command.time - self._checked_at
        # At a time of NaN no rise is allowed.
        elapsed = max(elapsed, 0.0) if math.isfinite(elapsed) else 0.0
        for name, target in command.fingers.items():
            if not limits.min_scale - SLACK <= target.scale <= limits.max_scale + SLACK:
                return (
                    f"{name}: a scale of {target.scale:g} given, {limits.min_scale:g} to "
                    f"{limits.max_scale:g} expected"
                )
            rise = target.scale - self._scales.get(name, 1.0)
            if rise > limits.rise * elapsed + SLACK:
                return (
                    f"{name}: a rise of {rise:g} in {elapsed:g} s given, {limits.rise:g}/s at most"
                )
        return ""


def safe_command(last: GripCommand, reason: GripReason, *, release: bool) -> GripCommand:
    """Return a command that keeps the scales of the last one, or opens the hand."""
    fingers = {name: FingerCommand(target.scale) for name, target in last.fingers.items()}
    return GripCommand(last.time, LoopState.FAULT, fingers, release, reason)
