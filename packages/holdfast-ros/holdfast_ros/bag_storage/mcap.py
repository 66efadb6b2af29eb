"""Bags of ROS 2 in MCAP, read from their beginning to their end without their index.

An index may name a chunk any number of times, so that it is not used. Messages of the topics that
are wanted are sorted by time.
"""

import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema, Statistics
from mcap.writer import MCAP0_MAGIC as MAGIC

from holdfast.io.mcap_records import records_in
from holdfast.io.safe_reading import ReadBudget
from holdfast_ros.bag_storage import BagConnection, check_number
from holdfast_ros.bag_storage.unpacking import unpack

# Head of a record: its kind and the length of its content.
_RECORD = struct.Struct("<BQ")
# Head (9 bytes), two offsets (8 each) and a checksum (4).
_FOOTER_SIZE = 29
_MESSAGE = struct.Struct("<HIQQ")
"""Beginning of a message: its channel, number, time of recording and time of sending."""
# Definitions in IDL are not parsed.
_DEFINITION_ENCODING = "ros2msg"


class McapBag:
    """Reader of a bag in MCAP; see `open_mcap`."""

    def __init__(self, file: BinaryIO, budget: ReadBudget) -> None:
        self._file = file
        self._budget = budget
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        # A file without its footer was cut.
        self._file.seek(max(0, self._file.seek(0, 2) - len(MAGIC) - _FOOTER_SIZE))
        tail = self._file.read()
        self.complete = tail.endswith(MAGIC) and tail[0] == Opcode.FOOTER
        # The summary has channels and numbers of messages; chunks are unpacked only without one.
        counts: Counter[int] = Counter()
        statistics = None
        has_chunks = False
        for opcode, content in self._records(in_chunks=False):
            has_chunks |= opcode == Opcode.CHUNK
            if opcode == Opcode.STATISTICS:
                statistics = Statistics.read(ReadDataStream(BytesIO(content)))
            self._add(opcode, content, counts)
        if has_chunks and (statistics is None or not self._channels or not self._schemas):
            counts.clear()
            for opcode, content in self._records(in_chunks=True):
                self._add(opcode, content, counts)
        self._counts = counts if statistics is None else Counter(statistics.channel_message_counts)

    @property
    def connections(self) -> list[BagConnection]:
        """All connections."""
        # A channel may have no schema, by the number 0.
        none = Schema(id=0, data=b"", encoding="", name="")
        found = [(one, self._schemas.get(one.schema_id, none)) for one in self._channels.values()]
        return [
            BagConnection(
                channel.id,
                channel.topic,
                schema.name,
                schema.data.decode() if schema.encoding == _DEFINITION_ENCODING else "",
                self._counts[channel.id],
            )
            for channel, schema in found
        ]

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield connection, time [ns] and bytes of each message of connections, by time."""
        found: list[tuple[int, int, bytes]] = []
        for opcode, content in self._records(in_chunks=True):
            if opcode == Opcode.MESSAGE:
                number, _, time, _ = _MESSAGE.unpack_from(content)
                if number in numbers:
                    self._budget.keep(len(content), 1)
                    found.append((number, time, content[_MESSAGE.size :]))
        yield from sorted(found, key=lambda message: message[1])

    def _add(self, opcode: int, content: bytes, counts: Counter[int]) -> None:
        if opcode == Opcode.MESSAGE:
            counts[_MESSAGE.unpack_from(content)[0]] += 1
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(content)))
            # Schemas and channels are repeated in chunks and in the summary; the first one counts.
            if schema.id not in self._schemas:
                self._budget.keep(len(schema.data) + len(schema.name), 1)
                self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(content)))
            if channel.id not in self._channels:
                self._budget.keep(len(content), 1 + len(channel.metadata))
                self._channels[channel.id] = channel
                check_number(len(self._channels))

    def _records(self, *, in_chunks: bool) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each record that matters, with those in chunks if asked.

        Raises:
            ValueError: the file is damaged; if it is cut, records end where they are damaged.
        """
        place = len(MAGIC)
        end = self._file.seek(0, 2) - (len(MAGIC) if self.complete else 0)
        while place < end:
            self._budget.step()
            self._file.seek(place)
            head = self._file.read(_RECORD.size)
            # No record has the kind 0: a cut file may end with zeros.
            if not self.complete and (len(head) < _RECORD.size or not head[0]):
                return
            opcode, length = _RECORD.unpack(head)
            place += _RECORD.size + length
            if place > end and not self.complete:
                return
            if place > end:
                raise ValueError(f"a record of {length} bytes ends after the file")
            if opcode == Opcode.CHUNK and in_chunks:
                try:
                    chunk = Chunk.read(ReadDataStream(BytesIO(self._file.read(length))))
                    size = chunk.uncompressed_size
                    data = unpack(chunk.data, chunk.compression, self._budget, size)
                    # A checksum of 0 is none.
                    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
                        raise ValueError("the checksum of a chunk does not match")
                except (ValueError, McapError, struct.error):
                    if self.complete:
                        raise
                    return
                yield from records_in(data, self._budget)
            elif opcode == Opcode.CHUNK:
                # Not unpacked, because the summary may have all that is needed.
                yield opcode, b""
            elif opcode in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
                yield opcode, self._file.read(length)


@contextmanager
def open_mcap(path: Path, budget: ReadBudget) -> Iterator[McapBag]:
    """Open a bag in MCAP for reading.

    Raises:
        ValueError: it is damaged.
    """
    with path.open("rb") as file:
        yield McapBag(file, budget)
