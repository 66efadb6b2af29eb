"""What every method starts from: tared readings and forces of a hand, on its way to features."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from holdfast.features import Tare
from holdfast.features.force import fingertip_force
from holdfast.features.kernel import GAP_LIMIT_PERIODS
from holdfast.features.tare import baseline_of
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

NEWTONS_PER_COUNT = 0.000729
"""Of a uSkin taxel along its normal, by the data sheet of the uSPa46 [N/count]."""


@dataclass(frozen=True, eq=False)
class FingerSignal:
    """One finger over one recording.

    Attributes:
        sensor: of the finger.
        times: (n,) [s].
        readings: (n, n_taxels, 3) in taxel frames, less the tare [unit of the readings].
        force: (n, 3) F_tip [unit of the readings]; NaN until the tare is complete and where a
            reading is not finite.
        rate: samples per second [Hz].
    """

    sensor: Sensor
    times: Array
    readings: Array
    force: Array
    rate: float

    @property
    def amplitude(self) -> Array:
        """(n,) F_a."""
        return np.asarray(np.linalg.norm(self.force, axis=1))

    @property
    def pressing(self) -> Array:
        """(n,) the force along the normal of the fingertip, the paper's F_x."""
        return np.asarray(self.force @ self.sensor.normal)

    @property
    def normal(self) -> Array:
        """(n,) its size, |F_n|."""
        return np.abs(self.pressing)

    @property
    def tangential(self) -> Array:
        """(n,) size of the rest of the force, |F_t|."""
        normal = self.sensor.normal
        rest = self.force - np.outer(self.force @ normal, normal)
        return np.asarray(np.linalg.norm(rest, axis=1))

    @property
    def newton(self) -> float:
        """What a newton is in the unit of the readings; nominal where they are counts.

        No method needs it but to port a published figure in newtons. Counts are taken for those
        of a uSkin, whatever the sensor: of most others nothing is published.
        """
        return 1.0 if self.sensor.unit == "N" else 1.0 / NEWTONS_PER_COUNT

    @cached_property
    def stretches(self) -> tuple[slice, ...]:
        """The unbroken stretches: no gap longer than 3 sample periods, every force known."""
        known = np.isfinite(self.force.sum(axis=1))
        broken = np.diff(self.times) > GAP_LIMIT_PERIODS / self.rate
        edges = np.flatnonzero(broken | (known[1:] != known[:-1])) + 1
        bounds = [0, *edges.tolist(), len(known)]
        return tuple(slice(a, b) for a, b in pairwise(bounds) if b > a and known[a])

    def cut(self, rows: slice) -> "FingerSignal":
        """The signal of some samples."""
        return FingerSignal(
            self.sensor, self.times[rows], self.readings[rows], self.force[rows], self.rate
        )


@dataclass(frozen=True, eq=False)
class HandSignal:
    """All fingers of one recording that a method looks at.

    Attributes:
        recording: that they come from.
        tare: how the baseline was found.
        fingers: by name.
    """

    recording: Recording
    tare: Tare
    fingers: Mapping[str, FingerSignal]

    @property
    def rate(self) -> float:
        """Samples per second [Hz]."""
        return self.recording.rate

    def each_stretch(self, name: str) -> Iterator[tuple[slice, FingerSignal]]:
        """The unbroken stretches of a finger: which samples, and their signal."""
        finger = self.fingers[name]
        for rows in finger.stretches:
            yield rows, finger.cut(rows)


def hand_signal(
    recording: Recording, tare: Tare, fingers: tuple[str, ...] | None = None
) -> HandSignal:
    """The signal of a recording's labelled fingers, or of those named.

    Args:
        recording: of any sensors.
        tare: how the baseline is found.
        fingers: by default those that have labels.
    """
    names = fingers or tuple(name for name, module in recording.modules.items() if module.labels)
    signals = {name: _finger(recording.modules[name], tare, recording.rate) for name in names}
    return HandSignal(recording, tare, signals)


def stretchwise(hand: HandSignal, function: Callable[[FingerSignal], Array]) -> dict[str, Array]:
    """The features of every finger by a function of one unbroken stretch; NaN elsewhere.

    Args:
        hand: whose fingers.
        function: from a signal of n samples to (n, n_features); n may be 0, which tells the
            width of a finger that has no stretch.
    """
    found = {}
    for name, finger in hand.fingers.items():
        width = function(finger.cut(slice(0, 0))).shape[1]
        features = np.full((len(finger.times), width), np.nan)
        for rows, piece in hand.each_stretch(name):
            features[rows] = function(piece)
        found[name] = features
    return found


def windowed(values: Array, window: int, function: Callable[[Array], Array]) -> Array:
    """A function of the window that ends at each sample; NaN where it is not full.

    Args:
        values: (n, ...) of one unbroken stretch.
        window: samples in it.
        function: from (m, ..., window) windows, oldest sample first, to (m, n_features); m may
            be 0.

    Returns:
        (n, n_features).
    """
    padding = np.zeros((max(window - len(values), 0), *values.shape[1:]))
    windows = sliding_window_view(np.concatenate([padding, values]), window, axis=0)
    found = function(windows[len(padding) > 0 :])
    empty = np.full((len(values) - len(found), found.shape[1]), np.nan)
    return np.concatenate([empty, found])


def _finger(module: Tactile, tare: Tare, rate: float) -> FingerSignal:
    readings = np.ascontiguousarray(module.readings, dtype=np.float64)
    baseline, _ = baseline_of(readings, module.times, tare, 1 / rate)
    force = fingertip_force(readings, module.sensor, tare, module.times)
    return FingerSignal(module.sensor, module.times, readings - baseline, force, rate)
