"""Forces of the fingers of a hand on one time grid, their contact intervals, and the tare.

A tare by seconds is the mean of the first samples. If the hand holds the object already, this
mean contains the grip, and the force falls below zero when the grip ends.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from holdfast.contact import MERGE_GAP, MIN_CONTACT_DURATION
from holdfast.detection import Tare
from holdfast.detection.features import tared_force
from holdfast.detection.plan import TareArgument, baseline_of, first_finite, offline_tare
from holdfast.errors import RecordingError
from holdfast.metrics.masks import Mask, covered, drop_short_runs, fill_short_gaps, n_samples_of
from holdfast.recordings import GAP_PERIODS, STARTS_LOADED, Recording, Tactile
from holdfast.sensors.types import Array
from holdfast.training.finger_samples import contact_threshold
from holdfast.training.training_samples import rest_moments

FORCE_SMOOTHING_TIME = 0.05
"""Time over which the force is averaged: short against a push, which lasts 0.2 s or more [s]."""
VISIBLE_SHARE = 0.02
"""Share of the grip force that is visible on a plot. Less is neither contact, because baselines
drift, nor a change."""
LOADED_SECONDS = 0.25
"""A pull for this long means that the tare was taken under load, as in `kernel/faults.c` [s]."""
CREEP_LEVEL = 0.2
"""Share of the grip force below which a released elastomer may still keep a load (creep)."""
CREEP_RATE = 0.1
"""Share of the grip force per second below which a change of the force is creep [1/s]. Both are
from one recording of each profile of the twin (docs/study/labels-by-rules.md)."""


@dataclass(frozen=True, eq=False)
class FingerForce:
    """The force on one finger, on the time grid of its hand.

    Attributes:
        force: (n, 3) smoothed, in the fingertip frame [unit of the readings].
        known: (n,) where there are samples.
        threshold: F_a above which there is contact; None if the tare was not without contact.
        noise: standard deviation of a component of the force without contact; 0 if unknown.
        normal: (3,) of the sensor.
        period: of the grid [s].
        span: start of the first sample, and end of the last [s].
    """

    force: Array
    known: Mask
    threshold: float | None
    noise: float
    normal: Array
    period: float
    span: tuple[float, float]

    @classmethod
    def of(cls, module: Tactile, tare: Tare, grid: Array, period: float) -> "FingerForce":
        """Return the force of a module on the times `grid`, which are `period` apart [s]."""
        force = tared_force(module, tare, offline=True).force
        finite = np.isfinite(force).all(axis=1)
        times = module.times[finite]
        columns = [np.interp(grid, times, column) for column in force[finite].T]
        smooth = moving_mean(np.stack(columns, axis=1), n_samples_of(FORCE_SMOOTHING_TIME, period))
        threshold = None
        if tare.without_contact:
            threshold = contact_threshold(np.array([rest_moments(module, tare, module.rate)]))
        resting = (grid >= times[0]) & (grid < times[0] + tare.seconds)
        return cls(
            force=smooth,
            known=covered(grid, times, GAP_PERIODS * module.period),
            threshold=threshold,
            noise=float(np.sqrt(smooth[resting].var(axis=0).mean())) if resting.any() else 0.0,
            normal=module.sensor.normal,
            period=period,
            span=(float(module.times[0]), float(module.times[-1]) + module.period),
        )

    @cached_property
    def amplitude(self) -> Array:
        """(n,) F_a."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    @cached_property
    def contact(self) -> Mask:
        """(n,) where the finger is in contact; without a threshold, where it has samples."""
        if self.threshold is None:
            return self.known
        n = self._n(MIN_CONTACT_DURATION)
        touching = self.known & (self.amplitude > max(self.threshold, VISIBLE_SHARE * self._grip))
        # A released elastomer may keep a load over the threshold: a finger that was loaded, and
        # whose small force hardly changes, touches nothing any more.
        loaded = np.logical_or.accumulate(self.known & (self.amplitude > self._grip / 2))
        rate = np.abs(np.gradient(self.amplitude, self.period))
        slow = moving_mean(rate, n) < CREEP_RATE * self._grip
        creep = loaded & slow & (self.amplitude < CREEP_LEVEL * self._grip)
        return drop_short_runs(fill_short_gaps(touching & ~creep, n), n)

    @cached_property
    def evidence_threshold(self) -> float | None:
        """Threshold that the evidence of contact is measured by; None without a threshold.

        Readings that do not change in the tare have a threshold of 0, with which nothing can be
        compared. The force that is visible on a plot replaces it.
        """
        return None if self.threshold is None else self.threshold or VISIBLE_SHARE * self._grip

    @cached_property
    def _grip(self) -> float:
        """The largest F_a of the recording that lasts; a short knock does not."""
        amplitude = np.where(self.known, self.amplitude, 0.0)
        return -lowest_maximum(-amplitude, self._n(MERGE_GAP))

    def _n(self, duration: float) -> int:
        return n_samples_of(duration, self.period)

    def change(self, window: float) -> Array:
        """Return (n,) how much the force changes within a window [s] around each instant."""
        from scipy.ndimage import maximum_filter1d, minimum_filter1d

        n = self._n(window)
        span = maximum_filter1d(self.force, n, axis=0) - minimum_filter1d(self.force, n, axis=0)
        return np.asarray(np.linalg.norm(span, axis=1))


