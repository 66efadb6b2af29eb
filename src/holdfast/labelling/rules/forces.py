"""The forces of a hand's fingers on one grid of time, and where each of them touches."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from holdfast.contact import MERGE_GAP, MIN_CONTACT_DURATION
from holdfast.errors import RecordingError
from holdfast.features import Tare, fingertip_force
from holdfast.features.tare import TareArgument, baseline_of
from holdfast.metrics.masks import Mask, covered, drop_short_runs, fill_short_gaps, n_samples_of
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.types import Array
from holdfast.training.design import contact_threshold, rest_moments

SMOOTHING = 0.05
"""Over which the force is averaged before anything is read off it [s]: its noise goes, a push,
which lasts 0.2 s and more, stays."""
SEEN = 0.02
"""Share of the grip that a person sees on a plot of the recording: less is neither contact, for
baselines drift, nor a change."""
CREEP_LEVEL = 0.2
"""An elastomer that is let go keeps a part of its load and gives it back slowly. Below this
share of the grip..."""
CREEP_RATE = 0.1
"""...a force that changes by less than this share of the grip in a second is creep [1/s]."""


@dataclass(frozen=True, eq=False)
class FingerForce:
    """The force on one finger, on the grid of its hand.

    Attributes:
        force: (n, 3) smoothed, in the finger's frame [unit of the readings].
        known: (n,) where there are samples.
        threshold: F_a from which on there is contact; None where the tare tells nothing of it.
        noise: standard deviation of a component of the force without contact; 0 if unknown.
        normal: (3,) of the sensor.
        period: of the grid [s].
        span: first instant and the first after the last [s].
    """

    force: Array
    known: Mask
    threshold: float | None
    noise: float
    normal: Array
    period: float
    span: tuple[float, float]

    @cached_property
    def amplitude(self) -> Array:
        """(n,) F_a."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    @cached_property
    def contact(self) -> Mask:
        """(n,) where it touches; wherever it has samples, if the tare tells nothing of it."""
        if self.threshold is None:
            return self.known
        touching = self.known & (self.amplitude > max(self.threshold, SEEN * self._grip))
        n = self._n(MIN_CONTACT_DURATION)
        return drop_short_runs(fill_short_gaps(touching & ~self._creep(), n), n)

    @cached_property
    def _grip(self) -> float:
        """The largest F_a that lasts, in the whole recording: a knock does not."""
        lasting = minimum_filter1d(np.where(self.known, self.amplitude, 0.0), self._n(MERGE_GAP))
        return float(lasting.max())

    def _n(self, duration: float) -> int:
        return n_samples_of(duration, self.period)

    def _creep(self) -> Mask:
        """Where a finger that was loaded only gives back what its skin kept."""
        loaded = np.logical_or.accumulate(self.known & (self.amplitude > self._grip / 2))
        rate = np.abs(np.gradient(self.amplitude, self.period))
        slow = _moving_mean(rate, self._n(MIN_CONTACT_DURATION)) < CREEP_RATE * self._grip
        return np.asarray(loaded & slow & (self.amplitude < CREEP_LEVEL * self._grip))

    def change(self, window: float) -> Array:
        """(n,) by how much the force changes within a window about each instant."""
        n = self._n(window)
        span = maximum_filter1d(self.force, n, axis=0) - minimum_filter1d(self.force, n, axis=0)
        return np.asarray(np.linalg.norm(span, axis=1))


@dataclass(frozen=True, eq=False)
class HandForce:
    """The forces of all fingers on one grid.

    Attributes:
        times: (n,) a sample period apart [s].
        period: of the grid [s].
        fingers: by name of the module.
    """

    times: Array
    period: float
    fingers: Mapping[str, FingerForce]

    @cached_property
    def n_touching(self) -> Array:
        """(n,) how many fingers touch."""
        touching = [finger.contact for finger in self.fingers.values()]
        return np.asarray(np.sum(touching, axis=0))


def hand_force(recording: Recording, tare: TareArgument | Tare = 0.5) -> HandForce:
    """The forces of a recording's fingers, offline: the tare counts for the time before it too.

    Args:
        recording: of any sensors; modules that say nothing are left out.
        tare: how the baseline is found.

    Raises:
        RecordingError: no module has a finite sample to take the tare from.
        ValueError: an unknown tare.
    """
    how = Tare.parse(tare)
    period = 1 / recording.rate
    times = np.arange(recording.start, recording.end + period / 2, period)
    fingers = {
        name: _finger(module, how, times, period)
        for name, module in recording.modules.items()
        if _speaks(module, how)
    }
    if not fingers:
        raise RecordingError(
            f"recording {recording.name!r} has no finite sample to take the tare from "
            f"({how}); give another tare"
        )
    return HandForce(times, period, fingers)


