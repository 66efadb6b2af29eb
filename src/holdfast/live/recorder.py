"""Write arrivals to disk in a separate thread, so that reading a source never waits."""

import math
import re
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from holdfast.contact import Fault
from holdfast.devices.sources import Arrival
from holdfast.errors import OutputError
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.live.arrival_buffer import ArrivalBuffer
from holdfast.openable import Closable
from holdfast.sensors import Sensor

if TYPE_CHECKING:
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamUpdate

FLUSH_INTERVAL = 0.2
"""Time between two writes to disk [s]."""
SYNC_INTERVAL = 0.5
"""Time between two waits for the disk with `fsync`; the first write after it waits [s]. With
`FLUSH_INTERVAL`, a power failure loses at most 0.7 s and one wait (docs/study/reliability.md)."""
MAX_QUEUED_ARRIVALS = 4096
"""Maximum number of arrivals that wait for the disk: some 30 MB of a whole hand, or 27 s at
150 Hz."""

_MAX_QUEUED_MARKERS = 1024
"""Number of markers that may wait in addition to the arrivals."""
_CHUNK_SIZE = 64
"""Number of arrivals written at a time."""
_YIELD_TIME = 1e-4
"""Pause after each module of a chunk, so that other threads can run [s]."""
_RATE_PERIOD = 1.0
"""Period over which the rate is measured [s]."""
_N_CLOCK_ARRIVALS = 256
"""Newest arrivals of which the quickest gives the time of the session: 1.7 s at 150 Hz."""
_FILE_NAME = re.compile(r"\w[\w .-]{0,99}", re.ASCII)


