"""`holdfast datasets`: public recordings, from their address to recordings of holdfast."""

import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import RARE, ForceOption, JsonOption
from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import ProgressBar
from holdfast.errors import OutputError, RecordingError, require_extras

if TYPE_CHECKING:
    from holdfast.cli.import_ import ImportResult
    from holdfast_interop.datasets import PublicFile, PublicSet

CONFIRMED_SIZE = 1_000_000_000
"""Size from which a download is confirmed first [bytes]."""


class DatasetAction(StrEnum):
    """What the verb does."""

    LIST = "list"
    GET = "get"
    SCORE = "score"


def datasets(
    action: Annotated[DatasetAction, typer.Argument(help="list, get NAME, or score NAME.")] = (
        DatasetAction.LIST
    ),
    name: Annotated[str | None, typer.Argument(help="Name of a data set.")] = None,
    out: Annotated[
        Path | None,
        typer.Argument(help="Folder for the recordings.", show_default="NAME in this folder"),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only files that fit a pattern, such as '*brush*'. May be repeated."),
    ] = None,
    with_checksum: Annotated[
        bool, typer.Option("--with-checksum", help="Only files whose sha256 is known."), RARE
    ] = False,
    mirror: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Address of a copy: its files are at URL/NAME/FILE."),
        RARE,
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Download gigabytes without a question.")] = (
        False
    ),
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""List public recordings, download them and import them.

    list NAME shows one set, with its page and licence: read both before you use it. Only get
    opens a connection. It downloads to the folder HOLDFAST_DATASETS (by default the cache of the
    user), checks each sha256 that is known, and continues what was interrupted. Then it imports
    the files into OUT. docs/datasets.md says what was tried. score trains on the recordings in OUT
    that the published split trains on, and tests on the others, sample by sample.

    Example:
      holdfast datasets
      holdfast datasets get uskin-pick-move
      holdfast detect builtin:any \
        uskin-pick-move/data_sample_2022-02-22-08-10-01.parquet
    """
    if action is DatasetAction.SCORE:
        _score(name, out, as_json)
    elif action is DatasetAction.GET:
        public, files = _selected(name, only or [], with_checksum)
        _confirm(public, files, yes)
        result = _get(public, files, out or Path(public.name), mirror, force)
        _print_result(public, files, result, as_json)
    elif name is None:
        _list(as_json)
    else:
        _show(name, as_json)


def _score(name: str | None, folder: Path | None, as_json: bool) -> None:
    """Print how well a model orders the samples of the published split of a set."""
    from holdfast_interop.datasets import find_set
    from holdfast_interop.datasets.score import score_split

    require_extras("train")
    public = find_set(str(name))
    if not public.test:
        raise ValueError(f"{name} has no published split")
    scores = score_split(folder or Path(public.name), public.test)
    if as_json:
        print_json({"name": name, "test": public.test, **scores})
        return
    print_table(
        ("slip by sample", "accuracy [%]", "AP", "AUC"),
        [
            (row, f"{100 * one['accuracy']:.1f}", f"{one['ap']:.3f}", f"{one['auc']:.3f}")
            for row, one in scores.items()
        ],
    )


def _selected(
    name: str | None, patterns: Sequence[str], with_checksum: bool
) -> "tuple[PublicSet, list[PublicFile]]":
    """Return the set and its files that are wanted.

    Raises:
        ValueError: there is no such set or file.
        SourceError: holdfast does not download the set.
        MissingExtra: a package that downloads or imports is not installed.
    """
    from holdfast.errors import SourceError
    from holdfast.io.importers import extra_of
    from holdfast_interop.datasets import find_set, public_sets
    from holdfast_interop.datasets.registry import other_sets

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
        if (not with_checksum or file.sha256) and _fits(file.path, patterns)
    ]  # fmt: skip
    if not files:
        raise ValueError(
            f"{name}: no file is left; it has {len(public.files)}, such as {public.files[0].path}"
        )
    return public, files


def _fits(path: str, patterns: Sequence[str]) -> bool:
    return not patterns or any(fnmatchcase(path, pattern) for pattern in patterns)


def _total(public: "PublicSet", files: "Sequence[PublicFile]") -> int:
    """Return about how large the files are [bytes]."""
    share = len(files) / len(public.files)
    known = sum(file.size or 0 for file in files)
    return (
        known if all(file.size for file in files) else max(known, int(share * (public.size or 0)))
    )


def _confirm(public: "PublicSet", files: "Sequence[PublicFile]", yes: bool) -> None:
    """Return after a confirmation of a large download.

    Raises:
        ValueError: there is no terminal to confirm it.
        typer.Exit: it is not wanted.
    """
    from holdfast_interop.datasets.download import format_size

    size = _total(public, files)
    if yes or size < CONFIRMED_SIZE:
        return
    if not sys.stdin.isatty():
        raise ValueError(f"{public.name} has {format_size(size)}: give --yes to download it")
    if not typer.confirm(f"{public.name} has {format_size(size)}. Download it?", err=True):
        print_message("nothing was downloaded")
        raise typer.Exit


def _get(
    public: "PublicSet", files: "Sequence[PublicFile]", out: Path, mirror: str | None, force: bool
) -> "ImportResult":
    """Download and import files of a set."""
    from holdfast.cli.import_ import FormatOptions, import_all
    from holdfast.parallel import Engine
    from holdfast_interop.datasets.download import check_space, download, download_folder

    if mirror is not None and not mirror.startswith(("http://", "https://")):
        raise ValueError(
            f"--mirror: an address such as http://HOST:8000 expected, {mirror!r} given"
        )
    folder = download_folder(public.name)
    address = None if mirror is None else f"{mirror.rstrip('/')}/{public.name}/"
    check_space(files, folder)
    with ProgressBar("downloading", _total(public, files) or None) as bar:
        download(public, files, folder, address, bar.advance)
    options = FormatOptions(public.importer)
    with _folder_of(files, folder) as selected:
        return import_all(selected, out, options, Engine.parse("loky", 1), force=force)


@contextmanager
def _folder_of(files: "Sequence[PublicFile]", folder: Path) -> Iterator[Path]:
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


def _print_result(
    public: "PublicSet", files: "Sequence[PublicFile]", result: "ImportResult", as_json: bool
) -> None:
    from holdfast_interop.datasets.download import download_folder

    n_unchecked = sum(file.sha256 is None for file in files)
    folder = download_folder(public.name)
    if as_json:
        facts = {"dataset": public.name, "licence": public.licence, "folder": folder}
        counts = {"n_files": len(files), "n_unchecked": n_unchecked}
        print_json({**facts, **counts, **result.document()})
    else:
        result.print()
    result.print_messages()
    if n_unchecked:
        print_message(
            f"{n_unchecked} of {len(files)} files have no known sha256 and were not checked"
        )
    print_message(f"licence: {public.licence} ({public.page}); downloads are in {folder}")
    first = result.imported[0].document["path"]
    option = " --in-contact" if public.starts_loaded else ""
    print_message(f"next: holdfast detect builtin:any {first}{option}")


def _list(as_json: bool) -> None:
    from holdfast_interop.datasets import public_sets

    if as_json:
        print_json({"datasets": [_document(public) for public in public_sets().values()]})
        return
    rows = [_row(public) for public in public_sets().values()]
    print_table(("data set", "sensor", "rate [Hz]", "labels", "licence", "size", "get"), rows)
    print_line()
    print_paragraph(
        "get: yes, the files with a known sha256 went from a server to a decision in the tests; "
        "untried, they did not; no, holdfast does not download the set. No address could be tried "
        "where this list was made. holdfast datasets list NAME shows one set."
    )


def _row(public: "PublicSet") -> tuple[object, ...]:
    from holdfast_interop.datasets.download import format_size

    rate = "-" if public.rate is None else f"{public.rate:g}"
    size = "-" if public.size is None else format_size(public.size)
    state = ("yes" if public.tried else "untried") if public.files else "no"
    sensors = ", ".join(public.sensors) or "-"
    return public.name, sensors, rate, public.labels, public.licence, size, state


def _show(name: str, as_json: bool) -> None:
    from holdfast_interop.datasets import find_set

    document = _document(find_set(name))
    if as_json:
        print_json(document)
        return
    document["sensors"] = ", ".join(document["sensors"])
    print_table(
        ("data set", document.pop("name")),
        [(key, "-" if value in (None, "") else value) for key, value in document.items()],
    )


def _document(public: "PublicSet") -> dict[str, Any]:
    """Return the facts of a set, with the counts of its files."""
    fields = ("name", "title", "sensors", "n_modules", "rate", "labels", "licence", "page", "size")
    return {
        **{field: getattr(public, field) for field in fields},
        "importer": public.importer,
        "n_files": len(public.files),
        "n_checksums": sum(file.sha256 is not None for file in public.files),
        "tried": public.tried,
        "reason": public.reason,
    }
