"""Records of the MCAP files of recordings: their chunks, their checksums, and where they are cut.

Every length in a complete file is under a checksum. In a file that was cut, a damaged length
could be taken for the cut; so each length is compared with the lengths inside of its record.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC as MAGIC

from holdfast.errors import RecordingError
from holdfast.io.safe_reading import one_line

MAX_CHUNK_SIZE = 1 << 28
"""Maximum size of a chunk before and after unpacking, in bytes; a larger one is refused."""
BLOCK_SIZE = 1 << 20
"""Number of bytes that are read at a time."""

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_DATA_END = struct.Struct("<BQI")
_CHUNK = struct.Struct("<QQQII")
"""Beginning of a chunk: its times, size and checksum, and the length of a name."""
_HEAD_SIZE = 64
"""Number of bytes of a record that are needed to compare its lengths."""


def read_chunks(path: Path, complete: bool) -> Iterator[bytes]:
    """Yield the unpacked bytes of each chunk; for a cut file, of each chunk before the cut.

    Args:
        path: path of the file.
        complete: whether the file has its end, so that `check_checksums` has checked it.

    Raises:
        RecordingError: the file is damaged.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise RecordingError(f"{path} is no MCAP file, or its first bytes are damaged")
        while len(record := file.read(_RECORD.size)) == _RECORD.size:
            opcode, length = _RECORD.unpack(record)
            start, end = file.tell(), file.tell() + length
            head = file.read(min(length, _HEAD_SIZE))
            if not complete and not _is_plausible(opcode, length, head):
                # Zeros up to the end are blocks that a power failure lost: a cut, no damage.
                if _is_blank(file, start + _HEAD_SIZE):
                    return
                raise RecordingError(
                    f"{path} is damaged: the record at byte {start - _RECORD.size} contradicts "
                    "its length"
                )
            # A record that ends after the file is where it was cut.
            if opcode == Opcode.DATA_END or end > size:
                return
            if opcode == Opcode.CHUNK:
                try:
                    data = _unpacked(head + file.read(length - len(head)))
                except (McapError, ValueError, MemoryError, OverflowError, struct.error) as cause:
                    if not complete and _is_blank(file, end):
                        return
                    raise RecordingError(
                        f"{path} is damaged: the chunk at byte {start} fails its checksum "
                        f"({one_line(cause)})"
                    ) from cause
                yield data
            file.seek(end)


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the kind and the content of each record in the bytes of a chunk.

    Raises:
        ValueError: a record is longer than the chunk.
    """
    offset = 0
    while offset < len(data):
        opcode, length = _RECORD.unpack_from(data, offset)
        offset += _RECORD.size + length
        if offset > len(data):
            raise ValueError(f"a record of {length} bytes ends after its chunk")
        yield opcode, data[offset - length : offset]


def has_end(path: Path) -> bool:
    """Return whether the file has a footer; a file without one was cut.

    Raises:
        RecordingError: the file is empty.
    """
    size = path.stat().st_size
    if size == 0:
        raise RecordingError(f"{path} is empty (0 bytes); an MCAP recording expected")
    with path.open("rb") as file:
        opcode, length, *_ = _FOOTER.unpack(_tail(file))
        file.seek(-min(len(MAGIC), size), 2)
        ends = file.read() == MAGIC
    # Either of the two: a file with a flipped bit in one of them is damaged, not cut.
    return (ends and size > len(MAGIC)) or _is_footer(opcode, length)


def check_checksums(path: Path) -> None:
    """Check every byte of a complete file: data section, its end, summary, footer, magic.

    Raises:
        RecordingError: a checksum does not match.
    """
    with path.open("rb") as file:
        opcode, length, start, _, summary_crc = _FOOTER.unpack(_tail(file))
        size = file.seek(0, 2)
        offset = size - len(MAGIC) - _FOOTER.size
        valid = _is_footer(opcode, length) and _DATA_END.size + len(MAGIC) <= start <= offset
        if valid:
            file.seek(0)
            data_crc = _crc(file, start - _DATA_END.size)
            ending = _DATA_END.unpack(file.read(_DATA_END.size))
            valid = (
                ending == (Opcode.DATA_END, 4, data_crc)
                and _crc(file, offset + _FOOTER.size - 4 - start) == summary_crc
                and file.read()[4:] == MAGIC  # after the checksum of the summary itself
            )
    if not valid:
        raise RecordingError(
            f"{path} is damaged, or was not written by holdfast: its checksums do not match"
        )


def _is_plausible(opcode: int, length: int, head: bytes) -> bool:
    """Return whether a record is of a kind that recordings have, with a content as long as it says.

    Args:
        opcode: kind of the record.
        length: of the record, in bytes.
        head: its first bytes; a record that is cut has less of them.
    """
    match opcode:
        case Opcode.HEADER | Opcode.METADATA:  # two texts, or a text and a map
            first = _number(head, 0, 4)
            second = None if first is None else _number(head, 4 + first, 4)
            inside = None if first is None or second is None else 8 + first + second
        case Opcode.MESSAGE_INDEX:
            n_bytes = _number(head, 2, 4)
            inside = None if n_bytes is None else 6 + n_bytes
        case Opcode.CHUNK:
            first = _number(head, _CHUNK.size - 4, 4)  # of the name of the compression
            second = None if first is None else _number(head, _CHUNK.size + first, 8)
            inside = None
            if first is not None and second is not None:
                inside = _CHUNK.size + first + 8 + second
        case Opcode.DATA_END:
            inside = 4
        case _:  # a recording has no other records outside of chunks
            return False
    # None: the lengths inside are cut off; there is nothing to compare.
    return length < MAX_CHUNK_SIZE and inside in (None, length)


def _number(data: bytes, offset: int, size: int) -> int | None:
    """Return the number of `size` bytes at an offset; None if the data end before."""
    part = data[offset : offset + size]
    return int.from_bytes(part, "little") if len(part) == size else None


def _is_blank(file: BinaryIO, offset: int) -> bool:
    """Return whether there are only zeros from an offset on, as after a failure of the power."""
    file.seek(offset)
    while block := file.read(BLOCK_SIZE):
        if any(block):
            return False
    return True


def _unpacked(data: bytes) -> bytes:
    """Return the bytes in a chunk, whose checksum is right."""
    chunk = Chunk.read(ReadDataStream(BytesIO(data)))
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"compression {chunk.compression[:20]!r} given, zstd expected")
    if chunk.uncompressed_size > MAX_CHUNK_SIZE:
        raise ValueError(f"{chunk.uncompressed_size} bytes claimed")
    # The format allows 0 for "not computed", and readers then check nothing.
    if chunk.uncompressed_crc == 0 and chunk.uncompressed_size:
        raise ValueError("no checksum")
    try:
        # zstd allocates the size that the packed data claim; it is -1 if they claim none.
        if (
            chunk.compression
            and not 0 <= zstandard.frame_content_size(chunk.data) <= chunk.uncompressed_size
        ):
            raise ValueError("its packed size contradicts its size")
        stream, n_bytes = get_chunk_data_stream(chunk, validate_crc=True)
        return stream.read(n_bytes)
    except zstandard.ZstdError as cause:
        raise ValueError(str(cause)) from cause


def _is_footer(opcode: int, length: int) -> bool:
    return opcode == Opcode.FOOTER and length == _FOOTER.size - _RECORD.size


def _tail(file: BinaryIO) -> bytes:
    """Return the bytes at the offset of the footer, before the magic at the end."""
    size = file.seek(0, 2)
    file.seek(max(0, size - _FOOTER.size - len(MAGIC)))
    return file.read(_FOOTER.size).ljust(_FOOTER.size, b"\x00")


def _crc(file: BinaryIO, n_bytes: int) -> int:
    crc = 0
    while n_bytes and (block := file.read(min(BLOCK_SIZE, n_bytes))):
        crc = zlib.crc32(block, crc)
        n_bytes -= len(block)
    return crc
