"""Output stream of a recording: unbuffered, and of one program alone."""

import errno
import os
from io import FileIO
from pathlib import Path

from holdfast.errors import OutputError
from holdfast.files import check_regular, lock


def open_locked(path: Path, *, force: bool) -> FileIO:
    """Open a file for writing, and lock it until it is closed, where the system has locks.

    A file that another program is recording keeps its content.

    Raises:
        OutputError: another program is recording to the file, or it is no regular file.
        OSError: it cannot be opened.
    """
    # O_NONBLOCK: to open a pipe must not wait; `check_regular` refuses it afterwards.
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0) | (0 if force else os.O_EXCL)
    file = os.fdopen(os.open(path, flags | getattr(os, "O_BINARY", 0), 0o666), "wb", buffering=0)
    try:
        check_regular(path)
        try:
            lock(file.fileno())
        except BlockingIOError as cause:
            raise OutputError(
                f"{path} is being recorded by another program; choose another name"
            ) from cause
        except OSError:  # a network file system without locks
            pass
        # Only now, and not by O_TRUNC: a file that another program records keeps its content.
        file.truncate(0)
    except BaseException:
        file.close()
        raise
    return file


class UnbufferedStream:
    """Output stream without a buffer; `mcap` would add one to a plain file.

    After the first error of the disk every write fails. Without this, the end of the file could
    follow a missing part, and the file would be damaged instead of cut.

    Args:
        file: file that was opened with `buffering=0`.

    Attributes:
        n_bytes: number of bytes written.
    """

    def __init__(self, file: FileIO) -> None:
        self.n_bytes = 0
        self._file = file
        self._error: OSError | None = None

    def write(self, data: bytes) -> int:
        """Write all bytes; check that the file has only those written before."""
        if self._error:
            raise OSError(*self._error.args)
        left = memoryview(data)
        try:
            if os.fstat(self._file.fileno()).st_size != self.n_bytes:
                raise OSError(errno.EIO, "another program changed it while it was recorded")
            while left:
                n = self._file.write(left)
                self.n_bytes += n
                left = left[n:]
        except OSError as error:
            self._error = error
            raise
        return len(data)

    def tell(self) -> int:
        """Return the length of the file in bytes."""
        return self.n_bytes

    def flush(self) -> None:
        """Do nothing: there is no buffer."""