class RecorderStatus(NamedTuple):
    """Progress of a recorder.

    Attributes:
        seconds: from the first to the newest sample [s].
        n_samples: instants with samples.
        modules: number of samples of each module.
        rate: instants received over the last second, by the host's clock [Hz].
        n_gaps: time steps longer than three periods, of the module that has most.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that could not be decoded.
        n_dropped: instants that were not stored completely: the disk was too slow, or the file
            format cannot hold the samples.
        n_bytes: size of the file so far.
        n_markers: markers written, of people and of faults.
        faults: number of arrivals that reported each fault.
        recent_faults: the faults of each module within the last second.
        failure: why writing has stopped; empty if it has not.
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
    recent_faults: Mapping[str, tuple[Fault, ...]]
    failure: str

    def document(self) -> dict[str, Any]:
        """Return the progress of a finished recording as JSON values."""
        # `n_samples` of the document is that of each module; the rate is the mean, not the last.
        rate = (self.n_samples - 1) / self.seconds if self.seconds else math.nan
        counts = ("n_gaps", "n_lost", "n_refused", "n_dropped", "n_bytes", "n_markers", "faults")
        return {
            "seconds": self.seconds,
            "n_samples": self.modules,
            "rate": rate,
            **{field: getattr(self, field) for field in counts},
        }


class _QueuedMarker(NamedTuple):
    time: float
    text: str


class Recorder(Closable):
    """Record the arrivals of a source to MCAP; a killed process loses at most half a second.

    `put` and `add_marker` return at once: a thread writes to disk and flushes every 0.2 s, also
    while the source is silent. If the disk is too slow, samples are dropped and counted, and a
    marker reports them. Faults and notices of the source become markers as well. The recorder
    is a context manager, and can be used from any thread.

    Args:
        path: of the MCAP file.
        sensors: of the modules to record; samples of other modules are ignored.
        name: of the recording; by default that of the file.
        metadata: as in `Recording`.
        force: replace an existing file.
        fsync: wait for the disk at least every second, so that a power failure loses at most the
            last second. Without it, the operating system may keep data in memory for half a
            minute.

    Attributes:
        path: of the file.

    Raises:
        OutputError: the file exists already, or cannot be written.
        RecordingError: the metadata are not plain JSON values.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> import numpy as np
        >>> from holdfast.io import load_recording
        >>> from holdfast.sensors import sensor
        >>> with TemporaryDirectory() as folder:
        ...     with Recorder(f"{folder}/a.mcap", {"thumb": sensor("anyskin")}) as recorder:
        ...         recorder.put(Arrival(0.0, {"thumb": np.zeros((5, 3))}, received=0.0))
        ...         recorder.add_marker("grasped")
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
        fsync: bool = False,
    ) -> None:
        self.path = Path(path)
        self._writer = RecordingWriter(
            path, sensors, name=name, metadata=metadata, force=force, fsync=fsync
        )
        self._fsync = fsync
        self._synced_at = time.monotonic()
        self._file_id = _file_id(self.path)  # a file of the same name is another file
        self._buffer = ArrivalBuffer(sensors)
        # `put` and `add_marker` append, the thread of the recorder takes out.
        self._queue: deque[Arrival | _QueuedMarker] = deque()
        self._newest_time = math.nan
        self._ahead: deque[float] = deque(maxlen=_N_CLOCK_ARRIVALS)
        self._n_dropped = self._n_dropped_reported = self._n_markers = 0
        # What `status` returns is set by the thread of the recorder, after each write.
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
        """Whether writing has failed; nothing is written any more."""
        return self._failure is not None

    @property
    def status(self) -> RecorderStatus:
        """The progress."""
        buffer = self._buffer
        has_samples = math.isfinite(buffer.first_time)
        return RecorderStatus(
            seconds=buffer.newest_time - buffer.first_time if has_samples else 0.0,
            n_samples=buffer.n_samples,
            modules={name: module.n_samples for name, module in buffer.modules.items()},
            rate=self._rate,
            n_gaps=max((module.n_gaps for module in buffer.modules.values()), default=0),
            n_lost=buffer.n_lost,
            n_refused=buffer.n_refused,
            n_dropped=self._n_dropped + buffer.n_rejected,
            n_bytes=self._n_bytes,
            n_markers=self._n_markers,
            faults=dict(buffer.faults),
            recent_faults=buffer.recent_faults(time.monotonic()),
            failure=str(self._failure or ""),
        )

    def put(self, arrival: Arrival, *, wait: bool = False) -> None:
        """Record an arrival.

        Args:
            arrival: of a source; its arrays must not change any more.
            wait: block while the queue is full, instead of dropping the arrival. For sources
                that do not keep real time.
        """
        while wait and len(self._queue) >= MAX_QUEUED_ARRIVALS and self._thread.is_alive():
            self._wake.set()
            time.sleep(_YIELD_TIME)
        if len(self._queue) >= MAX_QUEUED_ARRIVALS or self._closing or self._failure:
            self._n_dropped += bool(arrival.samples)  # a notice alone is no loss of data
            return
        if arrival.samples:
            self._newest_time = arrival.time
            self._ahead.append(arrival.time - arrival.received)
        self._queue.append(arrival)

    def session_time(self) -> float:
        """Return the time now, on the clock of the samples [s]; NaN before the first one."""
        # The quickest of the newest arrivals waited least on its way. A copy, as `put` appends.
        return time.monotonic() + max(self._ahead.copy(), default=math.nan)

    def add_marker(self, text: str, time: float | None = None) -> None:
        """Add a marker.

        Args:
            text: what happened.
            time: of the marker [s]; by default that of the newest sample.
        """
        # Markers are few and of people: they have room beyond a queue that is full of samples.
        if len(self._queue) < MAX_QUEUED_ARRIVALS + _MAX_QUEUED_MARKERS:
            self._queue.append(_QueuedMarker(self._newest_time if time is None else time, text))

    def close(self) -> None:
        """Write the rest and close the file; a second call does nothing.

        Raises:
            OutputError: writing failed, or the file was removed; what was written remains.
        """
        if self._closing:
            return
        # From now on `put` drops; the thread writes what is in the queue, and ends.
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

    def _run(self) -> None:
        """Write until the recorder closes; `close` raises the error, if there is one."""
        try:
            while not self._closing:
                self._wake.wait(FLUSH_INTERVAL)
                self._wake.clear()
                self._write_queue()
            self._write_queue()
        except Exception as failure:
            self._failure = failure
            self._queue.clear()

    def _write_queue(self) -> None:
        """Write what is in the queue now, but not what is put into it meanwhile."""
        # In chunks with pauses, or a long queue would keep the interpreter from the detector.
        left = len(self._queue)
        while left:
            n = min(left, _CHUNK_SIZE)
            left -= n
            for _ in range(n):
                item = self._queue.popleft()
                if isinstance(item, _QueuedMarker):
                    self._buffer.add_marker(*item)
                else:
                    self._buffer.add(item)
            for name, module in self._buffer.modules.items():
                times, readings = module.pop_samples()
                if len(times):
                    self._writer.append(name, times, readings)
                    time.sleep(_YIELD_TIME)
            self._write_markers()
        # `put` drops in another thread: what it has dropped since is reported here.
        n_new = self._n_dropped - self._n_dropped_reported
        if n_new:
            self._n_dropped_reported += n_new
            text = f"note: {n_new} samples dropped: the disk is too slow"
            self._buffer.add_marker(self._newest_time, text)
        self._write_markers()
        self._writer.flush()
        if self._fsync and time.monotonic() - self._synced_at >= SYNC_INTERVAL:
            self._synced_at = time.monotonic()
            self._writer.sync()
        self._check_file()
        self._n_bytes = self._writer.n_bytes
        # Two counts stay at least: the newest, and the last one that is a period old.
        counts = self._counts
        counts.append((time.monotonic(), self._buffer.n_samples))
        while len(counts) > 2 and counts[-1][0] - counts[1][0] >= _RATE_PERIOD:
            counts.popleft()
        (begin, before), (end, after) = counts[0], counts[-1]
        self._rate = (after - before) / (end - begin) if end > begin else 0.0

    def _write_markers(self) -> None:
        for when, text in self._buffer.pop_markers():
            self._writer.mark(when, text, at_once=False)
            self._n_markers += 1

    def _check_file(self) -> None:
        if _file_id(self.path) != self._file_id:
            raise OutputError(f"cannot write {self.path}: it was removed while it was recorded")


