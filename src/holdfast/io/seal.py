"""A hash over all bytes of a file, kept inside it: any flipped bit breaks the seal."""

import hashlib
from pathlib import Path

from holdfast.errors import RecordingError

KEY = "holdfast.seal"
BLANK = "0" * 64
"""What stands where the seal will be: as long as the seal."""

TAIL = 8
"""A Parquet file ends with the length of its footer (4 bytes) and its magic (4 bytes)."""

_BLOCK = 1 << 20


def seal(path: Path) -> None:
    """Writes the seal in place of the blank that the footer of a Parquet file holds."""
    place = _place(path)
    digest = _digest(path, place)
    with path.open("r+b") as file:
        file.seek(place)
        file.write(digest)


def check_seal(path: Path) -> None:
    """Does nothing where the file is as it was when it was sealed; reads it in blocks.

    Raises:
        RecordingError: it has no seal, or another content.
    """
    place = _place(path)
    with path.open("rb") as file:
        file.seek(place)
        given = file.read(len(BLANK))
    if given != _digest(path, place):
        raise RecordingError(f"{path} is damaged: its content does not match its seal")


def read_footer(path: Path) -> tuple[int, bytes]:
    """Where the footer of a Parquet file begins, and its bytes."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - TAIL))
        tail = file.read()
        footer_size = int.from_bytes(tail[:4], "little") + TAIL
        file.seek(max(0, size - footer_size))
        start = file.tell()
        return start, file.read()


def _place(path: Path) -> int:
    """Where the seal's characters begin."""
    start, footer = read_footer(path)
    # In the footer's thrift encoding a value follows its key: field header, varint length.
    mark = KEY.encode() + b"\x18" + bytes([len(BLANK)])
    if footer.count(mark) != 1:
        raise RecordingError(f"{path} is damaged: its seal is missing or broken")
    return start + footer.index(mark) + len(mark)


def _digest(path: Path, place: int) -> bytes:
    state = hashlib.blake2b(digest_size=len(BLANK) // 2)
    left = place
    with path.open("rb") as file:
        while left and (block := file.read(min(_BLOCK, left))):
            state.update(block)
            left -= len(block)
        state.update(BLANK.encode())
        file.seek(place + len(BLANK))
        while block := file.read(_BLOCK):
            state.update(block)
    return state.hexdigest().encode()
