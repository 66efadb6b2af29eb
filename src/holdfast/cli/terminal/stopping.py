"""Stop a running command by Ctrl-C, SIGTERM, or SIGHUP of a closed terminal."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


@dataclass
class StopRequest:
    """Handler of the signals that stop a command.

    Attributes:
        requested: True after the first signal.
        graceful: True if the first signal only sets `requested`. Otherwise every signal raises
            KeyboardInterrupt, and the second one always does.
    """

    requested: bool = False
    graceful: bool = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.requested or not self.graceful:
            raise KeyboardInterrupt
        self.requested = True


@contextmanager
def handle_stop_signals() -> Iterator[StopRequest]:
    """Handle the stop signals inside a `with` block; only in the main thread."""
    stop = StopRequest()
    numbers = _stop_signals() if threading.current_thread() is threading.main_thread() else []
    previous = [(number, signal.signal(number, stop)) for number in numbers]
    try:
        yield stop
    finally:
        for number, handler in previous:
            signal.signal(number, handler)


def _stop_signals() -> list[signal.Signals]:
    """Return the stop signals; without SIGHUP if it is ignored, as under nohup."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    hang_up = getattr(signal, "SIGHUP", None)
    if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
        numbers.append(hang_up)
    return numbers
