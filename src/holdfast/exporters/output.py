"""Folders of exported files, written whole or not at all."""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from holdfast.errors import OutputError
from holdfast.files import refuse_overwrite


@contextmanager
def whole_folder(
    out: Path, *, force: bool = False, is_replaceable: Callable[[Path], bool] = lambda _: False
) -> Iterator[Path]:
    """Yield a temporary folder that becomes `out` when the block ends without an exception.

    Args:
        out: folder to write.
        force: replace an existing folder.
        is_replaceable: whether an existing folder, which is not empty, may be replaced.

    Raises:
        OutputError: `out` exists and must not be replaced, or the disk is full or read-only.
    """
    refuse_overwrite(out, force=force)
    if out.exists() and not (out.is_dir() and (is_replaceable(out) or not any(out.iterdir()))):
        raise OutputError(
            f"{out} is not such an export: --force replaces only what an export of this format "
            "wrote; choose another name"
        )
    with _staging_beside(out) as staging:
        yield staging
        # The old folder is kept beside the new one; it is removed at the end, or restored.
        before, existed = staging.with_name(f"{staging.name}.before"), out.exists()
        if existed:
            out.replace(before)
        try:
            staging.replace(out)
        except OSError:
            if existed:
                before.replace(out)
            raise


@contextmanager
def whole_files(out: Path, *, force: bool = False) -> Iterator[Path]:
    """Yield a temporary folder whose files move to the folder `out` at the end of the block.

    Args:
        out: folder of the files, with other files or without; it is created if it is missing.
        force: replace existing files of the same names.

    Raises:
        OutputError: a file exists already, or the disk is full or read-only.
    """
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is a file; a folder for the exported files expected")
    refuse_overwrite(out, force=True)
    with _staging_beside(out) as staging:
        yield staging
        if not out.exists():
            staging.replace(out)
            return
        files = sorted(staging.iterdir())
        # All are checked before the first is moved: all of the export, or nothing.
        for file in files:
            refuse_overwrite(out / file.name, force=force)
        for file in files:
            file.replace(out / file.name)


@contextmanager
def _staging_beside(out: Path) -> Iterator[Path]:
    """Yield a new folder beside `out`; remove it at the end, and what it has replaced."""
    try:
        parent = Path(tempfile.mkdtemp(prefix=f".{out.name}.", dir=out.parent))
    except OSError as cause:
        raise OutputError(f"cannot write {out}: {cause.strerror}") from cause
    staging = parent / out.name
    try:
        staging.mkdir()
        yield staging
    except OSError as cause:
        if cause.filename is not None and not str(cause.filename).startswith(str(parent)):
            raise  # an input that the block reads, not the output
        raise OutputError(f"cannot write {out}: {cause.strerror or cause}") from cause
    except OutputError as cause:
        # The user knows the folder, and not the temporary one.
        raise OutputError(str(cause).replace(str(staging), str(out))) from cause
    finally:
        shutil.rmtree(parent, ignore_errors=True)
