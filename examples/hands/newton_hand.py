"""A hand of your own: it takes the force of each finger in newtons, as lines of JSON over UDP.

Copy the file, and replace `_write` by what talks to your hand. `HandDevice` already sends nothing
before the grip begins, sends no command twice, and refuses fingers and scales that cannot be.
"""

import json
import math
import socket
import time
from collections.abc import Iterable
from contextlib import suppress

from holdfast_grip import GripCommand, HandDevice, Limits
from holdfast_grip.errors import HandError

FINGERS = ("thumb", "index", "middle", "ring")
"""Fingers of the hand, named as in the estimates."""


class NewtonHand(HandDevice):
    """Hand that takes the force of each finger [N]; 0 opens it.

    Args:
        address: host and port of the hand.
        start_force: force of each finger when the grip begins, at a scale of 1 [N].
        max_force: highest force of a finger that the hand can give [N].
        deadband: change of a force that the hand does not follow [N].
        rate: most commands per second that the hand takes [Hz].

    Raises:
        ValueError: a number is out of range.

    Example:
        >>> hand = NewtonHand(("127.0.0.1", 5005), start_force=2.0, max_force=5.0)
        >>> hand.check(Limits(max_scale=3.0), ["thumb"])
        Traceback (most recent call last):
        ValueError: newtons:127.0.0.1:5005: at most 5 N expected, 6 N given at max_scale 3: lower it
    """

    fingers = FINGERS

    def __init__(
        self,
        address: tuple[str, int],
        *,
        start_force: float,
        max_force: float,
        deadband: float = 0.05,
        rate: float = 50.0,
    ) -> None:
        self.name = f"newtons:{address[0]}:{address[1]}"
        for name, value in (("start_force", start_force), ("max_force", max_force), ("rate", rate)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{self.name}: {name}: above 0 expected, {value:g} given")
        if not 0.0 <= deadband < start_force:
            raise ValueError(
                f"{self.name}: deadband: 0 to below {start_force:g} N expected, {deadband:g} given"
            )
        self._address, self._socket = address, None
        self._start_force, self._max_force = start_force, max_force
        self._deadband, self._period = deadband, 1.0 / rate

    _socket: socket.socket | None

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the fingers, and the force at the highest scale, before anything is sent."""
        super().check(limits, fingers)
        highest = self._start_force * limits.max_scale
        if highest > self._max_force:
            raise ValueError(
                f"{self.name}: at most {self._max_force:g} N expected, {highest:g} N given at "
                f"max_scale {limits.max_scale:g}: lower it"
            )

    def open(self) -> None:
        """Connect. Only this may wait; a hand that answers is asked here who it is."""
        self.close()
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            self._socket.connect(self._address)
        except OSError as cause:
            self.close()
            raise HandError(f"{self.name}: {cause.strerror}") from cause

    def close(self) -> None:
        """Disconnect. It has no effect on a hand that is closed."""
        self.forget()
        if self._socket is not None:
            with suppress(OSError):
                self._socket.close()
        self._socket = None

    def _watch(self) -> None:
        if self._socket is None:
            raise HandError(f"{self.name} is not open")

    def _content(self, command: GripCommand) -> object:
        """Return the forces to send [N], or those sent last where the hand would not follow.

        What is held back here is compared again at the next command, so no rise is lost.
        """
        if command.release:
            return dict.fromkeys(FINGERS, 0.0)
        forces = self._forces(command)
        sent = self._sent
        if not isinstance(sent, dict) or not any(sent.values()):
            return forces
        is_early = time.monotonic() - self._sent_at < self._period
        is_small = forces.keys() == sent.keys() and all(
            abs(force - sent[finger]) < self._deadband for finger, force in forces.items()
        )
        return sent if is_early or is_small else forces

    def _forces(self, command: GripCommand) -> dict[str, float]:
        """Return the force of each finger [N]."""
        return {name: self._start_force * one.scale for name, one in command.fingers.items()}

    def _send(self, command: GripCommand) -> None:
        forces = dict.fromkeys(FINGERS, 0.0) if command.release else self._forces(command)
        for finger, force in forces.items():
            if force > self._max_force:
                raise HandError(
                    f"{self.name}: {finger}: at most {self._max_force:g} N expected, {force:g} N "
                    "given"
                )
        self._write(forces)

    def _write(self, forces: dict[str, float]) -> None:
        """Write the forces [N] to the hand. It must return at once."""
        try:
            if self._socket is not None:
                self._socket.send(json.dumps(forces).encode())
        except OSError as cause:
            raise HandError(f"{self.name}: {cause.strerror}") from cause
