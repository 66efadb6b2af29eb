"""A folder of recordings, read one at a time."""

from collections.abc import Sequence
from pathlib import Path
from typing import overload

from holdfast.errors import RecordingError
from holdfast.io.recording_files import SUFFIXES, is_recording, load_recording
from holdfast.recordings import Recording


class Dataset(Sequence[Recording]):
    """The recordings of a folder, sorted by name, each read when it is asked for.

    It holds paths only, so that a folder may hold more than memory does. Files that are no
    recordings are ignored; where a recording lies there as Parquet and as MCAP, the Parquet
    file is taken.

    Args:
        paths: of the recordings.
        labels: take the labels of `<name>.labels.json` where there is one.
    """

    def __init__(self, paths: Sequence[Path], *, labels: bool = True) -> None:
        self._paths = tuple(paths)
        self._labels = labels

    @property
    def paths(self) -> tuple[Path, ...]:
        """Where the recordings are, in order."""
        return self._paths

    @property
    def names(self) -> tuple[str, ...]:
        """What the recordings are called, in order."""
        return tuple(path.stem for path in self._paths)

    def __len__(self) -> int:
        return len(self._paths)

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> "Dataset": ...
    def __getitem__(self, index: int | slice) -> "Recording | Dataset":
        if isinstance(index, slice):
            return Dataset(self._paths[index], labels=self._labels)
        return load_recording(self._paths[index], labels=self._labels)


def load_dataset(folder: str | Path, *, labels: bool = True) -> Dataset:
    """The recordings in a folder, sorted by name; nothing is read yet.

    Args:
        folder: where they are; a single recording's file is a dataset of one.
        labels: take the labels of `<name>.labels.json` where there is one.

    Raises:
        RecordingError: there is no such folder, or no recording in it.
    """
    place = Path(folder)
    if place.is_file():
        return Dataset([place], labels=labels)
    if not place.is_dir():
        raise RecordingError(f"there is no folder {place}; a folder of recordings expected")
    by_name: dict[str, Path] = {}
    for suffix in reversed(SUFFIXES):
        by_name.update({p.stem: p for p in place.glob(f"[!.]*{suffix}") if is_recording(p)})
    if not by_name:
        found = len(list(place.iterdir()))
        raise RecordingError(
            f"no recording in {place} ({found} other entries); files "
            f"{' or '.join('*' + suffix for suffix in SUFFIXES)} expected: "
            "`holdfast import` makes them"
        )
    return Dataset([by_name[name] for name in sorted(by_name)], labels=labels)
