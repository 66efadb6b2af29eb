"""Download of public sets by pooch.

pooch gives a file its name only when it is whole and its checksum, if one is known, is right.
"""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import quote

from holdfast.errors import OutputError, RecordingError, SourceError
from holdfast_interop.datasets.registry import PublicFile, PublicSet

FOLDER_VARIABLE = "HOLDFAST_DATASETS"
"""Environment variable with the folder of all downloads."""
N_RETRIES = 2
"""Number of times that pooch begins a file again after the connection was lost."""


def download_folder(name: str) -> Path:
    """Return the folder for the files of a set: in HOLDFAST_DATASETS, or the user's cache."""
    import pooch

    return Path(os.environ.get(FOLDER_VARIABLE) or pooch.os_cache("holdfast")) / name


def download_files(
    public: PublicSet,
    files: Sequence[PublicFile],
    mirror: str | None,
    steps: Callable[[Iterable[Any], str, float], Iterable[Any]],
) -> None:
    """Download the files of a set that are not in its folder yet, and check all of them.

    Args:
        public: the set.
        files: from `select_files`.
        mirror: address of a copy of all sets; None for that of the set.
        steps: shows the progress.

    Raises:
        ValueError: the mirror is no address.
        SourceError: the server cannot be reached, or does not have a file, or sends another one.
        OutputError: the disk is full, or the folder cannot be written.
    """
    import pooch
    from requests import RequestException

    base, remotes = public.address, {file.path: file.remote or file.path for file in files}
    if mirror is not None:
        if not mirror.startswith(("http://", "https://")):
            raise ValueError(
                f"--mirror: an address such as http://HOST:8000 expected, {mirror!r} given"
            )
        # A copy has the files as they are stored here.
        base, remotes = f"{mirror.rstrip('/')}/{public.name}/", {f.path: f.path for f in files}
    folder = download_folder(public.name)
    storage = pooch.create(
        folder,
        base_url=base,
        registry={file.path: file.sha256 for file in files},
        urls={path: f"{base}{quote(remote)}" for path, remote in remotes.items()},
        retry_if_failed=N_RETRIES,
    )
    logger = pooch.get_logger()
    before = logger.level
    logger.setLevel("ERROR")  # else pooch prints a line for each file
    try:
        for file in steps(files, "downloading", len(files)):
            url = storage.get_url(file.path)
            storage.fetch(file.path)
    except RequestException as cause:
        answer = cause.response
        why = type(cause).__name__ if answer is None else f"{answer.status_code} {answer.reason}"
        raise SourceError(
            f"{public.name}: {url} cannot be loaded ({why}); the files that were loaded are kept, "
            "and the same command continues"
        ) from cause
    except OSError as cause:
        raise OutputError(f"cannot write to {folder}: {cause.strerror or cause}") from cause
    except ValueError as cause:  # of pooch: another checksum
        raise SourceError(
            f"{public.name}: {url} has another sha256 than {file.sha256}, which is expected; the "
            "file was thrown away"
        ) from cause
    finally:
        logger.setLevel(before)


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
