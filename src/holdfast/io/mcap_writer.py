"""Recordings as MCAP while they are made: what has been written stays, whatever happens."""

from collections.abc import Mapping, Sequence
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self, cast

import msgspec
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from holdfast.errors import OutputError, RecordingError
from holdfast.files import refuse_overwrite
from holdfast.io import cdr
from holdfast.io.header import Header, ModuleData, encode, number_of
from holdfast.io.spans import spans
from holdfast.sensors import Sensor
from holdfast.sensors.values import Array, Unit

MESSAGE_SECONDS = 0.1
CHUNK_SECONDS = 0.3

HEADER_TOPIC = "/holdfast/header"
MARKERS_TOPIC = "/holdfast/markers"
LIBRARY = "holdfast"

_NEVER = -np.inf
_MOST_NANOSECONDS = (1 << 63) - 1
_MOST_CHUNK = 1 << 24
"""A chunk of more bytes than this ends early."""


class RecordingWriter:
    """Writes a recording while it is made; a kill loses at most half a second.

    Samples go to disk in messages of at most 0.1 s and chunks of at most 0.3 s of the
    stream's own time: the writer has no clock. It is a context manager and is to be used by
    one thread.

    Args:
        path: of the MCAP file.
        sensors: by module.
        name: of the recording; that of the file where it is not given.
        units: by module, where readings are calibrated.
        metadata: as in `Recording`.
        media: as in `Recording`.
        force: replace what is at `path`.

    Raises:
        OutputError: the file exists already or cannot be written.
        RecordingError: the metadata are no plain JSON values.

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
    ) -> None:
        target = Path(path)
        given = units or {}
        header = Header(
            name=name or target.stem,
            file=target.stem,
            modules={
                module: ModuleData(sensor.to_dict(), given.get(module, sensor.unit))
                for module, sensor in sensors.items()
            },
            metadata=dict(metadata or {}),
            media=list(media),
        )
        self._sensors = dict(sensors)
        self._pending: dict[str, list[tuple[Array, npt.NDArray[Any]]]] = {m: [] for m in sensors}
        self._numbers: dict[str, str] = {}
        self._last = dict.fromkeys(sensors, _NEVER)
        self._newest = _NEVER
        self._log = MessageLog(target, header, force=force)

    def append(self, module: str, times: npt.ArrayLike, readings: npt.ArrayLike) -> None:
        """Takes the next samples of a module.

        Args:
            module: whose they are.
            times: (n,) later than those before [s].
            readings: (n, n_taxels, 3), of the same number type each time.

        Raises:
            RecordingError: unknown module, wrong shape or number type, times that do not
                increase.
            OutputError: the disk refuses.
        """
        when = np.array(times, dtype=np.float64)
        values = np.array(readings)
        self._check(module, when, values)
        if len(when) == 0:
            return
        self._pending[module].append((when, values))
        self._last[module] = float(when[-1])
        self._newest = max(self._newest, self._last[module])
        for name, parts in self._pending.items():
            if parts and parts[0][0][0] <= self._newest - MESSAGE_SECONDS:
                self._write(name, before=self._newest - MESSAGE_SECONDS)

    def mark(self, time: float, text: str) -> None:
        """Writes a marker at once.

        Args:
            time: on the clock of the samples [s].
            text: what happened.

        Raises:
            OutputError: the disk refuses.
        """
        self._log.text(MARKERS_TOPIC, time, text)
        self._log.flush()

    def close(self) -> None:
        """Writes what is left and the end of the file; again, it does nothing.

        Raises:
            OutputError: the disk refuses.
        """
        try:
            for name, parts in self._pending.items():
                if parts and not self._log.closed:
                    self._write(name, before=np.inf)
        finally:
            self._log.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def _check(self, module: str, times: Array, values: npt.NDArray[Any]) -> None:
        if module not in self._sensors:
            raise RecordingError(
                f"samples of {module!r} given; this recording has {', '.join(self._sensors)}"
            )
        n_taxels = self._sensors[module].n_taxels
        if times.ndim != 1 or values.shape != (len(times), n_taxels, 3):
            raise RecordingError(
                f"{module}: times (n,) and readings (n, {n_taxels}, 3) expected, "
                f"{times.shape} and {values.shape} given"
            )
        number = number_of(values, f"readings of {module}")
        if self._numbers.setdefault(module, number) != number:
            raise RecordingError(f"{module}: {self._numbers[module]} expected, {number} given")
        steps = np.diff(times, prepend=self._last[module])
        if not (np.isfinite(times).all() and (steps > 0).all()):
            raise RecordingError(f"{module}: finite, strictly increasing times expected")

    def _write(self, module: str, before: float) -> None:
        """Writes the spans that begin no later than `before`; the rest stays pending."""
        parts = self._pending[module]
        times = np.concatenate([part[0] for part in parts])
        values = np.concatenate([part[1] for part in parts])
        left = len(times)
        for span in spans({module: times}, MESSAGE_SECONDS):
            cut = span[module]
            if times[cut.start] > before:
                left = cut.start
                break
            self._log.samples(f"/tactile/{module}", times[cut], values[cut])
        self._pending[module] = [(times[left:], values[left:])] if left < len(times) else []


class MessageLog:
    """An MCAP file of messages of samples and texts, in chunks of at most 0.3 s.

    Args:
        path: of the file.
        header: of the recording; it goes to disk at once.
        force: replace what is there.

    Attributes:
        closed: whether the file has ended.

    Raises:
        OutputError: the file exists already or cannot be written.
    """

    def __init__(self, path: Path, header: Header, *, force: bool = False) -> None:
        text = encode(header).decode()
        refuse_overwrite(path, force=force)
        self._path = path
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._n_messages = 0
        self._span = (np.inf, -np.inf)
        self.closed = False
        with _refusals(path):
            self._file = path.open("wb" if force else "xb", buffering=0)
            self._writer = Writer(
                cast("IO[bytes]", _Direct(self._file)),
                _MOST_CHUNK,
                CompressionType.ZSTD,
                enable_data_crcs=True,
            )
            self._writer.start("", LIBRARY)
            self._writer.add_metadata("holdfast", _summary(header))
        self.text(HEADER_TOPIC, 0.0, text)
        self.flush()

    def samples(self, topic: str, times: Array, values: npt.NDArray[Any]) -> None:
        """Writes one message of samples; times (n,) [s], values (n, ...)."""
        start = float(times[0])
        self._make_room(start, float(times[-1]))
        number = number_of(values, topic)
        channel = self._channel(topic, cdr.type_name(number), cdr.schema(number))
        self._message(channel, start, cdr.pack_samples(times, values))

    def text(self, topic: str, time: float, text: str) -> None:
        """Writes one message of text."""
        self._make_room(time, time)
        channel = self._channel(topic, cdr.TEXT_TYPE, cdr.TEXT_SCHEMA)
        self._message(channel, time, cdr.pack_text(time, text))

    def flush(self) -> None:
        """Ends the chunk: what came so far is on its way to the disk."""
        with _refusals(self._path):
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._span = (np.inf, -np.inf)

    def close(self) -> None:
        """Ends the file."""
        if self.closed:
            return
        self.closed = True
        with _refusals(self._path), self._file:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._writer.flush()  # type: ignore[no-untyped-call]

    def _make_room(self, start: float, end: float) -> None:
        """Ends the chunk where it would grow too long with a message of this time."""
        first, last = min(start, self._span[0]), max(end, self._span[1])
        if last - first > CHUNK_SECONDS:
            self.flush()
            first, last = start, end
        self._span = (first, last)

    def _channel(self, topic: str, kind: str, definition: str) -> int:
        if topic not in self._channels:
            with _refusals(self._path):
                if kind not in self._schemas:
                    self._schemas[kind] = self._writer.register_schema(
                        kind, "ros2msg", definition.encode()
                    )
                self._channels[topic] = self._writer.register_channel(
                    topic, "cdr", self._schemas[kind]
                )
        return self._channels[topic]

    def _message(self, channel: int, time: float, data: bytes) -> None:
        nanoseconds = int(min(max(time * 1e9, 0.0), _MOST_NANOSECONDS))
        sequence = self._n_messages & 0xFFFFFFFF
        with _refusals(self._path):
            self._writer.add_message(channel, nanoseconds, data, nanoseconds, sequence)
        self._n_messages += 1


class _Direct:
    """A stream without a buffer, which `mcap` would put around a plain file.

    Args:
        file: opened with `buffering=0`.
    """

    def __init__(self, file: FileIO) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            left = left[self._file.write(left) :]
        return len(data)

    def tell(self) -> int:
        return self._file.tell()

    def flush(self) -> None:
        """Does nothing: all is written already."""


class _refusals:  # noqa: N801 (used like a function)
    """Turns what the disk refuses into an OutputError."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, OSError):
            raise OutputError(f"cannot write {self._path}: {error.strerror}") from error


def _summary(header: Header) -> dict[str, str]:
    """What `mcap get metadata` shows; the header proper is a message."""
    return {
        "name": header.name,
        "schema": header.schema,
        "modules": ", ".join(header.modules),
        "metadata": msgspec.json.encode(header.metadata, enc_hook=str).decode(),
    }
