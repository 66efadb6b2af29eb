"""Tables of public recordings: all sets, one of them, and what was imported of it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from holdfast.cli.terminal.console import (
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast_interop.datasets.download import download_folder, format_size
from holdfast_interop.datasets.registry import PublicFile, PublicSet, find_set, public_sets

if TYPE_CHECKING:
    from holdfast.recording_import import ImportResult


def print_sets(*, as_json: bool) -> None:
    """Print a line for each set."""
    if as_json:
        print_json({"datasets": [public.document() for public in public_sets().values()]})
        return
    rows = [
        (
            public.name,
            ", ".join(public.sensors) or "-",
            "-" if public.rate is None else f"{public.rate:g}",
            public.labels,
            public.licence,
            "-" if public.size is None else format_size(public.size),
            ("yes" if public.tried else "untried") if public.files else "no",
        )
        for public in public_sets().values()
    ]
    print_table(("data set", "sensor", "rate [Hz]", "labels", "licence", "size", "get"), rows)
    print_line()
    print_paragraph(
        "get: yes, the files with a known sha256 went from a server to a decision in the tests; "
        "untried, they did not; no, holdfast does not download the set. No address could be tried "
        "where this list was made. holdfast datasets list NAME shows one set."
    )


def print_set(name: str, *, as_json: bool) -> None:
    """Print the facts of a set."""
    document = find_set(name).document()
    if as_json:
        print_json(document)
        return
    document["sensors"] = ", ".join(document["sensors"])
    print_table(
        ("data set", document.pop("name")),
        [(key, "-" if value in (None, "") else value) for key, value in document.items()],
    )


def print_result(
    public: PublicSet, files: Sequence[PublicFile], result: "ImportResult", *, as_json: bool
) -> None:
    """Print what was imported of a set, its licence, and what to do next."""
    from holdfast.cli.import_ import print_imported

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
