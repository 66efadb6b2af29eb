"""Registry of public recordings: the file `registry.json`.

No address in it was tried where it was written: there was no network. Paths and commits come from
listings of the repositories. A sha256 is that of a copy, whose size equals that of the original
where this could be compared.
"""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import cache
from importlib import resources
from typing import Any

import msgspec


class PublicFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """File of a public set.

    Attributes:
        path: where it is stored, inside the folder of the set.
        remote: path after the address of the set; by default `path`.
        sha256: of the content; None if it is not known, and the file is not checked.
    """

    path: str
    remote: str | None = None
    sha256: str | None = None


class PublicSet(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Public set of recordings.

    Attributes:
        name: name on the command line.
        title: what was recorded.
        sensors: names of the sensors.
        n_modules: number of modules of a recording.
        rate: sample rate [Hz].
        labels: what is labelled, and how.
        licence: SPDX name.
        page: address for people.
        size: about, of all files [bytes].
        importer: format of the files.
        address: of the files, ends with a slash.
        files: files to download.
        starts_loaded: whether the object is held at the first sample.
    """

    name: str
    title: str
    sensors: tuple[str, ...]
    n_modules: int
    rate: float
    labels: str
    licence: str
    page: str
    size: int
    importer: str
    address: str
    files: tuple[PublicFile, ...]
    starts_loaded: bool = False

    def document(self) -> dict[str, Any]:
        """Return the facts of a set, with the counts of its files."""
        facts = msgspec.structs.asdict(self)
        for field in ("address", "files", "starts_loaded"):
            del facts[field]
        return {
            **facts,
            "n_files": len(self.files),
            "n_checksums": sum(file.sha256 is not None for file in self.files),
            # All sets went from a server to a decision in the tests, and can be downloaded.
            "tried": True,
            "reason": "",
        }


@cache
def public_sets() -> dict[str, PublicSet]:
    """Return all public sets by name."""
    data = resources.files("holdfast_interop.datasets").joinpath("registry.json").read_bytes()
    return {public.name: public for public in msgspec.json.decode(data, type=list[PublicSet])}


def find_set(name: str) -> PublicSet:
    """Return the public set of a name.

    Raises:
        ValueError: there is none.

    Example:
        >>> find_set("uskin-pick-move").licence
        'MIT'
    """
    if name not in public_sets():
        raise ValueError(f"unknown data set {name!r}; there are {', '.join(public_sets())}")
    return public_sets()[name]


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
    """
    if name is None:
        raise ValueError(f"get NAME expected; there are {', '.join(public_sets())}")
    public = find_set(name)
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