@dataclass(frozen=True, eq=False)
class HandForce:
    """The forces of all fingers on one time grid.

    Attributes:
        times: (n,) one sample period apart [s].
        period: of the grid [s].
        fingers: by name of the module.
    """

    times: Array
    period: float
    fingers: Mapping[str, FingerForce]

    @cached_property
    def n_touching(self) -> Array:
        """(n,) number of fingers in contact."""
        touching = [finger.contact for finger in self.fingers.values()]
        return np.asarray(np.sum(touching, axis=0))


def hand_force(recording: Recording, tare: TareArgument | Tare | None = None) -> HandForce:
    """Return the forces of a recording's fingers, with the tare subtracted from all samples.

    Args:
        recording: with any sensors. Modules without a finite sample in the tare are left out.
        tare: how the baseline is found; by default as `fitting_tare` chooses.

    Raises:
        RecordingError: no module has a finite sample for the tare.
        ValueError: the tare is unknown.
    """
    how = fitting_tare(recording, tare)
    period = 1 / recording.rate
    times = np.arange(recording.start, recording.end + period / 2, period)
    fingers = {
        name: FingerForce.of(module, how, times, period)
        for name, module in recording.modules.items()
        if _has_tare(module, how)
    }
    if not fingers:
        raise RecordingError(
            f"recording {recording.name!r} has no finite sample to take the tare from "
            f"({how}); give another tare"
        )
    return HandForce(times, period, fingers)


def _has_tare(module: Tactile, tare: Tare) -> bool:
    if module.n_samples < 2:
        return False
    readings = module.readings
    if tare.kind == "interval":
        readings = readings[slice(*np.searchsorted(module.times, tare.interval))]
    return len(readings) > 0 and bool(np.isfinite(readings[first_finite(readings)]).all())


def centre_of_pressure(module: Tactile, tare: TareArgument | Tare, hand: HandForce) -> Array:
    """Return the centre of pressure of a finger on the grid: taxels weighted by normal readings.

    Args:
        module: readings of the finger.
        tare: how the baseline is found.
        hand: forces of the hand.

    Returns:
        (n, 3) in the fingertip frame [m]; the mean over the recording without contact.
    """
    how = offline_tare(tare, module)
    baseline, _ = baseline_of(module.readings, module.times, how, module.period)
    normal = np.nan_to_num(np.maximum(module.readings[:, :, 2] - baseline[:, 2], 0.0))
    load = np.column_stack([normal @ module.sensor.positions, normal.sum(axis=1)])
    smooth = moving_mean(load, n_samples_of(FORCE_SMOOTHING_TIME, module.period))
    mean = load[:, :3].sum(axis=0) / max(load[:, 3].sum(), np.finfo(float).tiny)
    # A small load has no centre: it would be one of noise.
    light = smooth[:, 3] < VISIBLE_SHARE * smooth[:, 3].max()
    centre = np.where(light[:, None], mean, smooth[:, :3] / np.maximum(smooth[:, 3:], 1e-300))
    return np.stack([np.interp(hand.times, module.times, column) for column in centre.T], axis=1)


def grip_force(finger: FingerForce, mask: Mask) -> float:
    """Return the median of F_a where the mask is True and the finger is in contact; else 0."""
    touching = finger.contact & mask
    return float(np.median(finger.amplitude[touching])) if touching.any() else 0.0


