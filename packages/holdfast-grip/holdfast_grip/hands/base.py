"""Base class of hands: checks of commands, and their order."""

import math
import time
from abc import abstractmethod
from collections.abc import Iterable, Sequence

from holdfast.openable import Openable
from holdfast.sensors.types import Array
from holdfast_grip.command import GripCommand, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.limits import Limits

MAX_JOINT_REPORTS = 512
"""Number of newest joint reports that wait for `HandDevice.joint_reports`."""


class HandDevice(Openable):
    """Hand that takes commands. A context manager: entering it connects.

    Only `open` waits for the hand. `send` returns at once. After `close`, the hand keeps the
    last command that it got, so the owner sends a safe one before.

    Attributes:
        name: URI of the hand.
        fingers: fingers that the hand has; None if it takes the commands of any.
        heartbeat: time after which it needs its command again, although nothing changed [s]; None
            if it keeps its last command, and gets each command once.
        needs_idle: whether it needs commands while the loop is IDLE, before the grip begins.
        standby: whether a watchdog opens it, beside the controller of the hand, to release the hand
            if that one dies.
        n_refused: number of messages of the hand that were refused, because they cannot be right.
    """

    name: str = ""
    fingers: tuple[str, ...] | None = None
    heartbeat: float | None = None
    needs_idle: bool = False
    standby: bool = False
    n_refused: int = 0

    # Whether a grip has begun, and what was sent last and when; `send` and `forget` set them.
    _begun = False
    _sent: object = None
    _sent_at = -math.inf

    @property
    def resource(self) -> str:
        """Name of what only one controller may command; the same for all URIs of one hand."""
        return self.name

    @property
    def silent(self) -> bool:
        """Whether an open hand that reports its state has not done so for too long.

        No force changes meanwhile.
        """
        return False

    def joint_reports(self) -> Sequence[Array]:
        """Return the joint angles that the hand has reported since the last call, oldest first.

        Each is (n_joints,), measured, in an order that stays [rad]. None of a hand that reports no
        joints.
        """
        return ()

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check, before anything is sent, that the hand can do what the limits allow.

        Args:
            limits: limits of the commands.
            fingers: fingers that will be commanded.

        Raises:
            ValueError: the hand lacks a finger, or the highest scale exceeds its ceiling.
        """
        if unknown := self._unknown(fingers):
            raise ValueError(unknown)

    @abstractmethod
    def open(self) -> None:
        """Connect.

        Raises:
            HandError: the hand does not answer, or is another one than expected.
        """

    def send(self, command: GripCommand, *, repeat: bool = False) -> bool:
        """Send a command that the hand does not have yet.

        Before the grip begins, a hand gets no command but one that opens it.

        Args:
            command: the command.
            repeat: whether to send it in any case, as a watchdog does that takes over.

        Returns:
            Whether it was sent.

        Raises:
            HandError: the hand refuses it, or is disconnected.
        """
        # Raise `HandError` for a finger that the hand lacks, or a scale that is no force.
        if unknown := self._unknown(command.fingers):
            raise HandError(unknown)
        for finger, target in command.fingers.items():
            if not (math.isfinite(target.scale) and target.scale >= 0.0):
                raise HandError(
                    f"{self.name}: a scale of at least 0 expected, {target.scale:g} given for "
                    f"{finger}"
                )
        self._watch()
        # A fault neither begins a grip nor ends one: the loop may recover with the same grip.
        if command.state is LoopState.IDLE:
            self._begun = False
        elif command.state is not LoopState.FAULT and not self._begun:
            self._begin()
            self._begun, self._sent = True, None
        if not (command.release or self._begun or self.needs_idle or repeat):
            return False
        content, now = self._content(command), time.monotonic()
        is_due = self.heartbeat is not None and now - self._sent_at >= self.heartbeat
        if content == self._sent and not (is_due or repeat):
            return False
        self._sent = None  # not known until it was sent
        self._send(command)
        self._sent, self._sent_at = content, now
        return True

    def forget(self) -> None:
        """Forget the grip and the last command, so that the next one is sent in any case."""
        self._begun, self._sent = False, None

    @abstractmethod
    def _send(self, command: GripCommand) -> None:
        """Send a command that was checked.

        Raises:
            HandError: the hand refuses it, or is disconnected.
        """

    def _watch(self) -> None:
        """Check that the hand answers; called at every command, also if it is not sent.

        Raises:
            HandError: it does not.
        """

    def _begin(self) -> None:
        """Prepare for a grip that begins; called before its first command is sent.

        Raises:
            HandError: the hand cannot take commands for this grip.
        """

    def _content(self, command: GripCommand) -> object:
        """Return what the hand gets of a command: equal for commands that are the same to it."""
        scales = {finger: target.scale for finger, target in command.fingers.items()}
        return command.release, None if command.release else scales

    @abstractmethod
    def close(self) -> None:
        """Disconnect, and `forget` what was sent. It has no effect on a hand that is closed."""

    def _unknown(self, fingers: Iterable[str]) -> str:
        """Return a message about fingers that the hand does not have; empty if there are none."""
        if self.fingers is None:
            return ""
        for finger in fingers:
            if finger not in self.fingers:
                return f"{self.name} has {', '.join(self.fingers)}; {finger!r} commanded"
        return ""
