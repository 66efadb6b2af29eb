"""Recordings as MCAP: read whole, or as far as a cut file goes."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC as MAGIC
from zstandard import ZstdError

from holdfast.errors import RecordingError
from holdfast.files import whole_file
from holdfast.io.header import Header, decode, header_of
from holdfast.io.mcap_messages import decode_samples, decode_text, number_of_type
from holdfast.io.mcap_writer import MESSAGE_SECONDS
from holdfast.io.message_log import HEADER_TOPIC, LIBRARY, MARKERS_TOPIC, MessageLog
from holdfast.io.series import (
    Samples,
    Series,
    empty,
    recording_from,
    samples_of,
    series_of,
)
from holdfast.io.spans import spans
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
_BLOCK = 1 << 20
_MOST_CHUNK = 1 << 30
"""A chunk that claims to be larger than this when unpacked is refused."""


class _Found(NamedTuple):
    topic: str
    schema: str
    data: bytes


def save(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Writes a recording as it would have been recorded.

    Raises:
        OutputError: as `whole_file`.
        RecordingError: it holds what the file cannot.
    """
    header = msgspec.structs.replace(header_of(recording, path.stem), markers=[])
    samples = samples_of(recording)
    if len(samples) < len(series_of(header)):
        raise RecordingError("two truth arrays of the recording would share a topic")
    with whole_file(path, force=force) as part:
        log = MessageLog(part, header, force=True)
        try:
            _write(log, samples, list(recording.markers))
        finally:
            log.close()


def _write(log: MessageLog, samples: Samples, markers: list[tuple[float, str]]) -> None:
    """Writes all in the order of time; markers keep their own order."""
    times = {topic: pair[0] for topic, pair in samples.items()}
    for span in spans(times, MESSAGE_SECONDS):
        for topic, cut in span.items():
            if cut.start < cut.stop:
                log.samples(topic, samples[topic][0][cut], samples[topic][1][cut])
        newest = max(times[topic][cut.stop - 1] for topic, cut in span.items() if cut.stop)
        while markers and markers[0][0] <= newest:
            log.text(MARKERS_TOPIC, *markers.pop(0))
    for time, text in markers:
        log.text(MARKERS_TOPIC, time, text)


def load(path: Path) -> Recording:
    """The recording in a file; of a file that was cut, what is left and sound.

    Raises:
        RecordingError: it is damaged, no recording, or nothing can be recovered.
    """
    complete = _is_whole(path)
    messages = _messages(path, complete)
    header = _header(path, messages, complete)
    parts: dict[str, tuple[list[Array], list[npt.NDArray[Any]]]] = {
        series.topic: ([np.empty(0)], [empty(series)] if series.number else [])
        for series in series_of(header)
    }
    markers: list[tuple[float, str]] = []
    for topic, (times, values) in _samples(path, header, messages, markers):
        parts[topic][0].append(times)
        parts[topic][1].append(values)
    samples = {
        topic: (np.concatenate(times), np.concatenate(values))
        for topic, (times, values) in parts.items()
        if values
    }
    header = msgspec.structs.replace(header, markers=markers)
    recording = recording_from(header, _even(samples), path, complete=complete)
    if complete and header.digest and recording.digest != header.digest:
        raise RecordingError(f"{path} is damaged: its samples do not match their digest")
    return recording


def chunks(path: Path) -> tuple[Header, Iterator[Samples], bool]:
    """The header with all markers, the samples of one message after the other, completeness.

    Raises:
        RecordingError: as `load`.
    """
    complete = _is_whole(path)
    messages = _messages(path, complete)
    header = _header(path, messages, complete)
    markers = [decode_text(m.data) for m in messages if m.topic == MARKERS_TOPIC]
    header = msgspec.structs.replace(header, markers=markers)
    again = _samples(path, header, _messages(path, complete), [])
    return header, ({topic: pair} for topic, pair in again), complete


def is_foreign(path: Path) -> bool:
    """Whether it is MCAP of another program."""
    with path.open("rb") as file:
        head = file.read(256)
    return head.startswith(MAGIC) and len(head) >= 64 and LIBRARY.encode() not in head


def _is_whole(path: Path) -> bool:
    """Whether the file is whole, and then that all its bytes are as they were written.

    Raises:
        RecordingError: it is whole but damaged, or of another program.
    """
    if is_foreign(path):
        raise RecordingError(f"{path} is an MCAP file but no recording of holdfast")
    complete = _is_finished(path)
    if complete:
        _check_sums(path)
    return complete


def _header(path: Path, messages: Iterator[_Found], complete: bool) -> Header:
    """The header, which is the first message."""
    first = next(messages, None)
    if first is not None and first.topic == HEADER_TOPIC:
        return decode(decode_text(first.data)[1], path)
    if complete:
        raise RecordingError(f"{path} is an MCAP file but no recording of holdfast")
    raise RecordingError(f"{path} is cut so early that nothing can be recovered: it has no header")


def _samples(
    path: Path,
    header: Header,
    messages: Iterator[_Found],
    markers: list[tuple[float, str]],
) -> Iterator[tuple[str, tuple[Array, npt.NDArray[Any]]]]:
    """Topic, times and values of each message; markers are put into the list."""
    every = {series.topic: series for series in series_of(header)}
    for message in messages:
        if message.topic == MARKERS_TOPIC:
            markers.append(decode_text(message.data))
        elif message.topic != HEADER_TOPIC:
            yield message.topic, _unpacked_samples(path, message, every.get(message.topic))


