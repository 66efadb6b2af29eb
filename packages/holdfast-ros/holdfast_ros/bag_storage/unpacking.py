"""Unpack the chunks, messages and files of bags, up to a size."""

import bz2
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Protocol

import zstandard

from holdfast.io.mcap_records import MAX_CHUNK_SIZE
from holdfast.io.safe_reading import STEP_WORK, ReadBudget

BZ2_WORK = 3
"""Additional work that a byte counts which bz2 unpacks; the others are several times as fast."""
BLOCK_SIZE = 1 << 20
"""Number of bytes that are read at a time."""


class _Decompressor(Protocol):
    @property
    def eof(self) -> bool: ...
    @property
    def unused_data(self) -> bytes | None: ...
    def decompress(self, data: bytes, max_length: int, /) -> bytes: ...


def unpack(data: bytes, compression: str, budget: ReadBudget, size: int | None = None) -> bytes:
    """Return unpacked bytes.

    Args:
        data: packed bytes.
        compression: `zstd`, `lz4`, `bz2`, or empty (or `none`) for none.
        budget: of the file.
        size: expected number of bytes; None if any number is right.

    Raises:
        RecordingError: they take more memory or work than the budget has.
        ValueError: the compression is unknown, or the data are damaged, of another size, or
            larger than a chunk may be.
    """
    if (size or 0) > MAX_CHUNK_SIZE:
        raise ValueError(f"at most {MAX_CHUNK_SIZE} unpacked bytes expected, {size} given")
    # Before the bytes take memory, where their number is known.
    budget.unpack(size or 0)
    found = _unpacked(data, compression, MAX_CHUNK_SIZE if size is None else size)
    if compression == "bz2":
        budget.step(BZ2_WORK * len(found) // STEP_WORK)
    if len(found) > MAX_CHUNK_SIZE:
        raise ValueError(f"at most {MAX_CHUNK_SIZE} unpacked bytes expected, more given")
    if size is None:
        budget.unpack(len(found))
    elif len(found) != size:
        raise ValueError(f"{size} bytes expected in packed data, {len(found)} or more given")
    return found


def unpack_file(source: Path, target: Path, budget: ReadBudget) -> None:
    """Unpack a file of zstd into another file, which may be as large as the memory of the budget.

    Raises:
        RecordingError: it would be larger.
        ValueError: the file is damaged.
    """
    with source.open("rb") as packed, target.open("wb") as file:
        stream = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
        try:
            while block := stream.read(BLOCK_SIZE):
                budget.keep(len(block))
                file.write(block)
        except zstandard.ZstdError as cause:
            raise ValueError(str(cause)) from cause


def _unpacked(data: bytes, compression: str, limit: int) -> bytes:
    """Return unpacked bytes; of more than `limit` bytes, one byte more than that."""
    if compression in ("", "none"):
        return data
    if compression == "zstd":
        decompressor = zstandard.ZstdDecompressor()
        try:
            stream = decompressor.stream_reader(BytesIO(data), read_across_frames=True)
            return stream.read(limit + 1)
        except zstandard.ZstdError as cause:
            raise ValueError(str(cause)) from cause
    if compression == "bz2":
        return parts_unpacked(data, bz2.BZ2Decompressor, limit)
    if compression == "lz4":
        import lz4.frame

        return parts_unpacked(data, lz4.frame.LZ4FrameDecompressor, limit)
    raise ValueError(f"compression {compression[:20]!r} given; zstd, lz4 or bz2 expected")


def parts_unpacked(data: bytes, make: Callable[[], _Decompressor], limit: int) -> bytes:
    """Unpack packed streams that follow each other."""
    found = bytearray()
    while data and len(found) <= limit:
        stream = make()
        try:
            found += stream.decompress(data, limit + 1 - len(found))
        except (OSError, RuntimeError) as cause:
            raise ValueError(f"packed data are damaged: {cause}") from cause
        if not stream.eof and len(found) <= limit:
            raise ValueError("packed data end too early")
        data = stream.unused_data or b""
    return bytes(found)
