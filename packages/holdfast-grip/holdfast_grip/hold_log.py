"""Log of `holdfast hold`: lines on the terminal, and the recording of samples and events."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import msgspec

from holdfast.cli.terminal.console import print_line, print_message
from holdfast.devices.sources import Source
from holdfast.live.recorder import Recorder
from holdfast.live.stream_detector import StreamUpdate
from holdfast_grip.command import GripCommand


class HoldLog:
    """Log of the loop: lines on the terminal, and markers of the recording.

    Times of lines are since the first sample.

    Args:
        recorder: records samples and events; None for no recording.
        as_json: print commands as JSON, and no events.
    """

    def __init__(self, recorder: Recorder | None, *, as_json: bool) -> None:
        self._recorder = recorder
        self._as_json = as_json
        self._last: GripCommand | None = None  # the newest that was printed, or is equal to it
        self._state = ""  # of the newest event
        self._origin: float | None = None  # time of the first sample, printed as 0 [s]

    @classmethod
    def open(cls, stack: ExitStack, record: Path | None, source: Source, *, as_json: bool) -> Self:
        """Return the log; its recording is closed by `stack`.

        Raises:
            ValueError: the name of the recording has another suffix.
            OutputError: the file exists already, or cannot be written.
        """
        if record is None:
            return cls(None, as_json=as_json)
        if record.suffix != ".mcap":
            raise ValueError(f"--record: NAME.mcap expected, {record} given")
        recorder = Recorder(record, source.sensors, metadata=dict(source.metadata))
        return cls(stack.enter_context(recorder), as_json=as_json)

    def event(self, text: str, at: float) -> None:
        """Log an event of the loop."""
        if self._recorder is not None:
            self._recorder.add_marker(text, at)
        # A reaction is one line: that the force then stays, and relaxes, follows from it.
        follows = text in ("grip HOLD", "grip RELAX") and self._state in ("HOLD", "REACT", "RELAX")
        self._state = text.split()[1].rstrip(":")
        if not self._as_json and not follows:
            print_line(f"{at - (self._origin or 0.0):9.3f} s  {text}")

    def update(self, update: StreamUpdate, *, wait: bool = False) -> None:
        """Record the samples, and print the notices of the source; a listener of a session."""
        if update.arrival is None:
            return
        if self._origin is None and math.isfinite(update.arrival.time):
            self._origin = update.arrival.time
        for notice in update.arrival.notices:
            print_message(notice)
        if self._recorder is not None:
            self._recorder.put(update.arrival, wait=wait)

    def command(self, command: GripCommand) -> None:
        """Print a command that differs from the last one."""
        last, self._last = self._last, command
        changed = last is None or (last.state, last.fingers) != (command.state, command.fingers)
        if self._as_json and changed:
            print_line(msgspec.json.encode(command).decode())
