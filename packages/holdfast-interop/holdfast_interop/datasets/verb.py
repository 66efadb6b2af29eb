"""`holdfast datasets`: public recordings, from their address to recordings of holdfast."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import RARE, ForceOption, JsonOption
from holdfast.cli.terminal.console import print_json, print_message, print_table
from holdfast.cli.terminal.progress import ProgressBar, progress
from holdfast.errors import require_extras

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
    from holdfast_interop.datasets import find_set, tables

    if action is DatasetAction.LIST:
        tables.print_set(name, as_json=as_json) if name else tables.print_sets(as_json=as_json)
    elif action is DatasetAction.GET:
        from holdfast_interop.datasets import download, registry

        public, files = registry.select_files(name, only or [], with_checksum)
        size = registry.size_of(public, files)
        if not yes:
            confirm(public.name, size)
        with ProgressBar("downloading", size or None) as bar:
            download.download_files(public, files, mirror, bar.advance)
        result = download.import_files(
            public, files, out or Path(public.name),
            force=force, notify=print_message, steps=progress,
        )  # fmt: skip
        tables.print_result(public, files, result, as_json=as_json)
    else:
        from holdfast_interop.datasets.score import score_split

        require_extras("train")
        public = find_set(str(name))
        if not public.test:
            raise ValueError(f"{name} has no published split")
        scores = score_split(out or Path(public.name), public.test)
        if as_json:
            print_json({"name": name, "test": public.test, **scores})
            return
        rows = [
            (row, f"{100 * x['accuracy']:.1f}", f"{x['ap']:.3f}", f"{x['auc']:.3f}")
            for row, x in scores.items()
        ]
        print_table(("slip by sample", "accuracy [%]", "AP", "AUC"), rows)


def confirm(name: str, size: int) -> None:
    """Return after a confirmation of a large download.

    Raises:
        ValueError: there is no terminal to confirm it.
        typer.Exit: it is not wanted.
    """
    from holdfast_interop.datasets.download import format_size

    if size < CONFIRMED_SIZE:
        return
    if not sys.stdin.isatty():
        raise ValueError(f"{name} has {format_size(size)}: give --yes to download it")
    if not typer.confirm(f"{name} has {format_size(size)}. Download it?", err=True):
        print_message("nothing was downloaded")
        raise typer.Exit