def final_drop(hand: HandForce, duration: float = 0.2, factor: float = 5.0) -> int | None:
    """Return the sample at which the normal force of the whole hand drops for good; else None.

    This serves recordings that begin in contact, where no threshold of contact is known. Such a
    drop is much larger than all changes before it, and the force does not rise again.

    Args:
        hand: forces of the hand.
        duration: of the drop [s].
        factor: least ratio of the drop to the range of the force before it.
    """
    normal = np.sum([finger.force @ finger.normal for finger in hand.fingers.values()], axis=0)
    n = n_samples_of(duration, hand.period)
    if len(normal) <= 2 * n:
        return None
    fall = normal[:-n] - normal[n:]
    start = int(np.argmax(fall))
    # Before a drop the load is known for as long as the drop lasts. Its range is that between the
    # 5 % and 95 % quantiles, so that a short push does not hide the drop.
    if start < n or fall[start] <= factor * np.ptp(np.quantile(normal[:start], (0.05, 0.95))):
        return None
    # For good: the force never again rises over the middle of the fall, where the drop is placed.
    stays = normal[start + n :].max() < normal[start] - fall[start] / 2
    middle = start + int(np.argmax(normal[start:] < normal[start] - fall[start] / 2))
    return middle if stays else None


def moving_mean(values: Array, n: int) -> Array:
    """Return the mean over n samples around each one, along the first axis; ends are repeated."""
    ends = [(n // 2, n - 1 - n // 2)] + [(0, 0)] * (values.ndim - 1)
    padded = np.pad(values, ends, mode="edge")
    steps = padded[n:] - padded[:-n]
    # One value after the other, as `uniform_filter1d` of SciPy adds them: the sums are the same.
    first = np.cumsum(padded[:n], axis=0)[-1:]
    return np.asarray(np.cumsum(np.concatenate([first, steps]), axis=0) / n)


DEFAULT_TARE = Tare("seconds", 0.5)
"""Tare of a recording that begins without contact."""
FALL_OF_NOISE = 20.0
"""Least fall of the normal force below its first value, in standard deviations of its noise. With
the next one and `LOADED_SECONDS`, as live in `live/readings_monitor.py`."""
FALL_OF_RANGE = 0.1
"""Least fall below the first value as a share of the largest force; elastomers creep by less."""


def fitting_tare(recording: Recording, tare: TareArgument | Tare | None = None) -> Tare:
    """Return the given tare; without one, the tare that fits the start of the recording.

    Returns:
        The mean of the first 0.5 s, or the first sample if the recording begins in contact.

    Raises:
        ValueError: the tare is unknown.
    """
    if tare is not None:
        return Tare.parse(tare)
    return Tare("first") if evidence_of_contact(recording) else DEFAULT_TARE


def evidence_of_contact(recording: Recording) -> str:
    """Return why a recording begins in contact; empty if nothing indicates it.

    The metadata decide if they have `starts_loaded`. Otherwise the readings do: nothing pulls a
    skin, so that a normal force far below its first value was a load at the start.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> evidence_of_contact(synthetic_recording("made", seed=0))
        ''
    """
    stated = recording.metadata.get(STARTS_LOADED)
    if isinstance(stated, bool):
        return f"metadata: {STARTS_LOADED}" if stated else ""
    loaded = [name for name, module in recording.modules.items() if _falls_below_start(module)]
    return f"the normal force of {', '.join(loaded)} falls below its first value" if loaded else ""


def _falls_below_start(module: Tactile) -> bool:
    """Return whether the normal force stays far below its first value for a while."""
    try:
        force = tared_force(module, DEFAULT_TARE, offline=True).force
    except ValueError:  # no finite sample at the start
        return False
    is_finite = np.isfinite(force[:, 0])  # a row is finite or NaN
    if not is_finite.any():
        return False
    force = force if is_finite.all() else force[is_finite]
    times, normal = module.times[is_finite], force @ module.sensor.normal
    noise = float(normal[times < times[0] + DEFAULT_TARE.seconds].std())
    if noise == 0:  # a start without noise shows nothing about the load
        return False
    if normal.min() >= -FALL_OF_NOISE * noise:  # most recordings: the rest takes longer
        return False
    lasting = lowest_maximum(normal, n_samples_of(LOADED_SECONDS, module.period))
    largest = float(np.linalg.norm(force, axis=1).max())
    return bool(lasting < -max(FALL_OF_NOISE * noise, FALL_OF_RANGE * largest))


def lowest_maximum(values: Array, n: int) -> float:
    """Return the minimum over all windows of n samples of their maximum; ends are mirrored.

    Example:
        >>> lowest_maximum(np.array([3.0, 1.0, 2.0, 5.0]), 2)
        2.0
    """
    mirrored = np.pad(values, (n // 2, n - 1 - n // 2), mode="symmetric")
    return float(sliding_window_view(mirrored, n).max(axis=1).min())
