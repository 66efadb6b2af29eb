"""Arrivals go to disk in a thread of their own, so that whoever reads a source never waits."""

import math
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import Any, NamedTuple, Self

from holdfast.contact import Fault
from holdfast.errors import OutputError
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.live.recording_buffer import RecordingBuffer
from holdfast.sensors import Sensor
from holdfast.sources import Arrival

FLUSH_SECONDS = 0.2
"""What was given is on disk after this time, and the time that writing takes [s]."""
MOST_WAITING = 4096
"""So many arrivals wait for the disk at most: some 30 MB of a whole hand, 27 s at 150 Hz."""

_MOST_MARKERS = 1024
"""Markers may wait beyond the arrivals."""
_PIECE = 64
"""Arrivals that are written at a time."""
_BREATH = 1e-4
"""A pause between the modules of a piece, in which other threads go on [s]."""
_RATE_OVER = 1.0


class RecorderStatus(NamedTuple):
    """How far a recorder is.

    Attributes:
        seconds: from the first to the newest sample [s].
        n_samples: instants with samples.
        modules: samples of each module.
        rate: instants that came over the last second, by the host's clock [Hz].
        n_gaps: steps longer than three periods, of the module that has most.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that made no sense.
        n_dropped: samples that were not kept, or not whole: the disk was too slow, or the file
            cannot hold them.
        n_bytes: length of the file so far.
        n_markers: that were set, by people and by faults.
        faults: how many arrivals told of each.
        faulty: the faults of each module within the last second.
        failure: why nothing is written any more; empty while all is well.
    """

    seconds: float
    n_samples: int
    modules: Mapping[str, int]
    rate: float
    n_gaps: int
    n_lost: int
    n_refused: int
    n_dropped: int
    n_bytes: int
    n_markers: int
    faults: Mapping[Fault, int]
    faulty: Mapping[str, tuple[Fault, ...]]
    failure: str


class _Marker(NamedTuple):
    time: float
    text: str


