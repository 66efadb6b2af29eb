"""How a skin is read: noise by lag and axis, taxels that move together, and repeated readings.

All figures are of quiet and moving holds, sample by sample, so they need no load and no truth of
slip.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from holdfast.metrics.masks import runs
from holdfast.sensors.types import Array, Flags
from holdfast_lab.skin.situations import Marked

NOISE_LAGS = (1, 2, 4, 8)
"""Lags of the noise [samples]."""
MIN_RUN = 16
"""Samples of the shortest part of a situation that is used."""


class ReadoutFigures(NamedTuple):
    """How the skin of a set is read in one situation; medians over fingers.

    Attributes:
        n_fingers: fingers with such a situation.
        by_lag: growth of the rms change with the lag, over that at lag 1; white noise has 1.
        second: rms of second differences over that of first ones; white noise has sqrt 3.
        normal: rms of second differences along the normal over that of one axis across it.
        neighbours: correlation of second differences of the nearest taxels, by axis x, y, z.
        in_turn: the same correlation, all axes, of taxels 4 and 8 apart in number. Where taxels are
            read in turn on lines of 8, those 8 apart are read together; on a 4 x 4 patch, those 4
            apart are neighbours.
        repeated: share of samples that repeat the last one whole.
        stale: share of the readings of single taxels that repeat, in the other samples.
    """

    n_fingers: int
    by_lag: tuple[float, ...]
    second: float
    normal: float
    neighbours: tuple[float, float, float]
    in_turn: tuple[float, float]
    repeated: float
    stale: float


def readout_figures(recordings: Iterable[Marked], situation: str) -> ReadoutFigures | None:
    """Return how the skin of recordings is read in a situation; None without any part of it."""
    rows = [
        row
        for marked in recordings
        for name, module in marked.recording.modules.items()
        if situation in marked.masks[name]
        and (row := _row(module.readings, module.sensor.positions, marked.masks[name][situation]))
        is not None
    ]
    if not rows:
        return None
    columns = np.array(rows).T
    known = [column[~np.isnan(column)] for column in columns]
    middle = [float(np.median(values)) if len(values) else math.nan for values in known]
    lags, rest = middle[: len(NOISE_LAGS)], middle[len(NOISE_LAGS) :]
    second, normal, x, y, z, near, far, repeated, stale = rest
    return ReadoutFigures(
        len(rows), tuple(lags), second, normal, (x, y, z), (near, far), repeated, stale
    )  # fmt: skip


def _row(readings: Array, positions: Array, mask: Flags) -> list[float] | None:
    parts = [np.asarray(readings[a:b], dtype=float) for a, b in runs(mask) if b - a >= MIN_RUN]
    if not parts:
        return None
    by_lag = [_rms([part[lag:] - part[:-lag] for part in parts]) for lag in NOISE_LAGS]
    second = np.concatenate([np.diff(part, 2, axis=0) for part in parts])
    first = np.concatenate([np.diff(part, axis=0) for part in parts])
    across = math.sqrt(float((second[:, :, :2] ** 2).mean()))
    along = math.sqrt(float((second[:, :, 2] ** 2).mean()))
    unchanged = (first == 0).all(axis=2)
    whole = unchanged.all(axis=1)
    return [
        *(rms / max(by_lag[0], 1e-12) for rms in by_lag),
        _rms([second]) / max(by_lag[0], 1e-12),
        along / max(across, 1e-12),
        *_neighbours(second, positions),
        *(_apart(second, number) for number in (4, 8)),
        float(whole.mean()),
        float(unchanged[~whole].mean()) if not whole.all() else math.nan,
    ]


def _rms(parts: list[Array]) -> float:
    return math.sqrt(float(np.mean(np.concatenate([part.ravel() for part in parts]) ** 2)))


def _neighbours(second: Array, positions: Array) -> list[float]:
    """Return the mean correlation of the nearest taxels, by axis."""
    distances = np.linalg.norm(positions[:, None] - positions, axis=2)
    np.fill_diagonal(distances, np.inf)
    near = distances < 1.1 * distances.min()
    means = []
    for axis in range(3):
        values = second[:, :, axis]
        used: Flags = np.ptp(values, axis=0) > 0
        pairs = near[np.ix_(used, used)]
        if pairs.any():
            means.append(float(np.atleast_2d(np.corrcoef(values[:, used].T))[pairs].mean()))
        else:
            means.append(math.nan)
    return means


def _apart(second: Array, number: int) -> float:
    """Return the mean correlation of taxels whose numbers differ by a number, over all axes."""
    first, last = second[:, :-number].reshape(len(second), -1), second[:, number:]
    if not first.shape[1]:
        return math.nan
    products = (first * last.reshape(len(second), -1)).mean(axis=0)
    sizes = np.sqrt((second**2).mean(axis=0))
    scale = (sizes[:-number] * sizes[number:]).ravel()
    known = scale > 0
    return float((products[known] / scale[known]).mean()) if known.any() else math.nan
