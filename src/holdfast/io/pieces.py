"""A recording in consecutive pieces, so that memory stays bounded."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.io.header import Header
from holdfast.io.label_files import labels_for, labels_path
from holdfast.io.series import Samples, cut_labels, recording_from
from holdfast.io.spans import spans
from holdfast.recordings import Label, Recording
from holdfast.sensors.types import Array

LAG = 1.0
"""An MCAP file has modules one after the other: what is newer may not be whole yet [s]."""

_Buffer = dict[str, tuple[Array, npt.NDArray[Any]]]


def pieces(
    source: ModuleType, path: Path, n_samples: int, *, labels: bool = True
) -> Iterator[Recording]:
    """Recordings of at most `n_samples` samples a module, as `read_chunks` says.

    Args:
        source: the format: `holdfast.io.parquet` or `holdfast.io.mcap`.
        path: of the file.
        n_samples: how many samples of a module a piece holds at most.
        labels: take those beside the file, where there are any.
    """
    header, groups, complete = source.chunks(path)
    beside = _labels(source, path, header, complete) if labels else None
    left = sorted(header.markers)
    for samples, until in _cuts(groups, n_samples):
        markers = [marker for marker in left if marker[0] < until]
        left = left[len(markers) :]
        part = msgspec.structs.replace(header, markers=markers)
        piece = recording_from(part, samples, path, complete=complete)
        yield piece if beside is None else _relabelled(piece, beside)


def _labels(
    source: ModuleType, path: Path, header: Header, complete: bool
) -> Mapping[str, tuple[Label, ...]] | None:
    """Labels from beside the file; a file that was cut is read whole to know its digest."""
    if not labels_path(path).exists():
        return None
    known = header.digest if complete else ""
    return labels_for(path, known or source.load(path).digest)


def _relabelled(piece: Recording, labels: Mapping[str, tuple[Label, ...]]) -> Recording:
    modules = {
        name: replace(module, labels=cut_labels(labels.get(name, ()), module))
        for name, module in piece.modules.items()
    }
    return replace(piece, modules=modules)


def _cuts(groups: Iterable[Samples], n_samples: int) -> Iterator[tuple[Samples, float]]:
    """Samples of one piece after the other, and the time at which the next one begins."""
    parts: list[Samples] = []
    n_held = dict[str, int]()
    for group in groups:
        parts.append(group)
        for topic, (times, _) in group.items():
            n_held[topic] = n_held.get(topic, 0) + len(times)
        if max((n for topic, n in n_held.items() if _is_tactile(topic)), default=0) > n_samples:
            found = _split(_joined(parts), n_samples)
            starts = [_start(piece) for piece in found]
            n_whole = int(np.searchsorted(starts[1:], _end(found[-1]) - LAG))
            yield from zip(found[:n_whole], starts[1:], strict=False)
            rest = _joined(found[n_whole:])
            parts, n_held = [rest], {topic: len(times) for topic, (times, _) in rest.items()}
    if parts:
        found = _split(_joined(parts), n_samples)
        yield from zip(found, [*(_start(piece) for piece in found[1:]), np.inf], strict=True)


def _split(samples: _Buffer, n_samples: int) -> list[_Buffer]:
    times = {topic: pair[0] for topic, pair in samples.items()}
    tactile = [topic for topic in times if _is_tactile(topic)]
    return [
        {topic: (samples[topic][0][cut], samples[topic][1][cut]) for topic, cut in span.items()}
        for span in spans(times, np.inf, n_samples, tactile)
    ]


def _joined(parts: Sequence[Samples]) -> _Buffer:
    topics = list(dict.fromkeys(topic for part in parts for topic in part))
    return {
        topic: (
            np.concatenate([part[topic][0] for part in parts if topic in part]),
            np.concatenate([part[topic][1] for part in parts if topic in part]),
        )
        for topic in topics
    }


def _start(samples: Samples) -> float:
    return min(float(times[0]) for times, _ in samples.values() if len(times))


def _end(samples: Samples) -> float:
    return max(float(times[-1]) for times, _ in samples.values() if len(times))


def _is_tactile(topic: str) -> bool:
    return topic.startswith("/tactile/")
