"""Recordings by path: the suffix says the format."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from holdfast.errors import OutputError, RecordingError
from holdfast.io.label_files import labels_for
from holdfast.recordings import Recording

SUFFIXES = (".parquet", ".mcap")


def load_recording(path: str | Path, labels: bool = True) -> Recording:
    """The recording in a file, Parquet or MCAP by its suffix.

    A file that was cut off gives what could be recovered, with `complete=False`; samples
    whose checksum fails are never returned.

    Args:
        path: of the file.
        labels: take the labels of `<name>.labels.json` where there is one, in place of those
            inside.

    Raises:
        RecordingError: it cannot be read, is damaged or no recording, or the label file
            beside it is of another recording.
    """
    file = Path(path)
    try:
        recording: Recording = _format_of(file).load(file)
    except OSError as cause:
        raise RecordingError(f"cannot read {file}: {cause.strerror or cause}") from cause
    beside = labels_for(file, recording.digest) if labels else None
    if beside is None:
        return recording
    try:
        return recording.with_labels(beside)
    except RecordingError as cause:
        raise RecordingError(f"{file.stem}.labels.json: {cause}") from cause


def save_recording(recording: Recording, path: str | Path, force: bool = False) -> None:
    """Writes a recording, Parquet or MCAP by the suffix, whole or not at all.

    Args:
        recording: what to write.
        path: where to.
        force: replace what is there.

    Raises:
        OutputError: something is there already, the suffix is unknown, or the disk refuses.
        RecordingError: it holds what the format cannot.
    """
    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise OutputError(f"cannot write {target}: {_suffixes(target)}")
    _module(target.suffix).save(_native(recording), target, force=force)


def read_chunks(
    path: str | Path, n_samples: int = 16384, labels: bool = True
) -> Iterator[Recording]:
    """Consecutive pieces of a recording, in bounded memory.

    Put together they are what `load_recording` gives. Labels, truth and markers are cut to
    the piece; a module may have no samples in a piece.

    Args:
        path: of the file.
        n_samples: how many samples of a module a piece holds at most.
        labels: take the labels of `<name>.labels.json`, as `load_recording` does.

    Yields:
        Recordings of the same name and modules.

    Raises:
        RecordingError: as `load_recording`.
        ValueError: `n_samples` is under 1.
    """
    if n_samples < 1:
        raise ValueError(f"at least 1 sample a piece expected, {n_samples} given")
    from holdfast.io.pieces import pieces

    file = Path(path)
    return pieces(_format_of(file), file, n_samples, labels=labels)


def is_recording(path: Path) -> bool:
    """Whether a file claims to be a recording, be it cut or damaged."""
    return path.suffix in SUFFIXES and path.is_file() and not _module(path.suffix).is_foreign(path)


def _format_of(path: Path) -> ModuleType:
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise RecordingError(f"{path} {what}; a recording's file expected")
    if path.suffix not in SUFFIXES:
        raise RecordingError(f"cannot read {path}: {_suffixes(path)}")
    return _module(path.suffix)


def _module(suffix: str) -> ModuleType:
    if suffix == ".parquet":
        from holdfast.io import parquet

        return parquet
    from holdfast.io import mcap

    return mcap


def _suffixes(path: Path) -> str:
    return (
        f"{path.suffix or 'no suffix'} given, {' or '.join(SUFFIXES)} expected "
        "(`holdfast import` brings other formats in)"
    )


def _native(recording: Recording) -> Recording:
    """The recording with its readings in the byte order of the machine."""
    modules = {
        name: replace(m, readings=m.readings.astype(m.readings.dtype.newbyteorder("=")))
        if not m.readings.dtype.isnative
        else m
        for name, m in recording.modules.items()
    }
    return replace(recording, modules=modules)
