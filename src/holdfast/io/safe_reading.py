"""What a file may do to its reader: raise errors of any type, or take more memory than expected."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from holdfast.errors import HoldfastError, RecordingError

MIN_SIZE_LIMIT = 1 << 30
"""Size in memory that every file may have [bytes]."""
MAX_EXPANSION = 50
"""Size in memory that a large file may have, as a multiple of its own size."""
LIMIT_VARIABLE = "HOLDFAST_MAX_BYTES"
"""Environment variable that replaces both [bytes]."""
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
    except HoldfastError:
        raise
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror or cause}") from cause
    except MemoryError as cause:
        raise RecordingError(f"{path} does not fit into memory: {one_line(cause)}") from cause
    except Exception as cause:
        raise RecordingError(f"{path} is damaged: {one_line(cause)}") from cause


def one_line(cause: BaseException) -> str:
    """Return the text of an error in one line of limited length; its type if it has no text."""
    return " ".join(str(cause).split())[:MAX_CAUSE_LENGTH] or type(cause).__name__


def size_limit(path: Path) -> int:
    """Return the maximum size in memory of the content of a file [bytes].

    It is 1 GiB, or 50 times the size of the file if that is more: real recordings shrink to a
    third or a tenth when they are compressed. `HOLDFAST_MAX_BYTES` replaces it.

    Raises:
        RecordingError: the variable is not a whole number of at least 1.
    """
    given = os.environ.get(LIMIT_VARIABLE)
    if not given:
        return max(MIN_SIZE_LIMIT, MAX_EXPANSION * path.stat().st_size)
    if not (given.isascii() and given.isdigit() and len(given) < 20 and int(given)):
        raise RecordingError(f"{LIMIT_VARIABLE}: a whole number of bytes expected, {given!r} given")
    return int(given)


def check_size(path: Path, n_bytes: int) -> None:
    """Check that the content of a file may have a size in memory.

    Raises:
        RecordingError: it is larger than `size_limit`.
    """
    if n_bytes > (limit := size_limit(path)):
        raise RecordingError(
            f"{path} takes {_megabytes(n_bytes)} in memory, {_megabytes(limit)} are allowed for a "
            f"file of {_megabytes(path.stat().st_size)}; set {LIMIT_VARIABLE} to read it anyway"
        )


def _megabytes(n_bytes: int) -> str:
    return f"{n_bytes / 1e6:.6g} MB"