def _speaks(module: Tactile, tare: Tare) -> bool:
    if module.n_samples < 2:
        return False
    finite = np.isfinite(module.readings).all(axis=(1, 2))
    if tare.kind == "interval":
        finite &= (module.times >= tare.interval[0]) & (module.times < tare.interval[1])
    return bool(finite.any())


def _finger(module: Tactile, tare: Tare, grid: Array, period: float) -> FingerForce:
    force = fingertip_force(module.readings, module.sensor, _offline(tare, module), module.times)
    finite = np.isfinite(force).all(axis=1)
    times = module.times[finite]
    columns = [np.interp(grid, times, column) for column in force[finite].T]
    smooth = _moving_mean(np.stack(columns, axis=1), n_samples_of(SMOOTHING, period))
    resting = (grid >= times[0]) & (grid < times[0] + tare.seconds)
    return FingerForce(
        force=smooth,
        known=covered(grid, times, GAP_PERIODS * module.period),
        threshold=_threshold(module, tare),
        noise=float(np.sqrt(smooth[resting].var(axis=0).mean())) if resting.any() else 0.0,
        normal=module.sensor.normal,
        period=period,
        span=(float(module.times[0]), float(module.times[-1]) + module.period),
    )


def _offline(tare: Tare, module: Tactile) -> Tare:
    """The same baseline for all samples, those that it is taken from among them."""
    if not tare.without_contact:
        return tare
    finite = np.isfinite(module.readings).all(axis=(1, 2))
    start = float(module.times[int(finite.argmax())])
    return Tare("interval", interval=(start, start + max(tare.seconds, module.period / 2)))


def _threshold(module: Tactile, tare: Tare) -> float | None:
    if not tare.without_contact:
        return None
    return contact_threshold(np.array([rest_moments(module, tare, module.rate)]))


def pressed_at(module: Tactile, tare: TareArgument | Tare, hand: HandForce) -> Array:
    """The centre of pressure of a finger on the grid: its taxels by what presses on them.

    Args:
        module: readings of the finger.
        tare: how the baseline is found.
        hand: its forces.

    Returns:
        (n, 3) in the finger's frame [m]; the mean over the recording where nothing presses.
    """
    baseline, _ = baseline_of(
        np.asarray(module.readings, dtype=np.float64), module.times,
        _offline(Tare.parse(tare), module), module.period,
    )  # fmt: skip
    pressing = np.nan_to_num(np.maximum(module.readings[:, :, 2] - baseline[:, 2], 0.0))
    load = np.column_stack([pressing @ module.sensor.positions, pressing.sum(axis=1)])
    smooth = _moving_mean(load, n_samples_of(SMOOTHING, module.period))
    mean = load[:, :3].sum(axis=0) / max(load[:, 3].sum(), np.finfo(float).tiny)
    light = smooth[:, 3] < SEEN * smooth[:, 3].max()
    place = np.where(light[:, None], mean, smooth[:, :3] / np.maximum(smooth[:, 3:], 1e-300))
    return np.stack([np.interp(hand.times, module.times, column) for column in place.T], axis=1)


def grip(finger: FingerForce, mask: Mask) -> float:
    """The finger's usual force in a stretch: the median of F_a where it touches."""
    touching = finger.contact & mask
    return float(np.median(finger.amplitude[touching])) if touching.any() else 0.0


def lost_at(hand: HandForce, jump: float = 0.2, times_over: float = 5.0) -> int | None:
    """The place where the whole hand's normal force drops for good, where it does.

    For recordings that begin in contact, where no force tells what none is: it drops within
    `jump` by many times what it changed by before, and does not come back.

    Args:
        hand: its forces.
        jump: in which it drops [s].
        times_over: how often the spread of the force before.
    """
    pressing = np.sum([each.force @ each.normal for each in hand.fingers.values()], axis=0)
    n = n_samples_of(jump, hand.period)
    if len(pressing) <= 2 * n:
        return None
    fall = pressing[:-n] - pressing[n:]
    start = int(np.argmax(fall))
    if start < n or fall[start] <= times_over * np.ptp(np.quantile(pressing[:start], (0.05, 0.95))):
        return None
    stays = pressing[start + n :].max() < pressing[start] - fall[start] / 2
    middle = start + int(np.argmax(pressing[start:] < pressing[start] - fall[start] / 2))
    return middle if stays else None


def _moving_mean(values: Array, n: int) -> Array:
    """Return the mean over n samples around each one, along the first axis."""
    return np.asarray(uniform_filter1d(values, n, axis=0, mode="nearest"))
