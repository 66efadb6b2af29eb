"""Source of a recording: at its own speed, faster, or as fast as it is read."""

import heapq
import math
import time
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from itertools import chain
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.devices.sources.base import MARKER_PREFIX, Arrival, Source, notice_arrival
from holdfast.errors import HoldfastError, RecordingError
from holdfast.io import read_chunks
from holdfast.recordings import Recording

SAMPLES_PER_CHUNK = 1024
"""Samples of a module to read at a time; it bounds the memory."""
PAUSE = 1.0
"""Time between the last sample of a recording and the first of the next [s]; a detector
recognizes it as a gap."""
MIN_LOOP_SAMPLES = 512
"""Samples of a recording that is repeated, from which on no detector takes it for repeated readings
of a sensor, even if it loses the pause."""
RESTART_WAIT = 2.0
"""Longest wait for the next recording when a client begins it [s]; clients wait 5 s for samples."""


class TimedSamples(NamedTuple):
    """Content of a recording at one instant: samples or a marker.

    Attributes:
        time: time on the clock of the recording [s]; later than that of all earlier samples.
        samples: (n_taxels, 3) by module; empty for a marker.
        notice: text of the marker.
        n_refused: number of samples left out before this, because they are out of order.
    """

    time: float
    samples: Mapping[str, npt.NDArray[Any]]
    notice: str = ""
    n_refused: int = 0


def timed_samples(chunks: Iterable[Recording]) -> Iterator[TimedSamples]:
    """Yield the content of consecutive chunks in order of time, in bounded memory.

    Samples with the same time form one item. A marker follows the samples of its time. A marker
    before the first or after the last sample is moved to that sample.

    Args:
        chunks: parts of a recording, as from `read_chunks`.

    Raises:
        RecordingError: as `chunks` does, after all content before that.
        OSError: as `chunks` does, after all content before that.
    """
    first, last = math.inf, -math.inf
    # Markers after the samples so far: a chunk may bring those of later times.
    markers: list[tuple[float, str]] = []
    n_refused = 0
    try:
        for chunk in chunks:
            instants, n_old = _instants(chunk, last)
            n_refused += n_old
            markers = sorted([*markers, *chunk.markers], key=itemgetter(0))
            if instants:
                first, last = min(first, instants[0].time), instants[-1].time
                instants[0] = instants[0]._replace(n_refused=n_refused)
                n_refused = 0
                due = [_notice(max(at, first), text) for at, text in markers if at <= last]
                markers = [marker for marker in markers if marker[0] > last]
                yield from heapq.merge(instants, due, key=attrgetter("time"))
    except (RecordingError, OSError):
        yield from _rest(markers, last, n_refused)
        raise  # after the markers of what could be read
    yield from _rest(markers, last, n_refused)


def _instants(chunk: Recording, last: float) -> tuple[list[TimedSamples], int]:
    """Return the samples of a chunk after `last` [s], in order of time, and how many are not."""
    new = {name: module.times > last for name, module in chunk.modules.items()}
    own_times = {name: module.times[new[name]] for name, module in chunk.modules.items()}
    times = reduce(np.union1d, own_times.values(), np.empty(0))
    samples: list[dict[str, npt.NDArray[Any]]] = [{} for _ in times]
    for name, module in chunk.modules.items():
        readings = module.readings[new[name]]
        native = readings.astype(readings.dtype.newbyteorder("="), copy=False)
        for k, sample in zip(np.searchsorted(times, own_times[name]).tolist(), native, strict=True):
            samples[k][name] = sample
    n_old = sum(int((~mask).sum()) for mask in new.values())
    return list(map(TimedSamples, times.tolist(), samples)), n_old


def _rest(
    markers: Iterable[tuple[float, str]], last: float, n_refused: int
) -> Iterator[TimedSamples]:
    """Yield the markers after the last sample [s], and samples of the end that were left out."""
    yield from (_notice(last, text) for _, text in markers)
    if n_refused:
        yield TimedSamples(last, {}, n_refused=n_refused)


