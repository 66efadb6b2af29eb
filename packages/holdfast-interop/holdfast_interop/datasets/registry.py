"""Registry of public recordings: the file `registry.json`, checked when it is read.

No address in it was tried where it was written: there was no network. Paths and commits come from
listings of the repositories. A sha256 is that of a copy, whose size equals that of the original
where this could be compared, or that of a pointer of Git LFS in the repository.
"""

from collections.abc import Sequence
from fnmatch import fnmatchcase
from functools import cache
from importlib import resources
from typing import Annotated, Any

import msgspec

from holdfast.errors import SourceError, require_extras
from holdfast.io.importers import extra_of

REGISTRY_SCHEMA = "holdfast.datasets/1"

_Path = Annotated[str, msgspec.Meta(pattern=r"^(?!.*\.\.)[A-Za-z0-9_][A-Za-z0-9_./-]*$")]
_Digest = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{64}$")]
_Address = Annotated[str, msgspec.Meta(pattern=r"^https?://[^\s]+$")]
_Size = Annotated[int, msgspec.Meta(ge=0)]


class PublicFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """File of a public set.

    Attributes:
        path: where it is stored, inside the folder of the set.
        remote: path after the address of the set; by default `path`.
        size: size [bytes]; None if it is not known.
        sha256: of the content; None if it is not known, and the file is not checked.
    """

    path: _Path
    remote: _Path | None = None
    size: _Size | None = None
    sha256: _Digest | None = None


class PublicSet(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Public set of recordings.

    Attributes:
        name: name on the command line.
        title: what was recorded.
        sensors: names of the sensors.
        n_modules: number of modules of a recording; None if it is not known.
        rate: sample rate [Hz]; None if it is not known.
        labels: what is labelled, and how.
        licence: SPDX name, `none`, or `not stated`.
        page: address for people.
        importer: format of the files; None if holdfast cannot read them.
        size: about, of all files [bytes]; None if it is not known.
        tried: whether recordings of the set went from a server to a decision in the tests.
        address: of the files, ends with a slash.
        starts_loaded: whether the object is held at the first sample.
        test: names of the recordings that the published split tests on; empty without one.
        files: files to download; empty if holdfast does not download them.
        reason: why it does not.
    """

    name: _Path
    title: str
    sensors: tuple[str, ...]
    labels: str
    licence: str
    tried: bool
    n_modules: int | None = None
    rate: float | None = None
    page: _Address | None = None
    importer: str | None = None
    size: _Size | None = None
    address: _Address = "https://none/"
    starts_loaded: bool = False
    test: tuple[str, ...] = ()
    files: tuple[PublicFile, ...] = ()
    reason: str = ""

    def __post_init__(self) -> None:
        """Check what the types do not.

        Raises:
            ValueError: files or a reason are missing, or two files have one path.
        """
        if bool(self.files) is bool(self.reason):
            raise ValueError(f"{self.name}: files or a reason expected, one of the two")
        if self.files and not (self.importer and self.address.endswith("/")):
            raise ValueError(f"{self.name}: an importer and an address with / at the end expected")
        if len({file.path for file in self.files}) < len(self.files):
            raise ValueError(f"{self.name}: two files have the same path")

    def document(self) -> dict[str, Any]:
        """Return the facts of a set, with the counts of its files."""
        fields = [
            "name",
            "title",
            "sensors",
            "n_modules",
            "rate",
            "labels",
            "licence",
            "page",
            "size",
        ]
        return {
            **{field: getattr(self, field) for field in fields},
            "importer": self.importer,
            "n_files": len(self.files),
            "n_checksums": sum(file.sha256 is not None for file in self.files),
            "tried": self.tried,
            "reason": self.reason,
        }


class Registry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Content of `registry.json`."""

    schema: str
    datasets: tuple[PublicSet, ...]

    def __post_init__(self) -> None:
        """Check the schema and the names.

        Raises:
            ValueError: the schema is another one, or two sets have one name.
        """
        if self.schema != REGISTRY_SCHEMA:
            raise ValueError(f"schema {REGISTRY_SCHEMA} expected, {self.schema!r} given")
        if len({public.name for public in self.datasets}) < len(self.datasets):
            raise ValueError("two data sets have the same name")


@cache
def public_sets() -> dict[str, PublicSet]:
    """Return all public sets by name."""
    data = resources.files("holdfast_interop.datasets").joinpath("registry.json").read_bytes()
    registry = msgspec.json.decode(data, type=Registry)
    return {public.name: public for public in registry.datasets}


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


def other_sets(name: str) -> str:
    """Return the names of the sets that can be downloaded, but for one."""
    names = [other.name for other in public_sets().values() if other.files and other.name != name]
    return ", ".join(names)


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
