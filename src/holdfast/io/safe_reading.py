"""What a file may do to its reader: raise errors of any type, or take more memory than expected."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from holdfast.errors import HoldfastError, RecordingError

FREE_MEMORY = 200_000_000
MEMORY_PER_BYTE = 10
MAX_MEMORY = 1 << 30
"""Memory for reading: 200 MB and ten times the size of the file, at most 1 GiB [bytes]."""
LIMIT_VARIABLE = "HOLDFAST_MAX_BYTES"
"""Environment variable that replaces it [bytes]."""
MAX_EXPANSION = 50
"""Size of the content of a large file that is read in parts, as a multiple of its own size."""
MAX_WORK = 4
"""Bytes that may be unpacked in all while a file is read, as a multiple of its content."""
ITEM_SIZE = 512
"""Size in memory that an object counts besides its bytes, such as a message [bytes]."""
STEP_WORK = 2048
"""Work that a record counts, however short it is [bytes that are unpacked]."""
JSON_EXPANSION = 32
"""Size in memory of a decoded JSON text, as a multiple of its length; an empty list has 21."""
WORK_PER_SAMPLE = 128
"""Memory that verbs need of each sample of a module beside its readings, as for estimates [bytes].

Measured: `evaluate` 75, `label auto` 70."""
WAY_OUT = f"cut it into shorter files, or set {LIMIT_VARIABLE} to read it anyway"
"""End of the message about a file that needs too much memory."""
PARTS_WAY_OUT = f"{WAY_OUT}; `holdfast info` and `detect` read it in parts"
"""The same of a recording of holdfast."""
MAX_CAUSE_LENGTH = 200
"""Number of characters of a foreign error that are shown."""


@contextmanager
def recording_errors(path: Path) -> Iterator[None]:
    """Convert all errors inside a `with` block to `RecordingError` with the name of the file.

    Libraries raise errors of any type for a file that was damaged or made by an attacker.

    Raises:
        RecordingError: reading failed.
    """
    try:
        yield
    except HoldfastError:  # it names the file already
        raise
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or one_line(cause)}") from cause
    except MemoryError as cause:
        raise RecordingError(f"{path} does not fit into memory: {one_line(cause)}") from cause
    except Exception as cause:
        raise RecordingError(f"{path} is damaged: {one_line(cause)}") from cause


def one_line(cause: BaseException) -> str:
    """Return the text of an error in one line of limited length; its type if it has no text."""
    return " ".join(str(cause).split())[:MAX_CAUSE_LENGTH] or type(cause).__name__


def stored_size(path: Path) -> int:
    """Return the size of a file without its holes, or of the files in a folder [bytes].

    A sparse file has a size of any number of bytes, of which the disk has only some.
    """
    if path.is_dir():
        return sum(stored_size(file) for file in path.rglob("*") if file.is_file())
    stat = path.stat()
    if 512 * getattr(stat, "st_blocks", stat.st_size) >= stat.st_size or not stat.st_size:
        return stat.st_size
    # It has holes, or its disk compresses it, or it is not yet on the disk: count what is no hole.
    n_bytes = 0
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        end = 0
        while end < size:
            try:
                start = os.lseek(file.fileno(), end, os.SEEK_DATA)
                end = os.lseek(file.fileno(), start, os.SEEK_HOLE)
            except OSError as cause:
                if cause.errno == errno.ENXIO:  # only a hole is left
                    return n_bytes
                return size  # the file system does not report holes
            n_bytes += end - start
    return n_bytes


def size_limit(path: Path) -> int:
    """Return the memory that reading a file or folder may take [bytes].

    Real recordings shrink to a third or a tenth when they are compressed.

    Raises:
        RecordingError: the variable is not a whole number of at least 1.
    """
    return given_limit() or min(FREE_MEMORY + MEMORY_PER_BYTE * stored_size(path), MAX_MEMORY)


def given_limit() -> int | None:
    """Return the limit in `HOLDFAST_MAX_BYTES` [bytes]; None without one.

    Raises:
        RecordingError: as `size_limit`.
    """
    given = os.environ.get(LIMIT_VARIABLE)
    if not given:
        return None
    # `int` alone would take "1_000" and digits of any script.
    if not (given.isascii() and given.isdigit() and len(given) < 20 and int(given)):
        raise RecordingError(f"{LIMIT_VARIABLE}: a whole number of bytes expected, {given!r} given")
    return int(given)


def check_size(path: Path, n_bytes: int, way_out: str = WAY_OUT) -> None:
    """Check that the content of a file may have a size in memory.

    Args:
        path: of the file.
        n_bytes: size of the content [bytes].
        way_out: what the user may do.

    Raises:
        RecordingError: it is larger than `size_limit`.
    """
    if n_bytes > (limit := size_limit(path)):
        raise RecordingError(
            f"{path} takes {megabytes(n_bytes)} in memory, {megabytes(limit)} are allowed for a "
            f"file of {megabytes(stored_size(path))}; {way_out}"
        )


class ReadBudget:
    """Memory and work that one file may cost while it is read.

    Every reader has one for each file. Memory is limited by `size_limit`, and work by the size
    of the file, so that a reader that forgets what it has read also ends.

    Args:
        path: path of the file or folder.
        way_out: what the user may do if it needs too much memory.

    Raises:
        RecordingError: it is a sparse file that is larger than what may be read from it.
    """

    def __init__(self, path: Path, way_out: str = WAY_OUT) -> None:
        self._path = path
        self._way_out = way_out
        self._limit = size_limit(path)
        self._kept = 0  # memory in use until the file is read [bytes]
        self._work = 0  # all that was unpacked, kept or not [bytes]
        content = given_limit() or max(MAX_MEMORY, MAX_EXPANSION * stored_size(path))
        self._max_work = MAX_WORK * content
        size = path.stat().st_size
        if not path.is_dir() and size > max(self._limit, stored_size(path)):
            raise RecordingError(
                f"{path} is a sparse file: {megabytes(size)} long, of which "
                f"{megabytes(stored_size(path))} are stored; at most "
                f"{megabytes(self._limit)} are read from it"
            )

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._path

    @property
    def free(self) -> int:
        """Memory that is left [bytes]."""
        return self._limit - self._kept

    def keep(self, n_bytes: int, n_items: int = 0) -> None:
        """Count memory that is in use until the file is read.

        Args:
            n_bytes: size of the values [bytes].
            n_items: number of objects that hold them.

        Raises:
            RecordingError: the memory is used up.
        """
        self._kept += n_bytes + n_items * ITEM_SIZE
        if self._kept > self._limit:
            check_size(self._path, self._kept, self._way_out)

    def unpack(self, n_bytes: int) -> None:
        """Count bytes that are in memory only until the next bytes are unpacked.

        Raises:
            RecordingError: the memory or the work is used up.
        """
        if self._kept + n_bytes > self._limit:
            check_size(self._path, self._kept + n_bytes, self._way_out)
        self._add_work(n_bytes)

    def step(self, n_steps: int = 1) -> None:
        """Count records that are read, or other steps of about a microsecond.

        Raises:
            RecordingError: the work is used up.
        """
        self._add_work(n_steps * STEP_WORK)

    def _add_work(self, n_bytes: int) -> None:
        self._work += n_bytes
        if self._work > self._max_work:
            raise RecordingError(
                f"{self._path} takes too long to read: a file of "
                f"{megabytes(stored_size(self._path))} has records of more than "
                f"{megabytes(self._max_work)} when it is unpacked, where a short record "
                f"counts {STEP_WORK} bytes; set {LIMIT_VARIABLE} to read it anyway"
            )


def megabytes(n_bytes: int) -> str:
    """Return a number of bytes as a text in MB."""
    return f"{n_bytes / 1e6:.6g} MB"