def _output_path(folder: Path | None, stem: str) -> Path:
    """Return the path of a recording that a client of the service has named; make its folder.

    Raises:
        OutputError: there is no folder, it cannot be made, or the name is no valid file name.
    """
    if folder is None:
        raise OutputError("no folder for recordings: start with --record-to FOLDER")
    if not _FILE_NAME.fullmatch(stem):
        raise OutputError(f"a name of letters, digits, _, - and . expected, {stem!r} given")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {folder}: {cause.strerror}") from cause
    return folder / f"{stem}.mcap"


class SessionRecorder:
    """Start and stop recordings of a session, one at a time, from any thread.

    Args:
        session: to record.
        folder: for the files; None if nothing may be recorded.

    Attributes:
        current: the recorder that is running; None if there is none.
    """

    def __init__(self, session: "Session", folder: Path | None) -> None:
        self._session = session
        self._folder = folder
        self._lock = Lock()
        self.current: Recorder | None = None

    @property
    def enabled(self) -> bool:
        """Whether there is a folder for recordings."""
        return self._folder is not None

    def start(self, name: str = "") -> Path:
        """Start a recording, and return the path of its file.

        Args:
            name: of the file, without a suffix; by default the date and time.

        Raises:
            OutputError: a recording is running already, the file exists, `name` is not a
                valid file name, or the file cannot be written.
        """
        with self._lock:
            if self.current is not None:
                raise OutputError(f"{self.current.path} is being recorded already")
            source = self._session.source
            path = _output_path(self._folder, name or time.strftime("%Y%m%d-%H%M%S"))
            recorder = Recorder(path, source.sensors, metadata=dict(source.metadata))
            self.current = recorder
            self._session.add_listener(self._put)
            return recorder.path

    def add_marker(self, text: str) -> None:
        """Add a marker to the recording.

        Raises:
            OutputError: no recording is running.
        """
        self._running("start a recording, then set a marker").add_marker(text)

    def stop(self) -> Recorder:
        """Stop the recording, and return its recorder.

        Raises:
            OutputError: no recording is running, writing failed, or no samples arrived (then
                the file is removed).
        """
        with self._lock:
            recorder = self._running("there is nothing to stop")
            # In this order: nothing is put into a recorder that is closing.
            self.current = None
            self._session.remove_listener(self._put)
            recorder.close()
            if not recorder.status.n_samples:
                recorder.path.unlink(missing_ok=True)
                raise OutputError(f"no samples arrived: {recorder.path} is removed")
            return recorder

    def _running(self, hint: str) -> Recorder:
        if self.current is None:
            raise OutputError(f"no recording is running: {hint}")
        return self.current

    def _put(self, update: "StreamUpdate") -> None:
        recorder = self.current
        if recorder is not None and update.arrival is not None:
            recorder.put(update.arrival)


def _file_id(path: Path) -> tuple[int, int] | None:
    """Return device and inode of the file at `path`; None if there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino
