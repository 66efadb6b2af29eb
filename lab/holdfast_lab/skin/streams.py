"""What a stream looks like: noise by time, steps, intervals, repeats, and motion of the hand.

Where `readout` gives one figure for a set, this gives the values of each finger, so that
distributions of the twin and of real hands can be drawn beside each other.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from holdfast.features import fingertip_force
from holdfast.features.stream import extract
from holdfast.metrics.masks import runs
from holdfast.model import Model
from holdfast.recordings import Tactile
from holdfast.sensors.types import Array, Flags
from holdfast.training.calibration import activity
from holdfast_lab.skin.situations import Marked

CHANGE_TIMES = (0.017, 0.033, 0.067, 0.133, 0.267, 0.533, 1.067, 2.133)
"""Times over which the change of a reading is measured [s]."""
HAND_TREMOR_BAND, HAND_MOTION_BAND = (8.0, 12.0), (2.0, 12.0)
"""Bands of a person's tremor, and of motion [Hz]."""
MIN_RUN_SECONDS = 0.25
"""Parts of a quiet hold that are shorter are not used [s]."""
MIN_BAND_SECONDS = 1.0
"""Parts of a hold that are shorter have no spectrum [s]."""
HANDLED = ("quiet", "moving")
"""Situations of ordinary handling."""


class FingerStream(NamedTuple):
    """The stream of one finger of one recording.

    Attributes:
        changes: (8,) rms change of a quiet reading over `CHANGE_TIMES`, over that over the first
            time; white noise has 1. NaN where no quiet part is as long.
        noise_in_steps: (n,) noise of each axis of each taxel in quiet holds, over the step of
            the readings.
        intervals: (n - 1,) between rows, over their median.
        repeated: share of rows that repeat the last one whole.
        activity: of ordinary handling, as `holdfast.training.calibration.activity` has it; NaN
            without any.
        tremor: share of the force's power from 2 to 12 Hz that is from 8 to 12 Hz, in ordinary
            handling; white noise has 0.4. NaN where no part is long enough.
        motion: rms of the force from 2 to 12 Hz over its noise, the rms change from row to row
            over the root of 2.
    """

    changes: Array
    noise_in_steps: Array
    intervals: Array
    repeated: float
    activity: float
    tremor: float
    motion: float


def finger_streams(recordings: Iterable[Marked], model: Model) -> Iterator[FingerStream]:
    """Yield the stream of each finger of some recordings.

    Args:
        recordings: with their situations.
        model: of any finger; its features and default handling give the activity.
    """
    for marked in recordings:
        activities = _activities(marked, model)
        for name, module in marked.recording.modules.items():
            if module.n_samples < 2:
                continue
            masks = marked.masks[name]
            quiet = masks.get("quiet", np.zeros(module.n_samples, dtype=bool))
            steps = np.diff(module.times)
            same = (np.diff(module.readings, axis=0) == 0).all(axis=(1, 2))
            tremor, motion = _bands(module, _held(masks, module.n_samples))
            yield FingerStream(
                _changes(module, quiet), _noise_in_steps(module, quiet), steps / np.median(steps),
                float(same.mean()), activities[name], tremor, motion,
            )  # fmt: skip


def _held(masks: dict[str, Flags], n: int) -> Flags:
    grasped = np.zeros(n, dtype=bool)
    for name in HANDLED:
        grasped |= masks.get(name, False)
    return grasped


def _parts(module: Tactile, mask: Flags, seconds: float) -> list[Array]:
    """Return the readings of the parts of a mask that are long enough."""
    return [
        np.asarray(module.readings[a:b], dtype=np.float64)
        for a, b in runs(mask)
        if b - a > max(2.0, seconds / module.period)
    ]


def _changes(module: Tactile, quiet: Flags) -> Array:
    parts = _parts(module, quiet, MIN_RUN_SECONDS)
    rms = np.full(len(CHANGE_TIMES), math.nan)
    for index, time in enumerate(CHANGE_TIMES):
        lag = max(1, round(time / module.period))
        long = [part[lag:] - part[:-lag] for part in parts if len(part) > 1.5 * lag]
        if long:
            rms[index] = math.sqrt(float(np.mean(np.concatenate(long) ** 2)))
    return np.asarray(rms / rms[0] if rms[0] > 0 else np.full(len(rms), math.nan))


def _noise_in_steps(module: Tactile, quiet: Flags) -> Array:
    parts = _parts(module, quiet, MIN_RUN_SECONDS)
    changes = np.abs(np.diff(np.asarray(module.readings, dtype=np.float64), axis=0))
    changed = changes[changes > 0]
    if not (parts and len(changed)):
        return np.empty(0)
    step = float(np.quantile(changed, 0.001))
    squares = np.concatenate([np.diff(part, axis=0) ** 2 for part in parts])
    return np.asarray(np.sqrt(squares.mean(axis=0) / 2).ravel() / step)


def _bands(module: Tactile, grasped: Flags) -> tuple[float, float]:
    """Return the share of tremor in motion, and the motion over the noise, of the force."""
    force = fingertip_force(module.readings, module.sensor, "none")
    powers, noise, n = np.zeros(2), 0.0, 0
    for a, b in runs(grasped):
        if b - a < MIN_BAND_SECONDS / module.period:
            continue
        rates = np.fft.rfftfreq(b - a, module.period)
        middle = force[a:b] - force[a:b].mean(axis=0)
        power = 2 * (np.abs(np.fft.rfft(middle, axis=0)) ** 2).sum(axis=1) / (b - a)
        for index, (low, high) in enumerate((HAND_TREMOR_BAND, HAND_MOTION_BAND)):
            powers[index] += power[(rates >= low) & (rates < high)].sum()
        noise += float((np.diff(force[a:b], axis=0) ** 2).sum() / 2)
        n += b - a
    if not (n and noise and powers[1]):
        return math.nan, math.nan
    return float(powers[0] / powers[1]), float(np.sqrt(powers[1] / noise))


def _activities(marked: Marked, model: Model) -> dict[str, float]:
    recording = marked.recording
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    rows = extract(model.plan(sensors, recording.rate), recording)
    activities = {}
    for name, module in recording.modules.items():
        features = rows[name].features
        used = _held(marked.masks[name], module.n_samples) & np.isfinite(features).all(axis=1)
        part = model.finger(name)
        activities[name] = activity(part, features[used]) if used.any() else math.nan
    return activities
