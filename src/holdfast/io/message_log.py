"""An MCAP file as a log of messages of samples and texts."""

from io import FileIO
from pathlib import Path
from typing import IO, Any, cast

import msgspec
import numpy as np
import numpy.typing as npt
from mcap.writer import CompressionType, Writer

from holdfast.errors import OutputError
from holdfast.files import refuse_overwrite
from holdfast.io.header import Header, encode, number_of
from holdfast.io.mcap_messages import (
    TEXT_SCHEMA,
    TEXT_TYPE,
    encode_samples,
    encode_text,
    samples_schema,
    samples_type,
)
from holdfast.sensors.types import Array

CHUNK_SECONDS = 0.3

HEADER_TOPIC = "/holdfast/header"
MARKERS_TOPIC = "/holdfast/markers"
LIBRARY = "holdfast"

_MOST_NANOSECONDS = (1 << 63) - 1
_MOST_CHUNK = 1 << 24
"""A chunk of more bytes than this ends early."""


class MessageLog:
    """An MCAP file of messages of samples and texts, in chunks of at most 0.3 s.

    Args:
        path: of the file.
        header: of the recording; it goes to disk at once.
        force: replace what is there.

    Attributes:
        closed: whether the file has ended.

    Raises:
        OutputError: the file exists already or cannot be written. After a refusal nothing more
            is written: what came before can be read, as of a file that was cut.
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
            self._direct = _Direct(self._file)
            self._writer = Writer(
                cast("IO[bytes]", self._direct),
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
        channel = self._channel(topic, samples_type(number), samples_schema(number))
        self._message(channel, start, encode_samples(times, values))

    def text(self, topic: str, time: float, text: str) -> None:
        """Writes one message of text."""
        self._make_room(time, time)
        channel = self._channel(topic, TEXT_TYPE, TEXT_SCHEMA)
        self._message(channel, time, encode_text(time, text))

    def flush(self) -> None:
        """Ends the chunk: what came so far is on its way to the disk."""
        with _refusals(self._path):
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._span = (np.inf, -np.inf)

    @property
    def n_bytes(self) -> int:
        """How long the file is."""
        return self._direct.n_bytes

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

    What the disk refused once is refused from then on: an end after a piece that is missing
    would make a damaged file of one that is merely cut.

    Args:
        file: opened with `buffering=0`.

    Attributes:
        n_bytes: that were written.
    """

    def __init__(self, file: FileIO) -> None:
        self.n_bytes = 0
        self._file = file
        self._refused: OSError | None = None

    def write(self, data: bytes) -> int:
        if self._refused:
            raise OSError(*self._refused.args)
        left = memoryview(data)
        try:
            while left:
                n = self._file.write(left)
                self.n_bytes += n
                left = left[n:]
        except OSError as error:
            self._refused = error
            raise
        return len(data)

    def tell(self) -> int:
        return self.n_bytes

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
