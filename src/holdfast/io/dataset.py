"""Datasets: folders of recordings, loaded one at a time."""

from collections.abc import Sequence
from pathlib import Path
from typing import overload

from holdfast.errors import RecordingError
from holdfast.io.file_formats import SUFFIXES, is_recording, load_recording
from holdfast.recordings import Recording


class Dataset(Sequence[Recording]):
    """Sequence of the recordings of a folder, in the order of their names.

    It stores paths only and loads a recording when it is accessed, so that a dataset may be
    larger than memory. Other files in the folder are ignored. If a recording is stored both as
    Parquet and as MCAP, the Parquet file is used.

    Args:
        paths: paths of the recordings.
        labels: use the labels of `<name>.labels.json` if there is one.
        in_contact: declare in the metadata that the first samples of all recordings are load.
    """

    def __init__(
        self, paths: Sequence[Path], *, labels: bool = True, in_contact: bool = False
    ) -> None:
        self._paths = tuple(paths)
        self._labels = labels
        self._in_contact = in_contact

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of the recordings, in order."""
        return self._paths

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the recordings, in order."""
        return tuple(path.stem for path in self._paths)

    def __len__(self) -> int:
        return len(self._paths)

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> "Dataset": ...
    def __getitem__(self, index: int | slice) -> "Recording | Dataset":
        if isinstance(index, slice):
            return Dataset(self._paths[index], labels=self._labels, in_contact=self._in_contact)
        recording = load_recording(self._paths[index], labels=self._labels)
        return recording.with_start(loaded=self._in_contact or None)


def load_dataset(folder: str | Path, *, labels: bool = True, in_contact: bool = False) -> Dataset:
    """Find the recordings in a folder, sorted by name; they are loaded when accessed.

    Args:
        folder: path of the folder; the path of one recording gives a dataset of one.
        labels: use the labels of `<name>.labels.json` if there is one.
        in_contact: declare in the metadata that the first samples of all recordings are load.

    Raises:
        RecordingError: the folder does not exist, or has no recording.
    """
    path = Path(folder)
    if path.is_file():
        return Dataset([path], labels=labels, in_contact=in_contact)
    if not path.is_dir():
        raise RecordingError(f"there is no folder {path}; a folder of recordings expected")
    by_name: dict[str, Path] = {}
    # The preferred suffix comes last and replaces others. A file that is being written is hidden.
    for suffix in reversed(SUFFIXES):
        by_name.update({p.stem: p for p in path.glob(f"[!.]*{suffix}") if is_recording(p)})
    if not by_name:
        n_entries = len(list(path.iterdir()))
        # As the folder of `holdfast demo`, whose recordings are one level deeper.
        deeper = (p.parent for p in sorted(path.glob("[!.]*/*")) if is_recording(p))
        inside = next(deeper, None)
        advice = f"{inside} has some" if inside else "`holdfast import` makes them"
        what = (
            f"no recording in {path} ({n_entries} other entries)"
            if n_entries
            else f"{path} is empty"
        )
        raise RecordingError(
            f"{what}; files {' or '.join('*' + suffix for suffix in SUFFIXES)} expected: {advice}"
        )
    paths = [by_name[name] for name in sorted(by_name)]
    return Dataset(paths, labels=labels, in_contact=in_contact)
