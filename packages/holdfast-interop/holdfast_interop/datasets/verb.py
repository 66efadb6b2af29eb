"""`holdfast datasets`: public recordings, from their address to recordings of holdfast."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE, ForceOption, JsonOption
from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import format_size, progress

if TYPE_CHECKING:
    from holdfast.import_tasks import ImportResult
    from holdfast_interop.datasets import PublicFile, PublicSet


class DatasetAction(StrEnum):
    """Action of the verb."""

    LIST = "list"
    GET = "get"


def datasets(
    action: Annotated[DatasetAction, typer.Argument(help="list, or get NAME.")] = (
        DatasetAction.LIST
    ),
    name: Annotated[str | None, typer.Argument(help="Name of a data set.")] = None,
    out: Annotated[
        Path | None,
        typer.Argument(help="Folder for the recordings.", show_default="NAME in this folder"),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only files that fit a pattern, such as '*Apple*'. May be repeated."),
    ] = None,
    with_checksum: Annotated[
        bool, typer.Option("--with-checksum", help="Only files whose sha256 is known."), RARE
    ] = False,
    mirror: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Address of a copy: its files are at URL/NAME/FILE."),
        RARE,
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    r"""List public recordings, download them and import them.

    list NAME shows one set, with its page and licence: read both before you use it. Only get
    opens a connection. It downloads to the folder HOLDFAST_DATASETS (by default the cache of the
    user), checks each sha256 that is known, and leaves out files that it has already. Then it
    imports the files into OUT. docs/datasets.md says what was tried.

    Example:
      holdfast datasets
      holdfast datasets get uskin-pick-move
      holdfast detect builtin:any \
        uskin-pick-move/data_sample_2022-02-22-08-10-01.parquet
    """
    from holdfast_interop.datasets.download import download_files, download_folder, linked_folder
    from holdfast_interop.datasets.registry import select_files

    if action is DatasetAction.LIST:
        print_set(name, as_json=as_json) if name else print_sets(as_json=as_json)
        return
    from holdfast.import_tasks import ImportTask, import_all
    from holdfast.parallel import Engine

    public, files = select_files(name, only or [], with_checksum)
    download_files(public, files, mirror, progress)
    task = ImportTask(out or Path(public.name), public.importer, force=force)
    with linked_folder(files, download_folder(public.name)) as selected:
        result = import_all(selected, task, Engine(), notify=print_message, steps=progress)
    print_result(public, files, result, as_json=as_json)


def print_sets(*, as_json: bool) -> None:
    """Print a line for each set."""
    from holdfast_interop.datasets import public_sets

    if as_json:
        print_json({"datasets": [public.document() for public in public_sets().values()]})
        return
    rows = [
        (
            public.name,
            ", ".join(public.sensors),
            f"{public.rate:g}",
            public.labels,
            public.licence,
            format_size(public.size),
        )
        for public in public_sets().values()
    ]
    print_table(("data set", "sensor", "rate [Hz]", "labels", "licence", "size"), rows)
    print_line()
    print_paragraph(
        "The files with a known sha256 went from a server to a decision in the tests. No address "
        "could be tried where this list was made. holdfast datasets list NAME shows one set."
    )


def print_set(name: str, *, as_json: bool) -> None:
    """Print the facts of a set."""
    from holdfast_interop.datasets import find_set

    document = find_set(name).document()
    if as_json:
        print_json(document)
        return
    document["sensors"] = ", ".join(document["sensors"])
    print_table(
        ("data set", document.pop("name")),
        [(key, value or "-") for key, value in document.items()],
    )


def print_result(
    public: "PublicSet", files: "Sequence[PublicFile]", result: "ImportResult", *, as_json: bool
) -> None:
    """Print what was imported of a set, its licence, and what to do next."""
    from holdfast.cli.import_ import print_imported
    from holdfast_interop.datasets.download import download_folder

    n_unchecked = sum(file.sha256 is None for file in files)
    folder = download_folder(public.name)
    facts = {"dataset": public.name, "licence": public.licence, "folder": folder}
    counts = {"n_files": len(files), "n_unchecked": n_unchecked}
    print_imported(result, {**facts, **counts}, as_json=as_json)
    if n_unchecked:
        print_message(
            f"{n_unchecked} of {len(files)} files have no known sha256 and were not checked"
        )
    print_message(f"licence: {public.licence} ({public.page}); downloads are in {folder}")
    first = result.imported[0].document["path"]
    option = " --in-contact" if public.starts_loaded else ""
    print_message(f"next: holdfast detect builtin:any {first}{option}")
