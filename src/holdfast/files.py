"""Output files that are written whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from holdfast.errors import OutputError


@contextmanager
def whole_file(path: str | Path, *, force: bool = False) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` when the block ends without an exception.

    Args:
        path: of the output.
        force: replace an existing file.

    Yields:
        A path in the same folder, with the same suffix, to write to.

    Raises:
        OutputError: the file exists and `force` is not given, the folder does not exist, or the
            disk is full or read-only. The temporary file is removed.
    """
    target = Path(path)
    refuse_overwrite(target, force=force)
    try:
        handle, name = tempfile.mkstemp(target.suffix, f".{target.stem}.", target.parent)
    except OSError as cause:
        raise OutputError(f"cannot write {target}: {cause.strerror}") from cause
    os.close(handle)
    part = Path(name)
    try:
        yield part
        part.chmod(0o666 & ~_umask())
        part.replace(target)
    except OSError as cause:
        if cause.filename not in (None, str(part), str(target)):
            raise  # an input that the block reads, not the output
        raise OutputError(f"cannot write {target}: {cause.strerror or cause}") from cause
    finally:
        part.unlink(missing_ok=True)


def write_whole(path: str | Path, data: bytes, *, force: bool = False) -> None:
    """Write `data` to `path`, whole or not at all.

    Raises:
        OutputError: as `whole_file`.
    """
    with whole_file(path, force=force) as part:
        part.write_bytes(data)


def refuse_overwrite(path: str | Path, *, force: bool = False) -> None:
    """Raise an error if `path` must not be written.

    Raises:
        OutputError: `path` exists and `force` is not given, or its folder does not exist.
    """
    target = Path(path)
    if target.exists() and not force:
        raise OutputError(f"{target} exists already: choose another name, or give --force")
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: the folder {target.parent} does not exist")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
