"""Fingertip force of recordings: the taxel readings less the tare, rotated and summed."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError
from holdfast.features.tare import Tare, TareArgument, baseline_of, offline_tare
from holdfast.kernel.batch import fill_fingertip_force
from holdfast.recordings import Tactile
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

BLOCK_SAMPLES = 16_384
"""Samples that are converted to float64 at a time: bounds the memory of offline work."""


def fingertip_force(
    readings: npt.ArrayLike,
    sensor: Sensor,
    tare: TareArgument | Tare = 0.5,
    times: npt.ArrayLike | None = None,
) -> Array:
    """Return the force on a fingertip: F_tip(k) = sum_i R_i (f_i(k) - baseline_i).

    Args:
        readings: (n, n_taxels, 3) in taxel frames [count or N].
        sensor: the sensor that gave the readings.
        tare: how the baseline is found: seconds from the start, "first", "none", or
            (start, end) [s].
        times: (n,) [s]; by default 0, 1, 2, ... divided by the rate of the sensor.

    Returns:
        (n, 3) in the fingertip frame, in the unit of the readings. NaN until the tare is
        complete, and where a reading is not finite.

    Raises:
        RecordingError: the number of taxels, axes or times does not fit.
        ValueError: the tare is unknown, or no finite sample lies in its time.

    Example:
        >>> import numpy as np
        >>> from holdfast.sensors import sensor
        >>> pressed = np.zeros((2, 16, 3)) + np.array([[[0.0]], [[1.0]]]) * [0, 0, 2]
        >>> fingertip_force(pressed, sensor("uskin-4x4"), tare="first").tolist()
        [[0.0, 0.0, 0.0], [0.0, 0.0, 32.0]]
    """
    values = np.ascontiguousarray(readings, dtype=np.float64)
    if values.ndim != 3 or values.shape[1:] != (sensor.n_taxels, 3):
        raise RecordingError(
            f"readings of shape (n, {sensor.n_taxels}, 3) expected for {sensor.name}, "
            f"{values.shape} given"
        )
    if times is None:
        clock = np.arange(len(values)) / sensor.rate
    else:
        clock = np.asarray(times, dtype=np.float64)
    if clock.shape != (len(values),):
        raise RecordingError(f"{len(values)} samples given with times of shape {clock.shape}")
    baseline, first = baseline_of(values, clock, Tare.parse(tare), 1 / sensor.rate)
    return _forces(values, baseline, sensor, first)


class TaredForce(NamedTuple):
    """The fingertip force of a module, with the tare that was subtracted.

    Attributes:
        force: (n, 3) F_tip in the fingertip frame [unit of the readings]; NaN before `first`
            and where a reading is not finite.
        baseline: (n_taxels, 3) mean readings without contact [unit of the readings].
        first: the first sample that has a force, if its readings are finite.
    """

    force: Array
    baseline: Array
    first: int

    @property
    def amplitude(self) -> Array:
        """(n,) F_a = |F_tip| [unit of the readings]."""
        return np.asarray(np.linalg.norm(self.force, axis=1))


def tared_force(
    module: Tactile,
    tare: TareArgument | Tare = 0.5,
    rate: float | None = None,
    *,
    offline: bool = False,
) -> TaredForce:
    """Return the fingertip force of a module of a recording, and its tare.

    Readings are converted in blocks: a long module needs little memory beside its own.

    Args:
        module: the readings of a finger.
        tare: how the baseline is found.
        rate: samples per second [Hz]; by default the nominal rate of the sensor.
        offline: subtract the baseline from all samples, from those before the tare is complete
            too. A detector cannot do so.

    Raises:
        ValueError: the tare is unknown, or no finite sample lies in its time.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> module = synthetic_recording("made", seed=0).modules["index"]
        >>> found = tared_force(module, 0.5)
        >>> found.first, found.force.shape, found.baseline.shape
        (75, (1725, 3), (30, 3))
    """
    how = offline_tare(tare, module) if offline else Tare.parse(tare)
    period = 1 / (module.sensor.rate if rate is None else rate)
    baseline, first = baseline_of(module.readings, module.times, how, period)
    return TaredForce(_forces(module.readings, baseline, module.sensor, first), baseline, first)


def rest_amplitude(module: Tactile, tare: Tare, rate: float) -> Array:
    """Return F_a of the samples that a tare by seconds is taken from.

    Args:
        module: the readings of a finger.
        tare: a tare by seconds, which is subtracted.
        rate: samples per second [Hz].

    Returns:
        (n,) what the sensor reports without contact [unit of the readings]; finite samples only.

    Raises:
        ValueError: no finite sample lies in the time of the tare.
    """
    baseline, first = baseline_of(module.readings, module.times, tare, 1 / rate)
    force = _forces(module.readings[:first], baseline, module.sensor)
    amplitude: Array = np.linalg.norm(force, axis=1)
    return amplitude[np.isfinite(amplitude)]


def _forces(
    readings: npt.NDArray[np.generic], baseline: Array, sensor: Sensor, first: int = 0
) -> Array:
    """Return (n, 3) F_tip from sample `first` on; NaN before and where it is not finite."""
    force = np.full((len(readings), 3), np.nan)
    for start in range(first, len(readings), BLOCK_SAMPLES):
        block = slice(start, start + BLOCK_SAMPLES)
        values = np.ascontiguousarray(readings[block], dtype=np.float64)
        fill_fingertip_force(values, baseline, sensor.rotations, force[block])
    return force
