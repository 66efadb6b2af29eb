"""The end of what goes on until somebody has enough: Ctrl-C, SIGTERM, a terminal that is gone."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType


@dataclass
class Stop:
    """Whether a signal asked for the end.

    Attributes:
        asked: whether one did.
        gently: whether the first one only asks; else, and from the second on, it interrupts.
    """

    asked: bool = False
    gently: bool = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Takes a signal."""
        if self.asked or not self.gently:
            raise KeyboardInterrupt
        self.asked = True


@contextmanager
def stopping() -> Iterator[Stop]:
    """Takes the signals that ask for the end; in the main thread, where signals are."""
    stop = Stop()
    numbers = ending_signals() if threading.current_thread() is threading.main_thread() else []
    before = [(number, signal.signal(number, stop)) for number in numbers]
    try:
        yield stop
    finally:
        for number, handler in before:
            signal.signal(number, handler)


def ending_signals() -> list[signal.Signals]:
    """Those that ask for the end; not that of a terminal that goes, where nohup ignores it."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    hang_up = getattr(signal, "SIGHUP", None)
    if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
        numbers.append(hang_up)
    return numbers
