"""One clock for a video and a recording: the offset at which motion and force agree."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.detection import Tare
from holdfast.errors import RecordingError
from holdfast.labelling.rules.video_motion import TipMotion, force_of, mean_over, robust_fit
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

MAX_CLOCK_ERROR = 0.010
"""Largest standard error of the offset of the clocks with which onsets are labelled [s]."""
FINE_REACH, FINE_STEP = 0.06, 0.0025
"""Offsets around the coarse one that are tried, and their step [s]."""
CLEAR_PEAK = 2.0
"""Ratio between the best coarse offset and any other, from which it is taken. Measured on the
twin: 2.5 to 13 for the own video, 1.0 to 1.5 for another one."""
COARSE_TIME = 0.05
"""Time between the two ends of the changes by which the clocks are compared first [s]."""
FLASH_MARKER = "flash"
"""Marker of the moment at which the page of `serve` lights up."""
CLEAR_RISE, MIN_RISE = 12.0, 0.1
"""Rise of the brightness from one picture to the next that is a flash, as a multiple of the usual
one, which is at least `MIN_RISE` of 255 steps."""
FAST_SHARE = 0.05
"""Share of the pictures, those with the largest accelerations, by which the clocks are compared:
slow motion lags behind the force, because skins creep and objects roll."""
MIN_FITTED = 100
"""Least number of pictures of a loaded finger."""
USUAL_DELAY = 0.05
"""Time from a picture to its stamp by `record --camera`: exposure and transfer take 10 to 100 ms,
which is within `FINE_REACH` of it [s]."""
N_CLOCK_PARTS = 8
"""Parts of the recording that are left out in turn for the error of the offset (jackknife)."""
FITTED_SHARE = 0.2
"""A finger whose force is below this share of its usual one is not fitted."""


class VideoClock(NamedTuple):
    """Time that is added to the stamps of a video, and its standard error [s]."""

    offset: float
    error: float


def flash_offset(recording: Recording, times: Array, levels: Array) -> float | None:
    """Return the offset at which the pictures light up where the page of `serve` flashed [s].

    It is exact to a picture and to what screen and browser take: motion refines it.

    Args:
        recording: with markers `flash`.
        times: (n,) of the pictures [s].
        levels: (n,) their brightness.

    Returns:
        The offset; None without a marker, or where no picture lights up.
    """
    flashes = np.array([time for time, text in recording.markers if text == FLASH_MARKER])
    rises = np.diff(levels)
    if not len(flashes) or not len(rises):
        return None
    usual = max(float(np.median(np.abs(rises))), MIN_RISE)
    steps = times[1:][rises > CLEAR_RISE * usual]
    # All flashes of a recording have one offset: that at which most of them light up a picture.
    offsets = (flashes[:, None] - steps).ravel()
    if not len(offsets):
        return None
    near = np.abs(offsets[:, None] - offsets) < FINE_REACH
    return float(np.median(offsets[near[np.argmax(near.sum(axis=1))]]))


def video_clock(
    recording: Recording,
    tips: Mapping[str, TipMotion],
    grid: Array,
    tare: Tare,
    video: Path,
    coarse: float | None = None,
    expected: float | None = None,
) -> VideoClock:
    """Return the offset of the clock of a video, by what the camera sees and the fingers feel.

    Args:
        recording: of the fingers.
        tips: their motion.
        grid: (n,) times of the motion, on the clock of the video [s].
        tare: of the forces.
        video: for messages.
        coarse: offset that is known to `FINE_REACH` [s]; by default it is searched.
        expected: the coarse offset where the search finds none that is clear [s].

    Raises:
        RecordingError: nothing moves alike, or the error is too large.
    """
    step = float(grid[1] - grid[0])
    clear = CLEAR_PEAK
    if coarse is None:
        coarse, clear = _coarse_offset(recording, tips, grid, tare)
    if clear < CLEAR_PEAK and expected is not None:
        coarse = expected
    elif clear < CLEAR_PEAK:
        raise RecordingError(
            f"{video}: its motion is not that of recording {recording.name!r} at any offset (the "
            f"best is {clear:.1f} times as likely as another, {CLEAR_PEAK:g} times expected): "
            "another video, or nothing moves; push the object to and fro at the start"
        )
    offsets = coarse + np.arange(-FINE_REACH, FINE_REACH + FINE_STEP / 2, FINE_STEP)
    costs = np.zeros((len(offsets), N_CLOCK_PARTS))
    for finger, tip in tips.items():
        force_at = force_of(recording, finger, tare)
        loaded = np.linalg.norm(force_at(grid + coarse), axis=1)
        held = ((loaded > FITTED_SHARE) & tip.seen)[1:-1]
        jerks = np.diff(tip.position, 2, axis=0)
        size = mean_over(np.linalg.norm(jerks, axis=1), 5)
        if held.sum() < MIN_FITTED:
            continue
        fast = np.flatnonzero(held & (size > np.quantile(size[held], 1 - FAST_SHARE)))
        part = np.arange(len(fast)) * N_CLOCK_PARTS // len(fast)
        for k, offset in enumerate(offsets):
            felt = np.diff(force_at(grid + offset), 2, axis=0)
            _, rest = robust_fit(felt[fast], jerks[fast])
            costs[k] += np.bincount(part, rest, N_CLOCK_PARTS)
    whole = costs.sum(axis=1)
    if not whole.any():
        raise RecordingError(f"{video}: no finger whose motion it shows is loaded meanwhile")
    # Fast pictures are cut into parts in order of time; each fit leaves out one of them.
    parts = np.array([_lowest(offsets, whole - costs[:, k]) for k in range(N_CLOCK_PARTS)])
    # The variance of a jackknife is n - 1 times that of the results without one part.
    error = float(np.sqrt((N_CLOCK_PARTS - 1) * parts.var() + step**2 / 144))
    if error > MAX_CLOCK_ERROR:
        raise RecordingError(
            f"{video}: its clock is known to {1e3 * error:.0f} ms only, and to "
            f"{1e3 * MAX_CLOCK_ERROR:.0f} ms or better it must be (pictures are lost, or nothing "
            "moves fast): tap the object three times, or give the offset"
        )
    return VideoClock(_lowest(offsets, whole), error)


def _coarse_offset(
    recording: Recording, tips: Mapping[str, TipMotion], grid: Array, tare: Tare
) -> tuple[float, float]:
    """Return the offset at which changes of force explain most of the motion, and how clearly.

    The share that a linear map explains is computed for all offsets at once, from correlations.
    Large changes are cut, so that closing hands and single jerks do not decide.

    Returns:
        The offset [s], and the share there over the largest one elsewhere.
    """
    from scipy.signal import correlate

    step = float(grid[1] - grid[0])
    seconds = np.arange(recording.start, recording.end, step)
    n = max(round(COARSE_TIME / step), 1)
    shares: Array = np.zeros(len(grid) + len(seconds) - 2 * n - 1)
    for finger, tip in tips.items():
        force = force_of(recording, finger, tare)(seconds)
        moved, felt = (_cut(values[n:] - values[:-n]) for values in (tip.position, force))
        products = np.array([[correlate(f, m) for f in felt.T] for m in moved.T])
        inverse = np.linalg.pinv(felt.T @ felt)
        explained = np.einsum("ijl,jk,ikl->l", products, inverse, products)
        shares += explained / max((moved**2).sum(), 1e-12)
    best = int(np.argmax(shares))
    # Motion is smooth, so the offsets beside the best one are nearly as good: they do not count.
    near = round(FINE_REACH / step) + 10
    others = np.delete(shares, slice(max(best - near, 0), best + near + 1))
    # The correlation begins with the largest shift; there is none at the last index of `moved`.
    shift = best - (len(grid) - n - 1)
    clear = shares[best] / max(others.max(initial=0.0), 1e-12)
    return float(seconds[0] - grid[0] + shift * step), float(clear)


def _cut(changes: Array) -> Array:
    """Return changes around their mean, those above their 70 % quantile cut to it."""
    sizes = np.linalg.norm(changes, axis=1)
    most = np.quantile(sizes, 0.7)
    cut = changes * np.minimum(1.0, most / np.maximum(sizes, 1e-12))[:, None]
    return np.asarray(cut - cut.mean(axis=0))


def _lowest(offsets: Array, costs: Array) -> float:
    """Return the offset of the lowest cost, between the steps by a parabola [s]."""
    k = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
    left, middle, right = costs[k - 1 : k + 2]
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / bend if bend > 0 else 0.0
    return float(offsets[k] + FINE_STEP * np.clip(shift, -1, 1))
