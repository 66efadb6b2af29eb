"""The protocol of the benchmark: its splits, and the digests of their recordings."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

import msgspec

from holdfast.errors import RecordingError
from holdfast.io import Dataset, load_dataset
from holdfast.recordings import Recording
from holdfast_lab.study.plan import content_digest

PROTOCOL_FILES = ("protocol-1.json", "protocol.json")
"""Files of all versions, the newest last. Older ones stay, so that recordings that somebody has of
them can still be checked and scored."""
TUNING = "tuning"
"""Split from which the scorer chooses the thresholds."""
DIGEST_LENGTH = 32
"""Number of hexadecimal digits of a digest."""
MEASURED_ALL = "all"
"""Mechanisms of real skins that randomized hands have."""


class BenchmarkSplit(msgspec.Struct, frozen=True, kw_only=True):
    """Recordings of one split: how the twin makes them, and their digests.

    Attributes:
        holds: what is new in it, in words.
        seed: of the twin.
        repeats: grasps of each object and case, or number of randomized hands.
        other_objects: use the objects that no other split has.
        randomized: every recording has another hand, sensor and object.
        scored: whether results are reported for it.
        profile: of the twin.
        faults: troubles of the skins, as in `--faults`.
        digests: of the content of each recording, by name.
    """

    holds: str
    seed: int
    repeats: int
    other_objects: bool = False
    randomized: bool = False
    scored: bool = True
    profile: str = "reference"
    faults: str = ""
    digests: dict[str, str] = {}


class BenchmarkProtocol(msgspec.Struct, frozen=True):
    """A version of the benchmark.

    Attributes:
        version: a new one for every change of data or rules.
        splits: by name.
    """

    version: int
    splits: dict[str, BenchmarkSplit]


@cache
def protocols() -> tuple[BenchmarkProtocol, ...]:
    """Return all versions of the protocol, the newest last."""
    folder = files("holdfast_lab.study.benchmark")
    return tuple(
        msgspec.json.decode(folder.joinpath(name).read_bytes(), type=BenchmarkProtocol)
        for name in PROTOCOL_FILES
    )


def protocol(folder: Path | None = None) -> BenchmarkProtocol:
    """Return the version whose recordings a folder has; the newest if it has those of none.

    Args:
        folder: with a folder for each split; None for the newest version.
    """
    newest = protocols()[-1]
    if folder is None or not (folder / TUNING).is_dir():
        return newest
    # One recording tells the versions apart: the twin that made them differs in its last bits.
    first = next(iter(load_dataset(folder / TUNING)))
    digest = digest_of(first)
    made = (p for p in protocols() if p.splits[TUNING].digests.get(first.name) == digest)
    return next(made, newest)


def load_split(folder: Path, split: str) -> Dataset:
    """Return the recordings of a split.

    Args:
        folder: with a folder for each split.
        split: its name.

    Raises:
        RecordingError: the folder of the split does not exist.
    """
    path = folder / split
    if not path.is_dir():
        raise RecordingError(
            f"{path}: no such folder; `holdfast study data {folder}` simulates the recordings"
        )
    return load_dataset(path)


def digest_of(recording: Recording) -> str:
    """Return the digest of samples, labels, metadata and truth of a recording."""
    return content_digest(recording).hex()[:DIGEST_LENGTH]


def differing(split: BenchmarkSplit, digests: Mapping[str, str]) -> list[str]:
    """Return the names of the recordings that are not those of the protocol.

    Args:
        split: of the protocol.
        digests: of the recordings, by name.
    """
    names = {*split.digests, *digests}
    return sorted(name for name in names if split.digests.get(name) != digests.get(name))
