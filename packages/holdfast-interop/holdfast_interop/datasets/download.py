"""Download of public sets: with checksums by pooch, and continued where it was interrupted.

A file has its name only when it is whole and its checksum is right. Until then its bytes are in
`.NAME.part` beside it, from which the next download continues. A server is not trusted: an answer
is a plain body of the expected length, and none is waited for without an end.
"""

import errno
import os
import shutil
import stat
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar
from urllib.parse import quote, urljoin

from holdfast.errors import OutputError, RecordingError, SourceError
from holdfast.files import is_lfs_pointer, refusal_of_lfs_pointer
from holdfast.threads import in_thread
from holdfast_interop.datasets.registry import PublicFile, PublicSet, other_sets

if TYPE_CHECKING:
    from pooch import Pooch
    from requests import Response

    from holdfast.recording_import import ImportResult

FOLDER_VARIABLE = "HOLDFAST_DATASETS"
"""Environment variable with the folder of all downloads."""
MAX_UNKNOWN_SIZE = 1_000_000_000
"""Size above which a file whose size is not known is refused [bytes]."""
DOWNLOAD_CHUNK = 1 << 16
"""Number of bytes that are written at once."""
SERVER_TIMEOUTS = (10.0, 60.0)
"""Times after which a server that does not connect, or is silent, is given up [s]."""
ANSWER_LIMIT = 60.0
"""Maximum time of an answer's headers and of each `DOWNLOAD_CHUNK` [s]: at least 1 kB/s."""
FREE_DOWNLOAD_TIME, MIN_RATE = 600.0, 20_000
"""Time for a file besides that of its bytes [s], and the lowest rate of these [bytes/s]."""
MAX_REDIRECTS = 10
"""Number of times that a server may name another address."""
MAX_DOWNLOAD_TRIES = 3
"""Number of times that a file is continued after the connection was lost."""
_T = TypeVar("_T")
_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


def download_folder(name: str) -> Path:
    """Return the folder for the files of a set: in HOLDFAST_DATASETS, or the user's cache."""
    import pooch

    return Path(os.environ.get(FOLDER_VARIABLE) or pooch.os_cache("holdfast")) / name


def download(
    public: PublicSet,
    files: Sequence[PublicFile],
    folder: Path,
    address: str | None = None,
    report: Callable[[int], object] = lambda _: None,
) -> list[Path]:
    """Download the files of a set that are not in a folder yet, and check all of them.

    Args:
        public: the set.
        files: of the set.
        folder: for the files.
        address: of a copy, ends with a slash; by default that of the set.
        report: receives the number of new bytes.

    Returns:
        The paths of the files.

    Raises:
        SourceError: the server cannot be reached, or does not have a file, or sends another one.
        OutputError: the disk is full, or the folder cannot be written.
    """
    import pooch

    remotes = {file.path: quote(file.remote or file.path) for file in files}
    if address is not None:  # a copy has the files as they are stored here
        remotes = {path: quote(path) for path in remotes}
    base = public.address if address is None else address
    storage = pooch.create(
        folder,
        base_url=base,
        registry={file.path: file.sha256 and f"sha256:{file.sha256}" for file in files},
        urls={path: f"{base}{remote}" for path, remote in remotes.items()},
    )
    logger = pooch.get_logger()
    before = logger.level
    logger.setLevel("ERROR")  # else pooch prints a line for each file
    try:
        return [_fetch(public, storage, file, folder, report) for file in files]
    finally:
        logger.setLevel(before)


def download_files(
    public: PublicSet,
    files: Sequence[PublicFile],
    mirror: str | None,
    advance: Callable[[float], None],
) -> None:
    """Download files of a set to its folder, or continue a download that was interrupted.

    Args:
        public: the set.
        files: from `select_files`.
        mirror: address of a copy of all sets; None for that of the set.
        advance: called with the number of bytes after each part.

    Raises:
        ValueError: the mirror is no address.
        HoldfastError: the files cannot be downloaded.
    """
    if mirror is not None and not mirror.startswith(("http://", "https://")):
        raise ValueError(
            f"--mirror: an address such as http://HOST:8000 expected, {mirror!r} given"
        )
    folder = download_folder(public.name)
    address = None if mirror is None else f"{mirror.rstrip('/')}/{public.name}/"
    check_space(files, folder)
    download(public, files, folder, address, advance)


def import_files(
    public: PublicSet,
    files: Sequence[PublicFile],
    out: Path,
    *,
    force: bool,
    notify: Callable[[str], None],
    steps: Callable[[Iterable[Any], str, float], Iterable[Any]],
) -> "ImportResult":
    """Import downloaded files of a set, all of them or none.

    Args:
        public: the set.
        files: from `select_files`.
        out: folder for the recordings.
        force: replace existing recordings.
        notify: called with each message of the import.
        steps: shows the progress of the import.

    Raises:
        HoldfastError: the files cannot be imported.
    """
    from holdfast.parallel import Engine
    from holdfast.recording_import import ImportTask, import_all

    task = ImportTask(out, public.importer, force=force)
    with linked_folder(files, download_folder(public.name)) as selected:
        return import_all(selected, task, Engine(), notify=notify, steps=steps)


