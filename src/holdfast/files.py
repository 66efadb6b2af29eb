"""Files: outputs written whole or not at all, names, locks, the disk, and inputs that end."""

import errno
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import blake2b
from pathlib import Path
from typing import Any

from holdfast.errors import OutputError

MAX_STEM_SIZE = 190
"""Maximum length of the stem of a file's name, in bytes of UTF-8; systems allow 255 in all."""

_FORBIDDEN = frozenset('<>:"/\\|?*')
"""Characters that the name of a file must not have on some system."""
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE | re.ASCII)
"""Names that are devices on Windows."""
MAX_TOML_SIZE = 1 << 16
"""Size above which a TOML file is refused [bytes]; the tables of objects have 3 kB."""
MAX_TOML_DOTS = 16
"""Number of dots in a line of TOML, of keys and of numbers; the tables of objects have 10."""
MAX_POINTER_SIZE = 1024
"""Size below which all pointers of Git LFS are [bytes]."""
_LFS_BEGIN = b"version https://git-lfs.github.com/spec/"
_MAX_ATTEMPTS = 100
"""Number of random names that are tried for a temporary file."""


def file_stem(name: str) -> str:
    """Return a stem for the file of anything with a name, such as a recording or an object.

    A name that is valid for a file on every system is returned unchanged. Otherwise invalid
    characters are replaced, and a hash of the name is added, so that different names give
    different files. The file is always inside its folder.

    Example:
        >>> file_stem("can-case1-1"), file_stem("../../can")
        ('can-case1-1', '_.._can-7f7bd239')
    """
    kept = "".join("_" if c in _FORBIDDEN or not c.isprintable() else c for c in name)
    # A command would take a leading dash as an option; Windows drops dots and blanks at the end.
    kept = kept.strip(" .").lstrip("-")
    if len(encoded := kept.encode()) > MAX_STEM_SIZE:
        kept = encoded[: MAX_STEM_SIZE - 9].decode(errors="ignore")
    # Windows would open the device.
    if _RESERVED.fullmatch(kept):
        kept = f"_{kept}"
    if kept and kept == name:
        return name
    digest = blake2b(name.encode(errors="surrogatepass"), digest_size=4).hexdigest()
    return f"{kept or 'unnamed'}-{digest}"


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
    part = _new_file_beside(target)
    try:
        yield part
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
        OutputError: `path` exists and `force` is not given, or is a device or a pipe; or its folder
            does not exist.
    """
    target = Path(path)
    if target.exists() and not target.is_file() and not target.is_dir():
        raise OutputError(f"{target} is a device or a pipe; a file or a new name expected")
    if target.exists() and not force:
        raise OutputError(f"{target} exists already: choose another name, or give --force")
    if not target.parent.is_dir():
        raise OutputError(f"cannot write {target}: the folder {target.parent} does not exist")


def lock(handle: int, *, wait: bool = False) -> None:
    """Lock an open file or folder until it is closed, where the system has locks.

    The lock of a process that died ends with it.

    Args:
        handle: descriptor of the file or folder.
        wait: wait until no other process has locked it.

    Raises:
        BlockingIOError: another process has locked it, and `wait` is not given.
        OSError: the file system has no locks, as some on a network.
    """
    if os.name != "posix":
        return
    import fcntl

    fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


def sync(*files: int | Path) -> None:
    """Return when files are on the disk, where no power failure loses them.

    Args:
        files: descriptor of an open file, or path of a file or a folder (the entries of a folder
            are lost like the content of a file). Paths have no effect on Windows.

    Raises:
        OSError: a path cannot be opened, or the disk reports an error.
    """
    for file in files:
        if isinstance(file, int):
            os.fsync(file)
        elif os.name == "posix":
            handle = os.open(file, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def check_regular(path: str | Path, *, follow: bool = True) -> None:
    """Check that an input is a regular file: reading a pipe or a device may never end.

    Args:
        path: of the file.
        follow: accept a link to one.

    Raises:
        OSError: it is something else, or does not exist.
    """
    _check_mode(path, Path(path).stat(follow_symlinks=follow).st_mode)


def read_input(path: str | Path, max_size: int, *, follow: bool = True) -> bytes:
    """Return the content of a small input file, which is opened once.

    Args:
        path: of the file.
        max_size: number of bytes above which the file is refused.
        follow: accept a link. False for a file that only its place names, as one beside a
            recording: a folder of others could lead it anywhere.

    Raises:
        OSError: it cannot be read, is no regular file, or is too large.
    """
    check_regular(path, follow=follow)  # before it is opened, which may move a device
    # Something else may have its name by now: to open a pipe must not wait for a writer.
    names = ("O_NONBLOCK", "O_NOCTTY") if follow else ("O_NONBLOCK", "O_NOCTTY", "O_NOFOLLOW")
    more = sum(getattr(os, name, 0) for name in names)
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | more)) as file:
        state = os.fstat(file.fileno())
        _check_mode(path, state.st_mode)
        # As long as it says, not `max_size`: Python takes that memory before it reads.
        data = file.read(min(state.st_size, max_size) + 1)
    if len(data) > max_size:
        raise OSError(errno.EFBIG, f"it has more than {max_size} bytes", str(path))
    return data


def _check_mode(path: str | Path, mode: int) -> None:
    """Raise an error if a mode does not belong to a regular file."""
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder; a file expected", str(path))
    if not stat.S_ISREG(mode):
        what = "a link" if stat.S_ISLNK(mode) else "a pipe or a device"
        raise OSError(errno.EINVAL, f"it is {what}; a regular file expected", str(path))


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the content of a small TOML file.

    A key with n dots is n tables, and tomllib takes a time and a memory of n * n for it.

    Raises:
        OSError: as `read_input`, for a file of more than `MAX_TOML_SIZE`.
        ValueError: it is not TOML, or a line has more than `MAX_TOML_DOTS` dots.
    """
    data = read_input(path, MAX_TOML_SIZE)
    for number, line in enumerate(data.splitlines(), 1):
        if (n_dots := line.count(b".")) > MAX_TOML_DOTS:
            raise ValueError(
                f"line {number}: at most {MAX_TOML_DOTS} dots in a line expected, {n_dots} given"
            )
    try:
        return tomllib.loads(data.decode())
    except RecursionError as cause:
        raise ValueError(str(cause)) from cause


