"""MCAP files of recordings, written while recording: data on disk survives a crash."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, cast

import msgspec
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from holdfast.errors import OutputError, RecordingError
from holdfast.files import refuse_overwrite, sync
from holdfast.io.header import Header, ModuleData, encode_header, number_type
from holdfast.io.mcap_messages import (
    TEXT_SCHEMA,
    TEXT_TYPE,
    encode_samples,
    encode_text,
    samples_schema,
    samples_type,
)
from holdfast.io.output_stream import UnbufferedStream, open_locked
from holdfast.io.timed_arrays import TACTILE, time_spans
from holdfast.openable import Closable
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Unit

MESSAGE_SECONDS = 0.1
"""Maximum duration of the samples in a message [s]."""
CHUNK_SECONDS = 0.3
"""Maximum duration of a chunk of the file [s]; with a message, what a crash loses."""
WRITTEN_CHUNK_SIZE = 1 << 24
"""Number of bytes above which a chunk ends early."""

HEADER_TOPIC = "/holdfast/header"
MARKERS_TOPIC = "/holdfast/markers"
LIBRARY = "holdfast"
"""Name of the program in the first record of the file."""

_MAX_NANOSECONDS = (1 << 63) - 1


class RecordingWriter(Closable):
    """Writer of a recording while it is made; a crash loses at most half a second.

    Samples are written in messages of at most 0.1 s and chunks of at most 0.3 s, by the times
    of the samples: the writer has no clock. Call `flush` if samples may stop to arrive. Use the
    writer as a context manager, and from one thread only.

    Args:
        path: path of the MCAP file.
        sensors: sensor by module.
        name: name of the recording; by default the stem of the file.
        units: unit by module, for calibrated readings.
        metadata: as in `Recording`.
        media: as in `Recording`.
        force: replace an existing file.
        fsync: wait for the disk at the beginning, at the end and in `sync`.

    Raises:
        OutputError: the file exists or cannot be written, or another program is recording to it.
        RecordingError: the metadata are not plain JSON values.

    Example:
        >>> from tempfile import TemporaryDirectory
        >>> from holdfast.io import load_recording
        >>> from holdfast.sensors import sensor
        >>> with TemporaryDirectory() as folder:
        ...     with RecordingWriter(f"{folder}/a.mcap", {"thumb": sensor("anyskin")}) as writer:
        ...         writer.append("thumb", [0.0, 0.01], np.zeros((2, 5, 3)))
        ...         writer.mark(0.01, "grasped")
        ...     load_recording(f"{folder}/a.mcap").markers
        ((0.01, 'grasped'),)
    """

    def __init__(
        self,
        path: str | Path,
        sensors: Mapping[str, Sensor],
        *,
        name: str | None = None,
        units: Mapping[str, Unit] | None = None,
        metadata: Mapping[str, Any] | None = None,
        media: Sequence[tuple[str, float]] = (),
        force: bool = False,
        fsync: bool = False,
    ) -> None:
        target = Path(path)
        units = units or {}
        header = Header(
            name=name or target.stem,
            file=target.stem,
            modules={
                module: ModuleData(sensor.to_dict(), units.get(module, sensor.unit))
                for module, sensor in sensors.items()
            },
            metadata=dict(metadata or {}),
            media=list(media),
        )
        self._sensors = dict(sensors)
        # `append` adds samples and `_write` takes those of whole messages.
        self._pending: dict[str, list[tuple[Array, npt.NDArray[Any]]]] = {m: [] for m in sensors}
        self._numbers: dict[str, str] = {}  # of the first samples of each module
        self._last_times = dict.fromkeys(sensors, -np.inf)
        self._newest = -np.inf  # of any module; messages are written by it
        self._log = MessageLog(target, header, force=force, fsync=fsync)

    def append(self, module: str, times: npt.ArrayLike, readings: npt.ArrayLike) -> None:
        """Append the next samples of a module.

        Args:
            module: name of the module.
            times: (n,) strictly increasing and later than all times before [s].
            readings: (n, n_taxels, 3), of the same number type in each call.

        Raises:
            RecordingError: the module is unknown, the shape or the number type is wrong, or
                the times do not increase.
            OutputError: the disk reports an error.
        """
        sample_times = np.array(times, dtype=np.float64)
        values = np.array(readings)
        if module not in self._sensors:
            raise RecordingError(
                f"samples of {module!r} given; this recording has {', '.join(self._sensors)}"
            )
        n_taxels = self._sensors[module].n_taxels
        if sample_times.ndim != 1 or values.shape != (len(sample_times), n_taxels, 3):
            raise RecordingError(
                f"{module}: times (n,) and readings (n, {n_taxels}, 3) expected, "
                f"{sample_times.shape} and {values.shape} given"
            )
        # One topic has one schema, so the first samples decide the number type of all.
        number = number_type(values, f"readings of {module}")
        if self._numbers.setdefault(module, number) != number:
            raise RecordingError(f"{module}: {self._numbers[module]} expected, {number} given")
        steps = np.diff(sample_times, prepend=self._last_times[module])
        if not (np.isfinite(sample_times).all() and (steps > 0).all()):
            raise RecordingError(f"{module}: finite, strictly increasing times expected")
        if len(sample_times) == 0:
            return
        self._pending[module].append((sample_times, values))
        self._last_times[module] = float(sample_times[-1])
        self._newest = max(self._newest, self._last_times[module])
        for name, parts in self._pending.items():
            # Of every module, not only this one: also one that falls silent is written.
            if parts and parts[0][0][0] <= self._newest - MESSAGE_SECONDS:
                self._write(name, before=self._newest - MESSAGE_SECONDS)

    def mark(self, time: float, text: str, *, at_once: bool = True) -> None:
        """Append a marker.

        Args:
            time: time of the event, on the clock of the samples [s].
            text: description of the event.
            at_once: write to disk now; otherwise with the next `flush` or later samples.

        Raises:
            OutputError: the disk reports an error.
        """
        self._log.write_text(MARKERS_TOPIC, time, text)
        if at_once:
            self._log.flush()

    def flush(self) -> None:
        """Write all samples and markers to disk; a later crash does not lose them.

        Raises:
            OutputError: the disk reports an error.
        """
        self._write_all()
        self._log.flush()

    def sync(self) -> None:
        """Return when all that was flushed is on the disk; a power failure does not lose it.

        Raises:
            OutputError: the disk reports an error.
        """
        self._log.sync()

    @property
    def n_bytes(self) -> int:
        """Length of the file in bytes."""
        return self._log.n_bytes

    def close(self) -> None:
        """Write the remaining samples and the end of the file; a second call does nothing.

        Raises:
            OutputError: the disk reports an error.
        """
        try:
            if not self._log.closed:
                self._write_all()
        finally:
            self._log.close()

    def _write_all(self) -> None:
        for name, parts in self._pending.items():
            if parts:
                self._write(name, before=np.inf)

    def _write(self, module: str, before: float) -> None:
        """Write the messages that begin at `before` or earlier; keep the rest."""
        parts = self._pending[module]
        times = np.concatenate([part[0] for part in parts])
        values = np.concatenate([part[1] for part in parts])
        n_written = len(times)
        for span in time_spans({module: times}, MESSAGE_SECONDS):
            cut = span[module]
            if times[cut.start] > before:
                n_written = cut.start
                break
            self._log.write_samples(f"{TACTILE}{module}", times[cut], values[cut])
        has_rest = n_written < len(times)
        self._pending[module] = [(times[n_written:], values[n_written:])] if has_rest else []


class MessageLog:
    """MCAP file of messages of samples and texts, in chunks of at most 0.3 s.

    After an error of the disk nothing more is written. The file can then be read like a file
    whose end was cut off.

    Args:
        path: path of the file.
        header: header of the recording; it is written to disk at once.
        force: replace an existing file.
        fsync: as in `RecordingWriter`.

    Attributes:
        closed: whether the end of the file has been written.

    Raises:
        OutputError: the file exists or cannot be written.
    """

    def __init__(
        self, path: Path, header: Header, *, force: bool = False, fsync: bool = False
    ) -> None:
        # Before the file is opened: metadata that JSON cannot hold leave no empty file.
        header_text = encode_header(header).decode()
        refuse_overwrite(path, force=force)
        self._path = path
        self._fsync = fsync
        # Numbers in the file, by topic and by type.
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._n_messages = 0  # number of the next one: a gap in the numbers is damage
        self._chunk_span = (np.inf, -np.inf)
        self.closed = False
        with _disk_errors(path):
            self._file = open_locked(path, force=force)
            self._stream = UnbufferedStream(self._file)
            self._writer = Writer(
                cast("IO[bytes]", self._stream),
                WRITTEN_CHUNK_SIZE,
                CompressionType.ZSTD,
                # By default, mcap checks the chunks but not the section that holds them.
                enable_data_crcs=True,
            )
            self._writer.start("", LIBRARY)
            # The metadata that `mcap get metadata` shows; the header itself is a message.
            self._writer.add_metadata(
                "holdfast",
                {
                    "name": header.name,
                    "schema": header.schema,
                    "modules": ", ".join(header.modules),
                    "metadata": msgspec.json.encode(header.metadata, enc_hook=str).decode(),
                },
            )
        # At once: from a file that is cut before its header nothing can be recovered.
        self.write_text(HEADER_TOPIC, 0.0, header_text)
        self.flush()
        if fsync:
            self.sync()
            with _disk_errors(path):
                # The name of a new file is an entry of its folder.
                sync(path.parent)

    def write_samples(self, topic: str, times: Array, values: npt.NDArray[Any]) -> None:
        """Write one message of samples: times (n,) [s] and values (n, ...)."""
        start = float(times[0])
        self._limit_chunk(start, float(times[-1]))
        number = number_type(values, topic)
        channel = self._channel(topic, samples_type(number), samples_schema(number))
        self._write_message(channel, start, encode_samples(times, values))

    def write_text(self, topic: str, time: float, text: str) -> None:
        """Write one message of a text and its time [s]."""
        self._limit_chunk(time, time)
        channel = self._channel(topic, TEXT_TYPE, TEXT_SCHEMA)
        self._write_message(channel, time, encode_text(time, text))

    def flush(self) -> None:
        """End the chunk and pass it to the operating system."""
        with _disk_errors(self._path):
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._chunk_span = (np.inf, -np.inf)

    def sync(self) -> None:
        """Return when all that was flushed is on the disk, where no power failure loses it."""
        with _disk_errors(self._path):
            sync(self._file.fileno())

    @property
    def n_bytes(self) -> int:
        """Length of the file in bytes."""
        return self._stream.n_bytes

    def close(self) -> None:
        """Write the end of the file; a second call does nothing."""
        if self.closed:
            return
        # First, also if the disk fails now: an end after a missing part would hide it.
        self.closed = True
        with _disk_errors(self._path), self._file:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._writer.flush()  # type: ignore[no-untyped-call]
            if self._fsync:
                sync(self._file.fileno())

    def _limit_chunk(self, start: float, end: float) -> None:
        """End the chunk if a message from `start` to `end` [s] would make it too long."""
        first, last = min(start, self._chunk_span[0]), max(end, self._chunk_span[1])
        if last - first > CHUNK_SECONDS:
            self.flush()
            first, last = start, end
        self._chunk_span = (first, last)

    def _channel(self, topic: str, kind: str, definition: str) -> int:
        if topic not in self._channels:
            with _disk_errors(self._path):
                if kind not in self._schemas:
                    self._schemas[kind] = self._writer.register_schema(
                        kind, "ros2msg", definition.encode()
                    )
                self._channels[topic] = self._writer.register_channel(
                    topic, "cdr", self._schemas[kind]
                )
        return self._channels[topic]

    def _write_message(self, channel: int, time: float, data: bytes) -> None:
        # Log times are unsigned, so negative ones are cut; readers use the times in the message.
        nanoseconds = int(min(max(time * 1e9, 0.0), _MAX_NANOSECONDS))
        sequence = self._n_messages & 0xFFFFFFFF  # the format has 32 bits for it
        with _disk_errors(self._path):
            self._writer.add_message(channel, nanoseconds, data, nanoseconds, sequence)
        self._n_messages += 1


class _disk_errors:  # noqa: N801 (used like a function)
    """Context manager that turns an `OSError` into an `OutputError`."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            raise OutputError(f"cannot write {self._path}: {error.strerror}") from error