class Recorder:
    """Records what arrives from a source to MCAP; a kill loses at most half a second.

    `put` and `mark` return at once, whatever the disk does: a thread writes what they were
    given, and flushes it every 0.2 s, also when the source falls silent. Where the disk is so
    slow that too much waits, samples are dropped, counted, and told in a marker. Faults and
    notices of the source become markers as well. It is a context manager, for any thread.

    Args:
        path: of the MCAP file.
        sensors: of the modules to be recorded; others are left out.
        name: of the recording; that of the file where it is not given.
        metadata: as in `Recording`.
        force: replace what is at `path`.

    Attributes:
        path: of the file.

    Raises:
        OutputError: the file exists already or cannot be written.
        RecordingError: the metadata are no plain JSON values.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import numpy as np
        >>> from holdfast.io import load_recording
        >>> from holdfast.sensors import sensor
        >>> with TemporaryDirectory() as folder:
        ...     with Recorder(f"{folder}/a.mcap", {"thumb": sensor("anyskin")}) as recorder:
        ...         recorder.put(Arrival(0.0, {"thumb": np.zeros((5, 3))}, received=0.0))
        ...         recorder.mark("grasped")
        ...     load_recording(f"{folder}/a.mcap").markers
        ((0.0, 'grasped'),)
    """

    def __init__(
        self,
        path: str | Path,
        sensors: Mapping[str, Sensor],
        *,
        name: str | None = None,
        metadata: Mapping[str, Any] | None = None,
        force: bool = False,
    ) -> None:
        self.path = Path(path)
        self._writer = RecordingWriter(path, sensors, name=name, metadata=metadata, force=force)
        self._file = _identity(self.path)
        self._intake = RecordingBuffer(sensors)
        self._queue: deque[Arrival | _Marker] = deque()
        self._newest = math.nan
        self._n_overflown = self._n_told = self._n_markers = 0
        self._n_bytes = self._writer.n_bytes
        self._rate = 0.0
        self._counts = deque([(time.monotonic(), 0)])
        self._failure: Exception | None = None
        self._closing = False
        self._wake = Event()
        self._thread = Thread(target=self._run, name="holdfast-recorder", daemon=True)
        self._thread.start()

    @property
    def failed(self) -> bool:
        """Whether the disk has refused, so that nothing is written any more."""
        return self._failure is not None

    @property
    def status(self) -> RecorderStatus:
        """How far it is."""
        intake = self._intake
        began = math.isfinite(intake.first)
        return RecorderStatus(
            seconds=intake.newest - intake.first if began else 0.0,
            n_samples=intake.n_samples,
            modules={name: track.n_samples for name, track in intake.tracks.items()},
            rate=self._rate,
            n_gaps=max((track.n_gaps for track in intake.tracks.values()), default=0),
            n_lost=intake.n_lost,
            n_refused=intake.n_refused,
            n_dropped=self._n_overflown + intake.n_unfit,
            n_bytes=self._n_bytes,
            n_markers=self._n_markers,
            faults=dict(intake.faults),
            faulty=intake.faulty(time.monotonic()),
            failure=str(self._failure or ""),
        )

    def put(self, arrival: Arrival, *, patient: bool = False) -> None:
        """Records an arrival; returns at once.

        Args:
            arrival: as a source gives it; its arrays must not be written to any more.
            patient: wait rather than drop where too much waits for the disk; for sources that
                can be waited for.
        """
        while patient and len(self._queue) >= MOST_WAITING and self._thread.is_alive():
            self._wake.set()
            time.sleep(_BREATH)
        if len(self._queue) >= MOST_WAITING or self._closing or self._failure:
            self._n_overflown += bool(arrival.samples)
            return
        if arrival.samples:
            self._newest = arrival.time
        self._queue.append(arrival)

    def mark(self, text: str, time: float | None = None) -> None:
        """Sets a marker; returns at once.

        Args:
            text: what happened.
            time: when [s]; at the newest sample where it is not given.
        """
        if len(self._queue) < MOST_WAITING + _MOST_MARKERS:
            self._queue.append(_Marker(self._newest if time is None else time, text))

    def close(self) -> None:
        """Writes what is left and ends the file; again, it does nothing.

        Raises:
            OutputError: the disk refused, or the file was removed; what was written stays.
        """
        if self._closing:
            return
        self._closing = True
        self._wake.set()
        self._thread.join()
        try:
            self._writer.close()
            self._check_file()
        except OutputError as failure:
            self._failure = self._failure or failure
        self._n_bytes = self._writer.n_bytes
        if self._failure:
            raise self._failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _run(self) -> None:
        """Writes until the end; what goes wrong waits for `close` to be raised."""
        try:
            while not self._closing:
                self._wake.wait(FLUSH_SECONDS)
                self._wake.clear()
                self._drain()
            self._drain()
        except Exception as failure:
            self._failure = failure
            self._queue.clear()

    def _drain(self) -> None:
        """Writes what waits now; what comes meanwhile is for the next time."""
        left = len(self._queue)
        while left:
            n = min(left, _PIECE)
            self._write([self._queue.popleft() for _ in range(n)])
            left -= n
        self._tell_dropped()
        self._write_markers()
        self._writer.flush()
        self._check_file()
        self._count()

    def _write(self, piece: list[Arrival | _Marker]) -> None:
        for one in piece:
            if isinstance(one, _Marker):
                self._intake.mark(*one)
            else:
                self._intake.take(one)
        for module, track in self._intake.tracks.items():
            times, readings = track.drain()
            if len(times):
                self._writer.append(module, times, readings)
                time.sleep(_BREATH)
        self._write_markers()

    def _write_markers(self) -> None:
        for when, text in self._intake.drain_markers():
            self._writer.mark(when, text, at_once=False)
            self._n_markers += 1

    def _tell_dropped(self) -> None:
        """A marker where samples are missing because the disk was too slow."""
        n = self._n_overflown - self._n_told
        if n:
            self._n_told += n
            self._intake.mark(self._newest, f"note: {n} samples dropped: the disk is too slow")

    def _check_file(self) -> None:
        if _identity(self.path) != self._file:
            raise OutputError(f"cannot write {self.path}: it was removed while it was recorded")

    def _count(self) -> None:
        """The rate, as seen from the host."""
        self._n_bytes = self._writer.n_bytes
        counts = self._counts
        counts.append((time.monotonic(), self._intake.n_samples))
        while len(counts) > 2 and counts[-1][0] - counts[1][0] >= _RATE_OVER:
            counts.popleft()
        (begin, before), (end, after) = counts[0], counts[-1]
        self._rate = (after - before) / (end - begin) if end > begin else 0.0


def _identity(path: Path) -> tuple[int, int] | None:
    """Which file is at `path`; None where none is."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
