"""Bags of ROS 1 (.bag), whose index is read by the package rosbags."""

import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from heapq import merge
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.io.safe_reading import ReadBudget
from holdfast_ros.bag_storage import BagConnection, check_number
from holdfast_ros.bag_storage.unpacking import unpack

if TYPE_CHECKING:
    from rosbags.rosbag1 import Reader

_LENGTH = struct.Struct("<I")
_INDEX_HEAD_SIZE = 55
# Time (8 bytes) and place in the chunk (4) of a message.
_INDEX_ENTRY_SIZE = 12
_CONNECTION, _MESSAGE = b"\x07", b"\x02"
"""Kinds of records in a chunk."""


class Ros1Bag:
    """Reader of a bag of ROS 1; see `open_ros1`.

    rosbags reads the index. Chunks are unpacked here, because rosbags unpacks whatever they hold.
    """

    complete = True

    def __init__(self, reader: "Reader", budget: ReadBudget) -> None:
        self._reader = reader
        self._budget = budget
        # The chunk that was unpacked last: most messages follow one of the same chunk.
        self._place, self._chunk = -1, b""

    @property
    def connections(self) -> list[BagConnection]:
        """All connections."""
        return [
            BagConnection(
                connection.id,
                connection.topic,
                connection.msgtype,
                connection.msgdef.data,
                connection.msgcount,
            )
            for connection in self._reader.connections
        ]

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield connection, time [ns] and bytes of each message of connections, by time."""
        from rosbags.rosbag1.reader import decompressors

        file: Any = self._reader.bio
        for entry in merge(*(self._reader.indexes[number] for number in set(numbers))):
            if entry.chunk_pos != self._place:
                chunk = self._reader.chunks[entry.chunk_pos]
                # rosbags keeps the function of a compression, not its name.
                names = [name for name, one in decompressors.items() if one is chunk.decompressor]
                file.seek(chunk.datapos)
                self._chunk = unpack(file.read(chunk.datasize), names[0], self._budget)
                self._place = entry.chunk_pos
            place, fields = entry.offset, {b"op": _CONNECTION}
            # The record of a connection may stand before its first message.
            while fields.get(b"op") == _CONNECTION:
                self._budget.step()
                head, place = self._part(place)
                data, place = self._part(place)
                fields = head_fields(head)
            if fields.get(b"op") != _MESSAGE:
                raise ValueError("a record of another kind than a message in the index")
            seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
            yield _LENGTH.unpack(fields[b"conn"])[0], seconds * 10**9 + nanoseconds, data

    def _part(self, place: int) -> tuple[bytes, int]:
        """Return the bytes at a place, which begin with their length, and the place after them."""
        start = place + _LENGTH.size
        end = start + _LENGTH.unpack_from(self._chunk, place)[0]
        if end > len(self._chunk):
            raise ValueError("a record ends after its chunk")
        return self._chunk[start:end], end


@contextmanager
def open_ros1(path: Path, budget: ReadBudget) -> Iterator[Ros1Bag]:
    """Open a bag of ROS 1 for reading.

    Raises:
        Exception: it is cut or damaged; rosbags raises errors of any type.
    """
    from rosbags.rosbag1 import Reader

    class BudgetReader(Reader):
        """Reader whose index counts in the budget."""

        def read_connection(self) -> Any:  # noqa: ANN401 (class of rosbags)
            budget.step()
            connection = super().read_connection()
            budget.keep(len(connection.msgdef.data), 1)
            return connection

        def read_chunk_info(self) -> Any:  # noqa: ANN401
            info = super().read_chunk_info()
            budget.keep(0, 1 + len(info.connection_counts))
            return info

        def read_index_data(self, pos: int, indexes: Any) -> None:  # noqa: ANN401
            file: Any = self.bio
            budget.step()
            start = file.tell()
            super().read_index_data(pos, indexes)
            n_entries = (file.tell() - start - _INDEX_HEAD_SIZE) // _INDEX_ENTRY_SIZE
            budget.keep(0, n_entries)

    with BudgetReader(path) as reader:
        check_number(len(reader.connections))
        yield Ros1Bag(reader, budget)


def head_fields(head: bytes) -> dict[bytes, bytes]:
    """Return the fields of the head of a record by name."""
    fields: dict[bytes, bytes] = {}
    place = 0
    while place < len(head):
        start = place + _LENGTH.size
        place = start + _LENGTH.unpack_from(head, place)[0]
        name, _, value = head[start:place].partition(b"=")
        fields[name] = value
    return fields