def _unpacked_samples(
    path: Path, message: _Found, series: Series | None
) -> tuple[Array, npt.NDArray[Any]]:
    number = number_of_type(message.schema)
    try:
        times, values = decode_samples(message.data, number)
    except (ValueError, TypeError) as cause:
        raise RecordingError(f"{path}: {message.topic}: {cause}") from cause
    if series is None or series.number not in (None, number) or values.shape[1:] != series.shape:
        raise RecordingError(f"{path}: {message.topic} is not as the header says")
    return times, values


def _even(samples: dict[str, tuple[Array, npt.NDArray[Any]]]) -> Samples:
    """Truth arrays cut to the rows that all of them have: a cut file may lack some at its end."""
    truth = [topic for topic in samples if topic.startswith("/truth/")]
    n = min((len(samples[topic][0]) for topic in truth), default=0)
    return samples | {topic: (samples[topic][0][:n], samples[topic][1][:n]) for topic in truth}


def _messages(path: Path, complete: bool) -> Iterator[_Found]:
    """Messages whose checksums hold, in order; a gap in their numbers is damage."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    expected = 0
    for chunk in _chunks(path, complete):
        for record in chunk:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels.get(record.channel_id)
                if channel is None or channel.schema_id not in schemas:
                    raise RecordingError(f"{path} is damaged: a message without its channel")
                if channel.message_encoding == "cdr" and record.sequence != expected & 0xFFFFFFFF:
                    raise RecordingError(f"{path} is damaged: message {expected} is missing")
                expected += 1
                yield _Found(channel.topic, schemas[channel.schema_id].name, record.data)


def _chunks(path: Path, complete: bool) -> Iterator[list[object]]:
    """The records in one chunk after the other; of a cut file, up to the cut."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path} is no MCAP file, or its first bytes are damaged")
        while len(head := file.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(head)
            if opcode == Opcode.DATA_END:
                return
            end = file.tell() + length
            if end > size:
                return
            if opcode != Opcode.CHUNK:
                file.seek(end)
                continue
            try:
                records = _unpacked(file.read(length))
            except (McapError, ValueError, MemoryError, struct.error, ZstdError) as cause:
                if not complete and end == size:
                    return
                raise RecordingError(
                    f"{path} is damaged: the chunk at byte {end - length} fails its checksum"
                ) from cause
            yield records


def _unpacked(data: bytes) -> list[object]:
    chunk = Chunk.read(ReadDataStream(BytesIO(data)))
    if chunk.uncompressed_size > _MOST_CHUNK:
        raise ValueError(f"{chunk.uncompressed_size} bytes claimed")
    if chunk.uncompressed_crc == 0 and chunk.uncompressed_size:
        raise ValueError("no checksum")
    return list(breakup_chunk(chunk, validate_crc=True))


def _is_finished(path: Path) -> bool:
    """Whether the file has its footer; one that ends before was cut."""
    if path.stat().st_size == 0:
        raise RecordingError(f"{path} is empty (0 bytes); an MCAP recording expected")
    with path.open("rb") as file:
        opcode, length, *_ = _FOOTER.unpack(_tail(file))
        file.seek(-min(len(MAGIC), path.stat().st_size), 2)
        ends = file.read() == MAGIC
    return (ends and path.stat().st_size > len(MAGIC)) or _is_footer(opcode, length)


def _is_footer(opcode: int, length: int) -> bool:
    return opcode == Opcode.FOOTER and length == _FOOTER.size - _RECORD.size


def _tail(file: BinaryIO) -> bytes:
    """The bytes where the footer is to be, before the magic at the end."""
    size = file.seek(0, 2)
    file.seek(max(0, size - _FOOTER.size - len(MAGIC)))
    return file.read(_FOOTER.size).ljust(_FOOTER.size, b"\x00")


def _check_sums(path: Path) -> None:
    """Checks every byte of a finished file: data section, its end, summary, footer, magic.

    Raises:
        RecordingError: a checksum fails.
    """
    with path.open("rb") as file:
        opcode, length, start, _, summary_crc = _FOOTER.unpack(_tail(file))
        size = file.seek(0, 2)
        place = size - len(MAGIC) - _FOOTER.size
        sound = _is_footer(opcode, length) and _DATA_END.size + len(MAGIC) <= start <= place
        if sound:
            file.seek(0)
            data_crc = _crc(file, start - _DATA_END.size)
            ending = _DATA_END.unpack(file.read(_DATA_END.size))
            sound = (
                ending == (Opcode.DATA_END, 4, data_crc)
                and _crc(file, place + _FOOTER.size - 4 - start) == summary_crc
                and file.read()[4:] == MAGIC
            )
    if not sound:
        raise RecordingError(
            f"{path} is damaged, or was not written by holdfast: its checksums do not match"
        )


def _crc(file: BinaryIO, n_bytes: int) -> int:
    crc = 0
    while n_bytes and (block := file.read(min(_BLOCK, n_bytes))):
        crc = zlib.crc32(block, crc)
        n_bytes -= len(block)
    return crc
