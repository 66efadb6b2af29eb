"""Get a public set: which files, how large they are, the download, and the import."""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from holdfast.errors import OutputError, RecordingError, SourceError, require_extras
from holdfast.io.importers import extra_of
from holdfast.parallel import Engine
from holdfast.recording_import import ImportResult, ImportTask, import_all
from holdfast_interop.datasets.download import check_space, download, download_folder
from holdfast_interop.datasets.registry import (
    PublicFile,
    PublicSet,
    find_set,
    other_sets,
    public_sets,
)


def select_files(
    name: str | None, patterns: Sequence[str], with_checksum: bool
) -> tuple[PublicSet, list[PublicFile]]:
    """Return the set and its files that are wanted.

    Args:
        name: of the set; None is refused.
        patterns: only files that fit one of them; all without one.
        with_checksum: only files whose sha256 is known.

    Raises:
        ValueError: there is no such set or file.
        SourceError: holdfast does not download the set.
        MissingExtra: a package that downloads or imports is not installed.
    """
    if name is None:
        raise ValueError(f"get NAME expected; there are {', '.join(public_sets())}")
    public = find_set(name)
    if not public.files:
        page = f" ({public.page})" if public.page else ""
        raise SourceError(
            f"{name} is not downloaded: {public.reason}{page}; there are also {other_sets(name)}"
        )
    require_extras(*filter(None, [extra_of(str(public.importer))]))
    files = [
        file for file in public.files
        if (not with_checksum or file.sha256)
        and (not patterns or any(fnmatchcase(file.path, pattern) for pattern in patterns))
    ]  # fmt: skip
    if not files:
        raise ValueError(
            f"{name}: no file is left; it has {len(public.files)}, such as {public.files[0].path}"
        )
    return public, files


def size_of(public: PublicSet, files: Sequence[PublicFile]) -> int:
    """Return about how large files of a set are [bytes]; 0 if nothing is known."""
    known = sum(file.size or 0 for file in files)
    if all(file.size for file in files):
        return known
    return max(known, int(len(files) / len(public.files) * (public.size or 0)))


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
) -> ImportResult:
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
    task = ImportTask(out, public.importer, force=force)
    with _folder_of(files, download_folder(public.name)) as selected:
        return import_all(selected, task, Engine(), notify=notify, steps=steps)


@contextmanager
def _folder_of(files: Sequence[PublicFile], folder: Path) -> Iterator[Path]:
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