def is_lfs_pointer(path: Path) -> bool:
    """Return whether a file is a pointer of Git LFS in place of the data."""
    try:
        if not path.is_file() or path.stat().st_size >= MAX_POINTER_SIZE:
            return False
        with path.open("rb") as file:
            return file.read(len(_LFS_BEGIN)) == _LFS_BEGIN
    except OSError:
        return False


def refusal_of_lfs_pointer(path: Path) -> str:
    """Return a message about a pointer of Git LFS."""
    return (
        f"{path} is a pointer of Git LFS ({path.stat().st_size} bytes), not the data: in a clone, "
        "`git lfs pull` fetches them"
    )


def check_keys(text: bytes) -> None:
    """Check that no object in a JSON text has a key twice; readers differ in which one counts.

    Raises:
        ValueError: a key is given twice, or the text is not JSON.
        RecursionError: the text is nested too deep.
    """

    def check_pairs(pairs: list[tuple[str, object]]) -> None:
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise ValueError(f"the key {key!r} is given twice")
            seen.add(key)

    json.loads(text, object_pairs_hook=check_pairs)


def _new_file_beside(target: Path) -> Path:
    """Create a hidden file with the mode of any new file in the folder of `target`.

    Raises:
        OutputError: the folder does not accept it.
    """
    for _ in range(_MAX_ATTEMPTS):
        part = target.with_name(f".{target.stem}.{os.urandom(6).hex()}{target.suffix}")
        try:
            part.touch(exist_ok=False)
        except FileExistsError:
            continue
        except OSError as cause:
            raise OutputError(f"cannot write {target}: {cause.strerror}") from cause
        return part
    raise OutputError(f"cannot write {target}: no name for a temporary file is free")
