"""What the readings show about the sensor, as notices: dead, an axis missing, z inwards. No clock.

Drift, copies and cross-talk, too. These are no faults, because each can also be right: a sensor
with a dead band is still at rest, and a hand may hold an object at the start. `holdfast info` finds
the same in a recording.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.live.module_checks import CHECK_INTERVAL, HoldDrift, ModuleComparison
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

START_NOISE_SECONDS = 0.5
"""Time from the start in which the noise is measured [s]."""
STILL_SECONDS = 10.0
"""Time without any change from the start on after which a finger is reported [s]."""
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

NO_CHANGE = (
    "no reading has changed since the start: touch the sensor; if that changes none, check it"
)
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
        ...     for notice in monitor.update({"index": np.zeros((16, 3))}, time):
        ...         print(notice[:48])
        index: no reading has changed since the start: t
    """

    def __init__(self, fingers: Mapping[str, Sensor], *, finds_pull: bool = True) -> None:
        self._fingers = {
            name: _FingerReadings(sensor, finds_pull) for name, sensor in fingers.items()
        }
        self._comparison = ModuleComparison()
        self._latest: dict[str, npt.NDArray[Any]] = {}
        self._instant = -math.inf

    def update(self, samples: Mapping[str, npt.NDArray[Any]], time: float) -> list[str]:
        """Look at samples, (n_taxels, 3) by finger, of a time [s]; return new notices."""
        notices = [
            f"{name}: {text}"
            for name, readings in samples.items()
            for text in self._fingers[name].update(readings, time)
        ]
        if len(self._fingers) > 1:
            # Modules of one instant may come one by one: the instant before is complete.
            if time != self._instant and self._comparison.is_due(self._instant):
                alike = self._comparison.update(self._latest, self._instant)
                notices += [f"{each.module} {each.text}" for each in alike]
            self._latest = dict(samples) if time != self._instant else self._latest | dict(samples)
            self._instant = time
        return notices

    def update_recording(self, part: Recording) -> list[str]:
        """Look at the next part of a recording; return new notices."""
        alike = self._comparison.update_recording(part)
        notices = [f"{each.module} {each.text}" for each in alike]
        for name in self._fingers.keys() & part.modules.keys():
            module = part.modules[name]
            stride = max(1, int(CHECK_INTERVAL * module.rate)) if module.n_samples > 1 else 1
            for k in range(0, module.n_samples, stride):
                notices += [
                    f"{name}: {text}"
                    for text in self._fingers[name].update(
                        module.readings[k], float(module.times[k])
                    )
                ]
        return notices


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
        found = self._drifting()
        if not self._moved.any():
            if time - self._start >= STILL_SECONDS:
                found.append(NO_CHANGE)
        elif not self._moved.all() and self._n_moved * CHECK_INTERVAL >= MOVED_SECONDS:
            axes = [axis for axis, known in zip("xyz", self._moved, strict=True) if not known]
            found.append(MISSING_AXES.format(" and ".join(axes)))
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
                found.append(PULLED)
        new = [text for text in found if text not in self._reported]
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
