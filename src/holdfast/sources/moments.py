"""The moments of a recording in the order of time: samples of all modules, and markers."""

import heapq
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

HOLD = 1.0
"""Pieces of a file may overlap by less than this, as modules are written one by one [s]."""

Run = tuple[Array, npt.NDArray[Any]]
"""Times (n,) and readings (n, n_taxels, 3) of a module."""


class Moment(NamedTuple):
    """What a recording has at one instant.

    Attributes:
        time: on the clock of the recording [s]; later than that of all samples before.
        samples: (n_taxels, 3) by module; empty where it is a marker.
        notice: the marker.
        n_refused: samples left out before this, because they lay back in time.
    """

    time: float
    samples: Mapping[str, npt.NDArray[Any]]
    notice: str = ""
    n_refused: int = 0


def moments(pieces: Iterable[Recording]) -> Iterator[Moment]:
    """Everything in consecutive pieces, in the order of time and in bounded memory.

    Modules that have a sample at the same time share a moment. Markers come after the samples
    of their time; those outside of the recording, at its beginning or end.

    Args:
        pieces: as `read_chunks` gives them.

    Raises:
        RecordingError: as `pieces` does, when what came before has been given.
        OSError: the same.
    """
    held: dict[str, Run] = {}
    markers: list[tuple[float, str]] = []
    last = -np.inf
    try:
        for piece in pieces:
            held |= {name: _joined(held.get(name), run) for name, run in _runs(piece).items()}
            markers += piece.markers
            until = _newest(held) - HOLD
            ready, held = _cut(held, until)
            if _newest(ready) > -np.inf:
                yield from _merged(ready, [m for m in markers if m[0] < until], last)
                markers = [m for m in markers if not m[0] < until]
                last = max(last, _newest(ready))
    except (RecordingError, OSError):
        yield from _merged(held, markers, last)  # what was read is sound
        raise
    yield from _merged(held, markers, last)


def _newest(runs: Mapping[str, Run]) -> float:
    """The time of the last sample [s]; minus infinity where there is none."""
    return max((float(times[-1]) for times, _ in runs.values() if len(times)), default=-np.inf)


def _runs(piece: Recording) -> dict[str, Run]:
    """Of each module; readings in native byte order."""
    return {
        name: (m.times, m.readings.astype(m.readings.dtype.newbyteorder("="), copy=False))
        for name, m in piece.modules.items()
    }


def _joined(one: Run | None, two: Run) -> Run:
    if one is None or not len(one[0]):
        return two
    return np.concatenate([one[0], two[0]]), np.concatenate([one[1], two[1]])


def _cut(runs: Mapping[str, Run], until: float) -> tuple[dict[str, Run], dict[str, Run]]:
    """What is before a time, and what is not."""
    before, after = {}, {}
    for name, (times, readings) in runs.items():
        k = int(np.searchsorted(times, until))
        before[name] = times[:k], readings[:k]
        after[name] = times[k:], readings[k:]
    return before, after


def _merged(
    runs: Mapping[str, Run], markers: list[tuple[float, str]], last: float
) -> Iterator[Moment]:
    """Samples after `last`, and the markers among them."""
    forward = {
        name: (times[times > last], readings[times > last])
        for name, (times, readings) in runs.items()
    }
    n_refused = sum(len(runs[name][0]) - len(forward[name][0]) for name in runs)
    times = reduce(np.union1d, (times for times, _ in forward.values()), np.empty(0))
    if not len(times):
        return
    first, end = float(times[0]), float(times[-1])
    words = [
        Moment(min(end, max(first, moment)), {}, f"marker: {' '.join(text.split())}")
        for moment, text in sorted(markers, key=itemgetter(0))
    ]
    merged = heapq.merge(_instants(times, forward), words, key=lambda moment: moment.time)
    yield next(merged)._replace(n_refused=n_refused)
    yield from merged


def _instants(times: Array, runs: Mapping[str, Run]) -> Iterator[Moment]:
    samples: list[dict[str, npt.NDArray[Any]]] = [{} for _ in times]
    for name, (own, readings) in runs.items():
        for k, sample in zip(np.searchsorted(times, own).tolist(), readings, strict=True):
            samples[k][name] = sample
    return map(Moment, times.tolist(), samples)