@contextmanager
def linked_folder(files: Sequence[PublicFile], folder: Path) -> Iterator[Path]:
    """Yield a temporary folder with some of the files; errors name the original folder."""
    with TemporaryDirectory(prefix=".import.", dir=folder) as name:
        for file in files:
            target = Path(name) / file.path
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(folder / file.path, target)
            except OSError:  # a file system without links
                shutil.copy(folder / file.path, target)
        try:
            yield Path(name)
        except (RecordingError, OutputError) as cause:
            raise type(cause)(str(cause).replace(name, str(folder))) from cause


def check_space(files: Sequence[PublicFile], folder: Path) -> None:
    """Check that a disk has room for the files that are not there yet.

    Raises:
        OutputError: it has not.
    """
    # The folder may not exist yet: its disk is that of the first one around it that does.
    existing = next(place for place in (folder, *folder.parents) if place.exists())
    needed = sum(file.size or 0 for file in files if not (folder / file.path).exists())
    free = shutil.disk_usage(existing).free
    if needed > free:
        raise OutputError(
            f"{folder}: {format_size(needed)} needed, {format_size(free)} free; set "
            f"{FOLDER_VARIABLE} to a folder on another disk"
        )


def format_size(n_bytes: int) -> str:
    """Return a size for a person.

    Example:
        >>> format_size(133), format_size(2_562_937), format_size(54_000_000_000)
        ('133 bytes', '2.6 MB', '54 GB')
    """
    for unit, name in ((10**9, "GB"), (10**6, "MB"), (10**3, "kB")):
        if n_bytes >= unit:
            digits = ".2g" if n_bytes < 10 * unit else ".0f"
            return f"{n_bytes / unit:{digits}} {name}"
    return f"{n_bytes} bytes"


def _fetch(
    public: PublicSet,
    storage: "Pooch",
    file: PublicFile,
    folder: Path,
    report: Callable[[int], object],
) -> Path:
    """Return the path of a file after its download and check, with errors of our own."""
    import requests

    target = folder / file.path
    part = target.with_name(f".{target.name}.part")
    url = storage.get_url(file.path)
    try:
        if file.size is not None and target.exists() and target.stat().st_size != file.size:
            target.unlink()
        return Path(storage.fetch(file.path, downloader=_Download(part, file, report)))
    except requests.RequestException as cause:
        answer = cause.response
        if answer is not None and answer.status_code in (404, 410):
            raise SourceError(
                f"{public.name}: {file.path} is gone ({answer.status_code} at {url}); there are "
                f"also {other_sets(public.name)}"
            ) from cause
        if answer is not None:
            raise SourceError(
                f"{public.name}: {url} answers {answer.status_code} {answer.reason}"
            ) from cause
        raise SourceError(
            f"{public.name}: {url} cannot be reached ({type(cause).__name__}); what was loaded is "
            "kept, and the same command continues"
        ) from cause
    except OSError as cause:
        if cause.errno in _DISK_FULL:
            part.unlink(missing_ok=True)
        raise OutputError(f"cannot write {target}: {cause.strerror or cause}") from cause
    except ValueError as cause:  # of pooch: another checksum
        raise SourceError(
            f"{public.name}: {url} has another sha256 than {file.sha256}, which is expected; the "
            "file was thrown away"
        ) from cause