def _notice(time: float, text: str) -> TimedSamples:
    return TimedSamples(time, {}, f"{MARKER_PREFIX}{' '.join(text.split())}")


class Player(Source):
    """Source that plays recordings, one after the other.

    Time begins with the first `read`. Samples are due by the wall clock. A late reader gets
    them at once, and none is lost. The times of the next recording follow after a pause.

    Args:
        name: path or URI of the source.
        speed: 1 is real time, 2 is twice as fast, 0 is as fast as samples are read.
        loop: play another recording at the end.

    Attributes:
        hint: what to know about a recording that is repeated; set by `open`.

    Raises:
        ValueError: the speed is negative or not finite.
    """

    def __init__(self, name: str, *, speed: float = 1.0, loop: bool = False) -> None:
        if not (math.isfinite(speed) and speed >= 0):
            raise ValueError(f"a speed of at least 0 expected, {speed} given")
        self.name, self.hint = name, ""
        self.paced = speed > 0
        self.speed = speed
        self._loops = loop
        self._content: Iterator[TimedSamples] = iter(())
        self._notices: list[str] = []
        self._reset()

    def _reset(self) -> None:
        self._content = iter(())
        self._notices.clear()
        self._next: TimedSamples | None = None  # the item that `_peek` has read
        self._continues = False
        self._number = 0
        # From times of the recording to times of the source, which go on from one recording to
        # the next; and the time of the last samples of the source.
        self._shift = 0.0
        self._last = math.nan
        # When the recording began, by the host's clock and by the source's; set with the first
        # item that is due, and by each new recording.
        self._start: tuple[float, float] | None = None

    def open(self) -> None:
        """Read the beginning of the first recording.

        Raises:
            RecordingError: it cannot be read, or has no samples.
        """
        self.close()
        try:
            chunks = iter(self.chunks_of(0))
            first = next(chunks, None)
        except OSError as cause:
            raise RecordingError(f"cannot read {self.name}: {cause.strerror or cause}") from cause
        if first is None:
            raise RecordingError(f"{self.name} has no samples; at least one expected")
        self.sensors = {name: module.sensor for name, module in first.modules.items()}
        self.metadata = self.metadata_of(first)
        n_samples = max(module.n_samples for module in first.modules.values())
        self.hint = ""
        if self._loops and n_samples < MIN_LOOP_SAMPLES:
            self.hint = (
                f"{self.name} has {n_samples} samples, less than {MIN_LOOP_SAMPLES}: its end meets "
                f"its begin after {PAUSE:g} s; without that pause it is `repeated`"
            )
        if not first.complete:
            self._notices.append(f"{self.name} was cut off; what could be recovered is played")
        self._content = timed_samples(chain([first], chunks))
        self._continues = self._loops

    @property
    def ended(self) -> bool:
        """Whether the last sample was read; never if it loops."""
        return not self._continues and self._peek() is None

    def read(self, timeout: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout` [s] or at the end."""
        # Before the next item is read from disk: that time counts as waiting.
        now = time.monotonic()
        item = self._peek()
        if item is None and self._continues and self.is_ready(self._number + 1, timeout):
            self._number += 1
            item = self._begin(self._late_chunks(self._number))
        if item is None:
            return None
        due = self._due(item.time, now)
        wait = min(due, now + timeout) - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        if due > now + timeout:  # the item stays for the next read
            return None
        received = time.monotonic()
        if item.n_refused:
            self._notices.append(f"{item.n_refused} samples are out of order and were left out")
        if item.notice:
            self._notices.append(item.notice)
        notices = tuple(self._notices)
        self._notices.clear()
        self._next = None
        if not item.samples:
            return notice_arrival(received, *notices, n_refused=item.n_refused)
        self._last = item.time + self._shift
        return Arrival(
            self._last, item.samples, received, n_refused=item.n_refused, notices=notices
        )

    def restart(self) -> None:
        """Play the next recording; time continues after a pause.

        The current one is played again if it has only begun, or if the next is not ready in time.
        """
        if math.isnan(self._last):
            return
        # Two clients that connect together get the same recording, not its successor.
        only_begun = self._start is None or self._last <= self._start[1]
        if only_begun or not (self._continues and self.is_ready(self._number + 1, RESTART_WAIT)):
            self._begin(self.same_chunks())
        else:
            self._number += 1
            self._begin(self._late_chunks(self._number))

    def close(self) -> None:
        """Release the recording."""
        self._reset()

    @abstractmethod
    def chunks_of(self, number: int) -> Iterable[Recording]:
        """Return the chunks of recording `number`, from 0. May add to `_notices`."""

    @abstractmethod
    def metadata_of(self, first: Recording) -> dict[str, object]:
        """Return the metadata of the source, given the first chunk of the first recording."""

    def is_ready(self, number: int, timeout: float) -> bool:
        """Return whether recording `number` can begin within `timeout` [s]."""
        return True

    def _peek(self) -> TimedSamples | None:
        """Return the next item of this recording."""
        if self._next is None:
            try:
                self._next = next(self._content, None)
            except (HoldfastError, OSError) as cause:  # only opening raises
                self._continues = False
                self._next = TimedSamples(
                    self._last - self._shift, {}, f"the rest is lost: {cause}"
                )
        return self._next

    def _begin(self, chunks: Iterable[Recording]) -> TimedSamples | None:
        """Continue with a recording from its beginning, after a pause. Return its first item."""
        self._content = timed_samples(chunks)
        self._next = None
        self._shift = 0.0
        first = self._peek()
        if first is not None and first.samples:  # else it cannot be read
            self._shift = self._last + PAUSE - first.time
            # A recording that was not ready in time still plays at its own speed.
            now = time.monotonic()
            self._start = max(now, self._due(first.time, now)), first.time + self._shift
        return first

    def same_chunks(self) -> Iterator[Recording]:
        """Yield the chunks of the current recording once more."""
        yield from self.chunks_of(self._number)

    def _late_chunks(self, number: int) -> Iterator[Recording]:
        """Yield the chunks of a recording; errors occur at the first one, in `_peek`."""
        yield from self.chunks_of(number)

    def _due(self, at: float, now: float) -> float:
        """Return when an item is due, on the host's clock; minus infinity for at once [s]."""
        if not self.speed:
            return -math.inf
        if self._start is None:
            self._start = now, at
        began, start = self._start
        return began + (at + self._shift - start) / self.speed


class ReplaySource(Player):
    """Source that plays one recording.

    Its markers become notices. An incomplete recording plays as far as it can be recovered.

    Args:
        path: path of the recording.
        speed: 1 is real time, 2 is twice as fast, 0 is as fast as samples are read.
        loop: start again at the end; time continues.

    Raises:
        ValueError: the speed is negative or not finite.

    Example:
        >>> with Replay("grasp.parquet", speed=0) as source:  # doctest: +SKIP
        ...     print(sum(len(arrival.samples) for arrival in source))
    """

    def __init__(self, path: str | Path, *, speed: float = 1.0, loop: bool = False) -> None:
        super().__init__(str(path), speed=speed, loop=loop)

    def chunks_of(self, number: int) -> Iterable[Recording]:
        """Return the chunks of the file, with a notice if it is repeated."""
        chunks = read_chunks(self.name, SAMPLES_PER_CHUNK, labels=False)
        if number:
            self._notices.append(f"{self.name} starts again")
        return chunks

    def metadata_of(self, first: Recording) -> dict[str, object]:
        """Return the metadata of the recording, with this source and the original one."""
        metadata = dict(first.metadata)
        recorded_from = {"recorded_from": metadata["source"]} if "source" in metadata else {}
        return metadata | recorded_from | {"source": self.name}
