"""Errors of any type, and too much memory, that a damaged file may cause in its reader."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from holdfast.errors import HoldfastError, RecordingError

MAX_RECORDING = 1 << 30
"""Maximum size in memory of a recording that is loaded as a whole [bytes]."""
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


def check_size(path: Path, n_bytes: int) -> None:
    """Check the size in memory of a recording that is loaded as a whole.

    Args:
        path: of its file.
        n_bytes: its size [bytes].

    Raises:
        RecordingError: it is larger than `MAX_RECORDING`.
    """
    if n_bytes > MAX_RECORDING:
        raise RecordingError(
            f"{path} takes {n_bytes / 1e6:.0f} MB in memory, at most {MAX_RECORDING / 1e6:.0f} MB "
            "are loaded as a whole: cut it into shorter files; `holdfast info` and `detect`, and "
            "`read_chunks` in Python, read it in parts"
        )