class _Download:
    """Downloader for pooch that continues an interrupted file.

    Args:
        part: path of the incomplete file.
        file: what is expected.
        report: receives the number of new bytes.
    """

    def __init__(self, part: Path, file: PublicFile, report: Callable[[int], object]) -> None:
        self._part, self._file, self._report = part, file, report
        self._max_size = MAX_UNKNOWN_SIZE if file.size is None else file.size
        self._size = file.size
        self._deadline = time.monotonic() + FREE_DOWNLOAD_TIME + self._max_size / MIN_RATE

    def __call__(self, url: str, output_file: str, _: object) -> None:
        """Load a file from a URL into `output_file`."""
        from requests import ConnectionError as Disconnected
        from requests import Timeout
        from requests.exceptions import ChunkedEncodingError

        # Each try continues where the last one ended.
        for tries_left in reversed(range(MAX_DOWNLOAD_TRIES)):
            try:
                self._load(url)
                break
            except (Disconnected, ChunkedEncodingError, Timeout):
                if not tries_left:
                    raise
        # A server may send the pointer of Git LFS in place of the content.
        if is_lfs_pointer(self._part):
            text = refusal_of_lfs_pointer(self._part).partition(" is ")[2]
            self._part.unlink()
            raise SourceError(f"{url} is {text}")
        # pooch checks a sum that is known; without one, the length is all that can be checked.
        if self._file.sha256 is None and (n_bytes := self._part.stat().st_size) != self._size:
            self._part.unlink()
            expected = "no length is known" if self._size is None else f"{self._size} expected"
            raise SourceError(f"{url} sends {n_bytes} bytes, {expected}; it was thrown away")
        self._part.replace(output_file)

    def _load(self, url: str) -> None:
        """Append what is missing to the incomplete file.

        Raises:
            requests.RequestException: the connection is lost, or the server refuses.
            SourceError: the file is larger than expected.
        """
        import requests

        n_done = incomplete_size(self._part)
        if n_done and n_done == self._file.size:
            return
        # A packed body has no place from which to continue, and may unpack to any size.
        headers = {"Accept-Encoding": "identity"}
        if n_done:
            headers["Range"] = f"bytes={n_done}-"
        answer = _answer(url, headers)
        try:
            # The part is longer than the file is now, so the file has changed.
            if n_done and answer.status_code == requests.codes.requested_range_not_satisfiable:
                self._part.unlink()
                raise requests.ConnectionError("the incomplete file does not fit; begin again")
            answer.raise_for_status()
            if (packed := answer.headers.get("Content-Encoding", "identity")) != "identity":
                raise SourceError(f"{url} sends a body packed by {packed!r}; a plain one expected")
            self._write(answer, n_done)
        finally:  # closing waits for a thread that was given up
            in_thread(answer.close)

    def _write(self, answer: "Response", n_done: int) -> None:
        """Write the body of an answer; a server without ranges sends the file from its begin."""
        continues = answer.headers.get("Content-Range", "").startswith(f"bytes {n_done}-")
        n_bytes = n_done if continues else 0
        stated = answer.headers.get("Content-Length", "")
        if self._file.size is None:
            self._size = n_bytes + int(stated) if stated.isdecimal() else None
        # The length that a server states is not believed: bytes are counted, and so is the time.
        chunks = answer.iter_content(DOWNLOAD_CHUNK)
        with open_part(self._part, continues=continues) as file:
            while chunk := in_time(partial(next, chunks, b"")):
                n_bytes += len(chunk)
                if n_bytes > self._max_size:
                    break
                file.write(chunk)
                self._report(len(chunk))
                if time.monotonic() > self._deadline:
                    raise SourceError(
                        f"{answer.url} sends less than {MIN_RATE} bytes a second; what was loaded "
                        "is kept, and the same command continues"
                    )
        if n_bytes > self._max_size:
            self._part.unlink()
            raise SourceError(
                f"{answer.url} sends more than {self._max_size} bytes; it was thrown away"
            )


def incomplete_size(part: Path) -> int:
    """Return the size of an incomplete file [bytes]; a link to another file is removed."""
    try:
        state = part.lstat()
    except FileNotFoundError:
        return 0
    if stat.S_ISREG(state.st_mode) and state.st_nlink == 1:
        return state.st_size
    part.unlink()
    return 0


def open_part(part: Path, *, continues: bool) -> BinaryIO:
    """Open an incomplete file at its end, or a new one; never what a link points to."""
    if not continues:
        part.unlink(missing_ok=True)
    mode = os.O_APPEND if continues else os.O_CREAT | os.O_EXCL
    others = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    return os.fdopen(os.open(part, os.O_WRONLY | mode | others, 0o666), "ab")


def _answer(url: str, headers: dict[str, str]) -> "Response":
    """Return the answer to a request after redirections, whose bodies requests would read whole.

    Raises:
        requests.RequestException: there is none in time.
    """
    import requests

    for _ in range(MAX_REDIRECTS + 1):
        session = requests.Session()
        find_target = session.get_redirect_target
        session.get_redirect_target = lambda _: None  # type: ignore[assignment,method-assign]
        answer = in_time(
            partial(session.get, url, headers=headers, stream=True, timeout=SERVER_TIMEOUTS)
        )
        if (location := find_target(answer)) is None:
            return answer
        url = urljoin(url, location)
        answer.close()
    raise requests.TooManyRedirects(f"more than {MAX_REDIRECTS} redirections")


def in_time(call: Callable[[], _T]) -> _T:
    """Return what a call returns, or give up its thread: each byte renews a socket's timeout.

    Raises:
        requests.Timeout: it takes longer than `ANSWER_LIMIT`.
    """
    import requests

    def close_late(result: "Future[Any]") -> None:
        # Its answer came after the time limit: an open connection would stay.
        if result.exception() is None and hasattr(answer := result.result(), "close"):
            answer.close()

    result = in_thread(call)
    try:
        return result.result(ANSWER_LIMIT)
    except TimeoutError as cause:
        result.add_done_callback(close_late)
        raise requests.Timeout(f"less than {DOWNLOAD_CHUNK} bytes in time") from cause
