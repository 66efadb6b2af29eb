"""MCAP files of recordings: save, load, and recover the samples of a file that was cut."""

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from holdfast.errors import RecordingError
from holdfast.files import whole_file
from holdfast.io.header import Header, decode_header, header_of
from holdfast.io.mcap_chunks import check_checksums, has_end, read_chunks, records_in
from holdfast.io.mcap_messages import decode_samples, decode_text, number_of_type
from holdfast.io.mcap_writer import (
    HEADER_TOPIC,
    LIBRARY,
    MARKERS_TOPIC,
    MESSAGE_SECONDS,
    MessageLog,
)
from holdfast.io.safe_reading import check_size, one_line
from holdfast.io.timed_arrays import (
    TRUTH,
    TimedArray,
    TimedArrays,
    array_specs,
    arrays_of,
    recording_from,
    time_spans,
)
from holdfast.recordings import Recording


class _Channel(NamedTuple):
    """Topic of messages, number of their schema, and whether they are counted."""

    topic: str
    schema_id: int
    is_counted: bool


class _McapMessage(NamedTuple):
    topic: str
    schema: str
    data: bytes


def save(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Save a recording in the same form as while recording.

    Raises:
        OutputError: as in `whole_file`.
        RecordingError: the file cannot store the recording.
    """
    # Markers are messages of their own: while recording, the header is written before any is set.
    header = msgspec.structs.replace(header_of(recording, path.stem), markers=[])
    arrays = arrays_of(recording)
    # Names may contain slashes: finger `a`, array `b/c` and finger `a/b`, array `c` are one topic.
    if len(arrays) < len(array_specs(header)):
        raise RecordingError("two truth arrays of the recording would share a topic")
    with whole_file(path, force=force) as part:
        # `whole_file` has made this file already.
        log = MessageLog(part, header, force=True)
        try:
            # In the order of time, as while recording; the order of markers does not change, though
            # one may lie before the marker that was set before it.
            times = {topic: pair[0] for topic, pair in arrays.items()}
            markers = list(recording.markers)
            for span in time_spans(times, MESSAGE_SECONDS):
                for topic, cut in span.items():
                    if cut.start < cut.stop:
                        log.write_samples(topic, arrays[topic][0][cut], arrays[topic][1][cut])
                newest = max(times[topic][cut.stop - 1] for topic, cut in span.items() if cut.stop)
                while markers and markers[0][0] <= newest:
                    log.write_text(MARKERS_TOPIC, *markers.pop(0))
            for time, text in markers:
                log.write_text(MARKERS_TOPIC, time, text)
        finally:
            log.close()


def load(path: Path) -> Recording:
    """Load the recording in a file; if the file was cut, load its valid beginning.

    Raises:
        RecordingError: the file is damaged or not a recording, or nothing can be recovered.
    """
    complete = _is_complete(path)
    messages = _messages(path, complete)
    header = _header(path, messages, complete)
    specs = array_specs(header)
    # A module without samples has an empty array of its number type; a file recorded live names
    # no types, and has only the arrays of modules with samples.
    parts: dict[str, list[TimedArray]] = {
        spec.topic: [(np.empty(0), spec.empty())] if spec.number else [] for spec in specs
    }
    markers: list[tuple[float, str]] = []
    n_bytes = 0
    for topic, samples in _samples(path, header, _with_markers(messages, markers)):
        parts[topic].append(samples)
        n_bytes += sum(array.nbytes for array in samples)
        check_size(path, n_bytes)
    arrays = {
        topic: (
            np.concatenate([times for times, _ in samples]),
            np.concatenate([values for _, values in samples]),
        )
        for topic, samples in parts.items()
        if samples
    }
    header = msgspec.structs.replace(header, markers=markers)
    # Truth arrays share their times, but each has its own messages: a cut file may lack the last of
    # some, so all are cut to the rows that all have.
    truth = [topic for topic in arrays if topic.startswith(TRUTH)]
    n_rows = min((len(arrays[topic][0]) for topic in truth), default=0)
    for topic in truth:
        arrays[topic] = (arrays[topic][0][:n_rows], arrays[topic][1][:n_rows])
    recording = recording_from(header, arrays, path, complete=complete)
    # A cut file has lost samples, and one recorded live was written before its digest was known.
    if complete and header.digest and recording.digest != header.digest:
        raise RecordingError(f"{path} is damaged: its samples do not match their digest")
    return recording


def read_groups(path: Path) -> tuple[Header, Iterator[TimedArrays], bool]:
    """Return the header with all markers, an iterator over messages, and whether complete.

    Raises:
        RecordingError: as in `load`.
    """
    complete = _is_complete(path)
    messages = _messages(path, complete)
    header = _header(path, messages, complete)
    markers: list[tuple[float, str]] = []
    # Markers may stand anywhere in the file, and the header needs all: so it is read twice.
    for _ in _with_markers(messages, markers):
        pass
    header = msgspec.structs.replace(header, markers=markers)
    samples = _samples(path, header, _messages(path, complete))
    return header, ({topic: pair} for topic, pair in samples), complete


def is_foreign(path: Path) -> bool:
    """Return whether a file is MCAP, but of another program."""
    # The name of the program is in the first record. A head that is shorter is of a cut file, which
    # may be ours.
    with path.open("rb") as file:
        head = file.read(256)
    return head.startswith(MAGIC) and len(head) >= 64 and LIBRARY.encode() not in head


def _is_complete(path: Path) -> bool:
    """Return whether the file has its end; check all bytes of a file that has.

    Raises:
        RecordingError: the file has its end but is damaged, or is of another program.
    """
    if is_foreign(path):
        raise RecordingError(f"{path} is an MCAP file but no recording of holdfast")
    # A cut file has no checksum of the whole; that of each chunk is checked as it is read.
    complete = has_end(path)
    if complete:
        check_checksums(path)
    return complete


def _header(path: Path, messages: Iterator[_McapMessage], complete: bool) -> Header:
    """Return the header, which is in the first message."""
    first = next(messages, None)
    if first is not None and first.topic == HEADER_TOPIC:
        return decode_header(decode_text(first.data)[1], path)
    if complete:
        raise RecordingError(f"{path} is an MCAP file but no recording of holdfast")
    raise RecordingError(f"{path} is cut so early that nothing can be recovered: it has no header")


def _with_markers(
    messages: Iterator[_McapMessage], markers: list[tuple[float, str]]
) -> Iterator[_McapMessage]:
    """Yield all messages but markers, which are appended to the list."""
    for message in messages:
        if message.topic == MARKERS_TOPIC:
            markers.append(decode_text(message.data))
        else:
            yield message


def _samples(
    path: Path, header: Header, messages: Iterator[_McapMessage]
) -> Iterator[tuple[str, TimedArray]]:
    """Yield topic, times and values of each message of samples."""
    specs = {spec.topic: spec for spec in array_specs(header)}
    for message in messages:
        topic = message.topic
        if topic in (MARKERS_TOPIC, HEADER_TOPIC):
            continue
        number = number_of_type(message.schema)
        try:
            times, values = decode_samples(message.data, number)
        except (ValueError, TypeError) as cause:
            raise RecordingError(f"{path}: {topic}: {cause}") from cause
        # The number type of a file recorded live is only in the schema of its messages.
        spec = specs.get(topic)
        if spec is None or spec.number not in (None, number) or values.shape[1:] != spec.shape:
            raise RecordingError(f"{path}: {topic} does not match the header")
        yield topic, (times, values)


class _Channels:
    """Channels and names of schemas of a file, by their numbers."""

    def __init__(self) -> None:
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, _Channel] = {}

    def add(self, opcode: int, content: bytes) -> None:
        """Keep what is needed of a record, if it is a schema or a channel."""
        stream = ReadDataStream(BytesIO(content))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas.setdefault(schema.id, schema.name)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            is_counted = channel.message_encoding == "cdr"
            self._channels.setdefault(
                channel.id, _Channel(channel.topic, channel.schema_id, is_counted)
            )

    def of(self, message: Message) -> tuple[_Channel, str]:
        """Return the channel of a message and the name of its schema.

        Raises:
            ValueError: the message is before its channel or schema.
        """
        channel = self._channels.get(message.channel_id)
        if channel is None or channel.schema_id not in self._schemas:
            raise ValueError("a message without its channel")
        return channel, self._schemas[channel.schema_id]


def _messages(path: Path, complete: bool) -> Iterator[_McapMessage]:
    """Yield the messages with valid checksums in order; a missing number is damage."""
    channels = _Channels()
    expected = 0
    try:
        for chunk in read_chunks(path, complete):
            for opcode, content in records_in(chunk):
                if opcode != Opcode.MESSAGE:
                    channels.add(opcode, content)
                    continue
                message = Message.read(ReadDataStream(BytesIO(content)), len(content))
                channel, schema = channels.of(message)
                # A checksum covers one chunk; only the numbers show that a whole chunk is missing.
                if channel.is_counted and message.sequence != expected & 0xFFFFFFFF:
                    raise RecordingError(f"{path} is damaged: message {expected} is missing")
                expected += 1
                yield _McapMessage(channel.topic, schema, message.data)
    except (ValueError, McapError, struct.error) as cause:
        raise RecordingError(f"{path} is damaged: {one_line(cause)}") from cause
