"""Load and save recordings by path; the suffix of the file chooses the format."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import msgspec
import numpy as np

from holdfast.errors import OutputError, RecordingError, require_extras
from holdfast.io.label_files import decode_labels, label_bytes, labels_for, labels_of, labels_path
from holdfast.io.safe_reading import recording_errors
from holdfast.io.timed_arrays import (
    TACTILE,
    TimedArray,
    TimedArrays,
    recording_from,
    time_spans,
)
from holdfast.recordings import Recording, cut_labels

SUFFIXES = (".parquet", ".mcap")
"""Suffixes of the formats; the first is preferred if a recording exists in both."""

MAX_MODULE_LAG = 1.0
"""An MCAP file has the samples of the modules one after the other. Samples that are newer
than this may be incomplete [s]."""


def load_recording(path: str | Path, labels: bool = True) -> Recording:
    """Load a recording, Parquet or MCAP by the suffix of the file.

    If the end of the file was cut off, the rest is recovered and `complete` is False. Samples
    whose checksum fails are never returned.

    Args:
        path: path of the file.
        labels: use the labels of `<name>.labels.json`, if there is one, instead of those in
            the file.

    Raises:
        RecordingError: the file cannot be read, is damaged or not a recording, or the label
            file belongs to another recording.
    """
    file = Path(path)
    file_format = _format_of(file)
    with recording_errors(file):
        recording: Recording = file_format.load(file)
    file_labels = labels_for(file, recording.digest) if labels else None
    if file_labels is None:
        return recording
    try:
        return recording.with_labels(file_labels)
    except RecordingError as cause:
        raise RecordingError(f"{file.stem}.labels.json: {cause}") from cause


def save_recording(recording: Recording, path: str | Path, force: bool = False) -> None:
    """Save a recording, as Parquet or MCAP by the suffix; on an error nothing is written.

    Args:
        recording: recording to save.
        path: path of the file.
        force: replace an existing file.

    Raises:
        OutputError: the file exists, its suffix is unknown, or the disk reports an error.
        RecordingError: the format cannot store the recording.
    """
    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise OutputError(f"cannot write {target}: {_expected_suffixes(target)}")
    modules = dict(recording.modules)
    for name, module in recording.modules.items():
        # Arrow refuses arrays in another byte order, which importers of such files may give.
        native = module.readings.dtype.newbyteorder("=")
        if native != module.readings.dtype:
            modules[name] = replace(module, readings=module.readings.astype(native))
    format_module(target.suffix).save(replace(recording, modules=modules), target, force=force)


def read_chunks(
    path: str | Path, n_samples: int = 16384, labels: bool = True
) -> Iterator[Recording]:
    """Read a recording in consecutive chunks, in bounded memory.

    All chunks together are what `load_recording` returns. Labels, truth and markers are cut to
    the chunk; a module may have no samples in a chunk.

    Args:
        path: path of the file.
        n_samples: maximum number of samples of a module in a chunk.
        labels: use the labels of `<name>.labels.json`, as `load_recording` does.

    Yields:
        Recordings with the same name and modules.

    Raises:
        RecordingError: as in `load_recording`.
        ValueError: `n_samples` is less than 1.
    """
    if n_samples < 1:
        raise ValueError(f"at least 1 sample in a chunk expected, {n_samples} given")
    file = Path(path)
    # Not a generator itself: a wrong path is refused by the call, not by the first chunk.
    return _chunks(_format_of(file), file, n_samples, labels=labels)


def is_recording(path: Path) -> bool:
    """Return whether a file is a recording, which may be cut or damaged."""
    if path.suffix not in SUFFIXES or not path.is_file():
        return False
    try:
        return not format_module(path.suffix).is_foreign(path)
    except OSError:  # it cannot be read; `load_recording` says why
        return True


def _format_of(path: Path) -> ModuleType:
    if not path.is_file():
        problem = "is a folder" if path.is_dir() else "does not exist"
        problem = "is a pipe or a device" if path.exists() and not path.is_dir() else problem
        raise RecordingError(f"{path} {problem}; a recording's file expected")
    if path.suffix not in SUFFIXES:
        raise RecordingError(f"cannot read {path}: {_expected_suffixes(path)}")
    return format_module(path.suffix)


def format_module(suffix: str) -> ModuleType:
    """Return the module of a format, which imports its libraries only when it is used.

    Raises:
        MissingExtra: the libraries are not installed.
    """
    if suffix == ".parquet":
        require_extras("parquet")
        from holdfast.io import parquet

        return parquet
    from holdfast.io import mcap

    return mcap


def _expected_suffixes(path: Path) -> str:
    return (
        f"{path.suffix or 'no suffix'} given, {' or '.join(SUFFIXES)} expected "
        "(`holdfast import` converts other formats)"
    )


def _chunks(
    file_format: ModuleType, path: Path, n_samples: int, *, labels: bool
) -> Iterator[Recording]:
    with recording_errors(path):
        header, groups, complete = file_format.read_groups(path)
        file_labels = None
        if labels and (data := label_bytes(path)) is not None:
            # A label file names its recording by the digest. A cut file, or one recorded live, has
            # none in its header, and is loaded to compute it.
            digest = header.digest if complete else ""
            digest = digest or file_format.load(path).digest
            file_labels = labels_of(decode_labels(data, labels_path(path)), path, digest)
        # A marker may be set for an earlier time than the one before.
        markers = sorted(header.markers)
        for arrays, end in _chunk_arrays(groups, n_samples):
            n_markers = sum(marker[0] < end for marker in markers)
            part = msgspec.structs.replace(header, markers=markers[:n_markers])
            markers = markers[n_markers:]
            chunk = recording_from(part, arrays, path, complete=complete)
            if file_labels is not None:
                modules = {
                    name: replace(module, labels=cut_labels(file_labels.get(name, ()), module))
                    for name, module in chunk.modules.items()
                }
                chunk = replace(chunk, modules=modules)
            yield chunk


def _chunk_arrays(
    groups: Iterable[TimedArrays], n_samples: int
) -> Iterator[tuple[TimedArrays, float]]:
    """Yield the arrays of each chunk, and the time at which the next chunk begins."""
    parts: list[TimedArrays] = []
    n_buffered = dict[str, int]()
    for group in groups:
        parts.append(group)
        for topic, (times, _) in group.items():
            n_buffered[topic] = n_buffered.get(topic, 0) + len(times)
        n_tactile = (n for topic, n in n_buffered.items() if topic.startswith(TACTILE))
        if max(n_tactile, default=0) > n_samples:
            chunks = _split(_joined(parts), n_samples)
            starts = [_start(chunk) for chunk in chunks]
            newest = max(float(times[-1]) for times, _ in chunks[-1].values() if len(times))
            # A chunk is ready when the next one begins before what other modules may still lack.
            n_ready = int(np.searchsorted(starts[1:], newest - MAX_MODULE_LAG))
            yield from zip(chunks[:n_ready], starts[1:], strict=False)
            rest = _joined(chunks[n_ready:])
            parts, n_buffered = [rest], {topic: len(times) for topic, (times, _) in rest.items()}
    if parts:
        chunks = _split(_joined(parts), n_samples)
        yield from zip(chunks, [*(_start(chunk) for chunk in chunks[1:]), np.inf], strict=True)


def _split(arrays: TimedArrays, n_samples: int) -> list[dict[str, TimedArray]]:
    times = {topic: pair[0] for topic, pair in arrays.items()}
    # `n_samples` limits the modules; truth may have rows at another rate.
    tactile = [topic for topic in times if topic.startswith(TACTILE)]
    return [
        {topic: (arrays[topic][0][cut], arrays[topic][1][cut]) for topic, cut in span.items()}
        for span in time_spans(times, np.inf, n_samples, tactile)
    ]


def _joined(parts: Sequence[TimedArrays]) -> dict[str, TimedArray]:
    topics = list(dict.fromkeys(topic for part in parts for topic in part))
    return {
        topic: (
            np.concatenate([part[topic][0] for part in parts if topic in part]),
            np.concatenate([part[topic][1] for part in parts if topic in part]),
        )
        for topic in topics
    }


def _start(arrays: TimedArrays) -> float:
    return min(float(times[0]) for times, _ in arrays.values() if len(times))
