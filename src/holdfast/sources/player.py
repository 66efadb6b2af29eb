"""Recordings given out as if they came now: in the order of time, at their own pace."""

import math
import time
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from itertools import chain

from holdfast.errors import HoldfastError, RecordingError
from holdfast.recordings import Recording
from holdfast.sources.base import Arrival, Source, notice_arrival
from holdfast.sources.moments import Moment, moments

PAUSE = 1.0
"""Between the last sample of a recording and the first of the next [s]; a gap to a detector."""


class Player(Source):
    """Plays recordings, one after the other.

    Time begins with the first `read`. Samples are due by the wall clock; who reads late gets
    them at once, and none is lost. The next recording goes on with time, after a pause.

    Args:
        name: what it was asked for by.
        speed: 1 is real time, 2 twice as fast, 0 as fast as samples are taken.
        loop: when a recording is over another begins.

    Raises:
        ValueError: a speed that is negative or not finite.
    """

    def __init__(self, name: str, *, speed: float = 1.0, loop: bool = False) -> None:
        if not (math.isfinite(speed) and speed >= 0):
            raise ValueError(f"a speed of at least 0 expected, {speed} given")
        self.name = name
        self.paced = speed > 0
        self.speed = speed
        self._loops = loop
        self._moments: Iterator[Moment] = iter(())
        self._notices: list[str] = []
        self._forget()

    def open(self) -> None:
        """Reads the beginning of the first recording; again, begins anew.

        Raises:
            RecordingError: it cannot be read, or has no samples.
        """
        self.close()
        try:
            pieces = iter(self._begin(0))
            first = next(pieces, None)
        except OSError as cause:
            raise RecordingError(f"cannot read {self.name}: {cause.strerror or cause}") from cause
        if first is None:
            raise RecordingError(f"{self.name} has no samples; at least one expected")
        self.sensors = {name: module.sensor for name, module in first.modules.items()}
        self.metadata = self._metadata(first)
        if not first.complete:
            self._notices.append(f"{self.name} was cut off; what could be recovered is played")
        self._moments = moments(chain([first], pieces))
        self._goes_on = self._loops

    @property
    def ended(self) -> bool:
        """Whether the last sample was given out; never, where it loops."""
        return not self._goes_on and self._peek() is None

    def read(self, timeout: float) -> Arrival | None:
        """What is due next, or None where nothing is due within `timeout` [s] or it has ended."""
        now = time.monotonic()
        moment = self._peek() or self._next_recording(timeout)
        if moment is None:
            return None
        due = self._due(moment.time, now)
        wait = min(due, now + timeout) - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        return None if due > now + timeout else self._given(moment)

    def close(self) -> None:
        """Lets go of the recording."""
        self._forget()

    @abstractmethod
    def _begin(self, number: int) -> Iterable[Recording]:
        """The pieces of a recording, which are counted from 0; may tell `_notices`."""

    @abstractmethod
    def _metadata(self, first: Recording) -> dict[str, object]:
        """Of the source, given the first piece of its first recording."""

    def _is_ready(self, number: int, timeout: float) -> bool:
        """Whether a recording can begin, within `timeout` [s]."""
        return True

    def _forget(self) -> None:
        self._moments = iter(())
        self._notices.clear()
        self._next: Moment | None = None
        self._goes_on = False
        self._number = 0
        self._shift = 0.0
        self._last = math.nan
        self._began: tuple[float, float] | None = None

    def _peek(self) -> Moment | None:
        """What comes next in this recording."""
        if self._next is None:
            try:
                self._next = next(self._moments, None)
            except (HoldfastError, OSError) as cause:  # after opening, nothing is raised
                self._goes_on = False
                self._next = Moment(self._last - self._shift, {}, f"the rest is lost: {cause}")
        return self._next

    def _next_recording(self, timeout: float) -> Moment | None:
        """The first moment of the next one, where there is one within `timeout` [s]."""
        if not (self._goes_on and self._is_ready(self._number + 1, timeout)):
            return None
        self._number += 1
        self._moments = moments(self._lazily(self._number))
        self._shift = 0.0
        first = self._peek()
        if first is not None and self._goes_on:
            self._shift = self._last + PAUSE - first.time
            # One that was not ready in time is not hurried through.
            now = time.monotonic()
            self._began = max(now, self._due(first.time, now)), self._last + PAUSE
        return first

    def _lazily(self, number: int) -> Iterator[Recording]:
        yield from self._begin(number)

    def _due(self, moment: float, now: float) -> float:
        """When something is due, on the host's clock; minus infinity for at once."""
        if not self.speed:
            return -math.inf
        if self._began is None:
            self._began = now, moment
        began, start = self._began
        return began + (moment + self._shift - start) / self.speed

    def _given(self, moment: Moment) -> Arrival:
        received = time.monotonic()
        if moment.n_refused:
            self._notices.append(f"samples lie back in time: {moment.n_refused} were left out")
        if moment.notice:
            self._notices.append(moment.notice)
        notices = tuple(self._notices)
        self._notices.clear()
        self._next = None
        if not moment.samples:
            return notice_arrival(received, *notices, n_refused=moment.n_refused)
        self._last = moment.time + self._shift
        return Arrival(
            self._last, moment.samples, received, n_refused=moment.n_refused, notices=notices
        )
