"""Notices about the readings of a finger: an axis missing, z inwards, drift. No clock.

These are no faults, because each can also be right: a hand may hold an object at the start.
`holdfast info` finds the same in a recording. Readings that never change are the fault `dead`.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.recordings import Recording
from holdfast.sensors import Sensor

CHECK_INTERVAL = 0.05
"""Time between the samples that are compared [s]; more would cost time and show nothing else."""
BLOCK_SECONDS = 1.0
"""Time over which a force is averaged before its drift is measured [s]."""
MIN_BLOCKS = 10
"""Blocks of a hold from which on its drift is known: a skin creeps most in the first seconds."""
HOLD_SHARE = 0.05
"""A hold goes on while the force changes by less than this share from block to block."""
START_NOISE_SECONDS = 0.5
"""Time from the start in which the noise is measured [s]."""
MOVED_SECONDS = 2.0
"""Time of changed readings after which an axis without any change is reported [s]."""
SHEAR_STEPS = 20
"""Steps of the sensor that a taxel must have changed, too: the shear of less rounds to zero."""
PULL_SECONDS = 0.25
"""Minimum time for which the normal force is below its first value [s]. This and the next two are
those of the fault `tare_loaded` (`kernel/faults.c`) and of labels (`labelling/rules/forces.py`)."""
PULL_OF_NOISE = 20.0
"""Least fall below the first value, in standard deviations of its noise."""
PULL_OF_LARGEST = 0.1
"""Least fall below the first value, as a share of the largest change; elastomers creep by less."""
DRIFT_SECONDS = 60.0
"""Duration of a hold from which on its drift is reported [s]."""
DRIFT_SHARE = 0.05
"""Least drift within a minute that is reported, as a share of the load."""

MISSING_AXES = "readings along {} never change: 3 axes are expected, and slip shows in the shear"
DRIFTS = (
    "the force of this hold drifts by {:.3g} {} a minute, by warming or creep: take a new tare "
    "when the hand is open"
)
PULLED = (
    "the normal force fell far below its first value: the finger was in contact at the start, or "
    "z of the sensor points inwards (docs/sensors.md)"
)


class ReadingsMonitor:
    """Comparison of the readings of each finger with its first ones. Each notice comes once.

    Args:
        fingers: sensor of each finger.
        finds_pull: report a normal force below its first value. A model whose tare takes time
            reports it as the fault `tare_loaded`.

    Example:
        >>> from holdfast.sensors import sensor
        >>> monitor = ReadingsMonitor({"index": sensor("uskin-4x4")})
        >>> for time in np.arange(0, 12, 0.01):
        ...     for notice in monitor.update({"index": np.full((16, 3), [0, 0, time])}, time):
        ...         print(notice[:48])
        index: readings along x and y never change: 3 ax
    """

    def __init__(self, fingers: Mapping[str, Sensor], *, finds_pull: bool = True) -> None:
        self._fingers = {
            name: _FingerReadings(sensor, finds_pull) for name, sensor in fingers.items()
        }

    def update(self, samples: Mapping[str, npt.NDArray[Any]], time: float) -> list[str]:
        """Look at samples, (n_taxels, 3) by finger, of a time [s]; return new notices."""
        return [
            f"{name}: {text}"
            for name, readings in samples.items()
            for text in self._fingers[name].update(readings, time)
        ]

    def update_recording(self, part: Recording) -> list[str]:
        """Look at the next part of a recording; return new notices."""
        notices: list[str] = []
        for name in self._fingers.keys() & part.modules.keys():
            module = part.modules[name]
            stride = max(1, int(CHECK_INTERVAL * module.rate)) if module.n_samples > 1 else 1
            for k in range(0, module.n_samples, stride):
                notices += self.update({name: module.readings[k]}, float(module.times[k]))
        return notices


class HoldDrift:
    """Drift of the force of a module in its longest hold so far: creep, or warming.

    Attributes:
        per_minute: change of the force's amplitude [unit of the readings / min]; NaN without a
            hold of ten seconds.
        seconds: duration of that hold [s].
        load: amplitude of the force at its beginning [unit of the readings].

    Example:
        >>> drift = HoldDrift()
        >>> for time in np.arange(0, 30, 0.05):
        ...     drift.update(np.array([0.0, 0.0, 100.0 + 0.5 * time]), time)
        >>> round(drift.per_minute, 3), drift.seconds
        (30.0, 29.0)
    """

    def __init__(self) -> None:
        self.per_minute, self.seconds, self.load = math.nan, 0.0, 0.0
        self._start, self._sum, self._n = -math.inf, np.zeros(3), 0
        self._first = self._last = 0.0  # amplitudes of the first and of the newest block
        self._n_blocks, self._moments = 0, np.zeros(3)  # sums of k, of a and of k a

    def update(self, force: npt.NDArray[np.float64], time: float) -> None:
        """Add a force (3,) since the start [unit of the readings], of a time [s]."""
        if not self._n or not 0 <= time - self._start < 2 * BLOCK_SECONDS:
            self._start, self._sum, self._n, self._n_blocks = time, np.zeros(3), 0, 0
        if time - self._start >= BLOCK_SECONDS:
            amplitude = float(np.linalg.norm(self._sum / self._n))
            # A larger change is a new grip, whose drift begins anew.
            if self._n_blocks and abs(amplitude - self._last) > HOLD_SHARE * self._last:
                self._n_blocks = 0
            if not self._n_blocks:
                self._first, self._moments = amplitude, np.zeros(3)
            k, self._last = self._n_blocks, amplitude
            self._moments += (k, amplitude, k * amplitude)
            self._n_blocks = n = k + 1
            if n >= MIN_BLOCKS and n * BLOCK_SECONDS > self.seconds:
                # Least squares: (n sum k a - sum k sum a) / (n sum k^2 - (sum k)^2).
                sum_k, sum_a, sum_ka = self._moments
                slope = (n * sum_ka - sum_k * sum_a) / (n * n * (n * n - 1) / 12)
                self.per_minute = float(slope) * 60 / BLOCK_SECONDS
                self.seconds, self.load = n * BLOCK_SECONDS, self._first
            self._start, self._sum, self._n = time, np.zeros(3), 0
        self._sum, self._n = self._sum + force, self._n + 1


class _FingerReadings:
    """Memory of the readings of one finger."""

    def __init__(self, sensor: Sensor, finds_pull: bool) -> None:
        self._sensor = sensor
        # The normal force is one sum over readings: the normal, turned into each taxel's frame.
        self._weights = np.einsum("j,ijk->ik", sensor.normal, sensor.rotations)
        self._finds_pull = finds_pull
        self._least_change = SHEAR_STEPS * (sensor.step or 0.0)
        self._first: npt.NDArray[Any] | None = None
        self._start = self._last = -math.inf
        # All below is relative to the first readings, and `update` alone changes it: which axes
        # have ever changed, how many samples have by enough, and the normal force with its noise
        # at rest.
        self._moved = np.zeros(3, dtype=bool)
        self._n_moved = 0
        self._rest: list[float] = []
        self._noise = 0.0
        self._largest = 0.0
        self._pulled_since = math.inf
        self._drift = HoldDrift()
        self._reported: set[str] = set()

    def update(self, readings: npt.NDArray[Any], time: float) -> list[str]:
        """Look at the readings (n_taxels, 3) of a time [s], and return new notices."""
        if time - self._last < CHECK_INTERVAL or not np.isfinite(readings).all():
            return []
        self._last = time
        if self._first is None:
            self._first, self._start = np.array(readings, dtype=np.float64), time
            return []
        change = readings - self._first
        moved = (change != 0).any(axis=0)
        self._moved |= moved
        self._n_moved += bool(np.abs(change).max() > self._least_change)
        self._drift.update(np.einsum("ijk,ik->j", self._sensor.rotations, change), time)
        notices = self._drifting()
        if not self._moved.all() and self._n_moved * CHECK_INTERVAL >= MOVED_SECONDS:
            axes = [
                axis for axis, has_moved in zip("xyz", self._moved, strict=True) if not has_moved
            ]
            notices.append(MISSING_AXES.format(" and ".join(axes)))
        normal = float((self._weights * change).sum())
        self._largest = max(self._largest, abs(normal))
        if time - self._start <= START_NOISE_SECONDS:
            self._rest.append(normal)
            self._noise = float(np.std(self._rest))
        # Noise alone passes no limit of 20 deviations; a share of the largest change leaves out
        # the creep of an elastomer after a strong press.
        limit = max(PULL_OF_NOISE * self._noise, PULL_OF_LARGEST * self._largest)
        if not self._finds_pull or normal >= -limit:
            self._pulled_since = math.inf
        else:
            self._pulled_since = min(self._pulled_since, time)
            if time - self._pulled_since >= PULL_SECONDS:
                notices.append(PULLED)
        new = [text for text in notices if text not in self._reported]
        self._reported.update(new)
        return new

    def _drifting(self) -> list[str]:
        """Return a notice if the force of a long hold drifts."""
        drift = self._drift
        if DRIFTS in self._reported or drift.seconds < DRIFT_SECONDS:
            return []
        if abs(drift.per_minute) < max(DRIFT_SHARE * drift.load, PULL_OF_NOISE * self._noise):
            return []
        self._reported.add(DRIFTS)  # once, as the numbers in the text change
        return [DRIFTS.format(drift.per_minute, self._sensor.unit)]
