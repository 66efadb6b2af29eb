"""Fingertip force from taxels."""

import math

import numba
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_parallel
from holdfast.errors import RecordingError
from holdfast.features.baseline import force_of
from holdfast.features.layout import Array
from holdfast.features.tare import HALF, Tare, TareArgument
from holdfast.recordings import Tactile
from holdfast.sensors import Sensor


def fingertip_force(
    readings: npt.ArrayLike,
    sensor: Sensor,
    tare: TareArgument | Tare = 0.5,
    times: npt.ArrayLike | None = None,
) -> Array:
    """The force on a fingertip, by its taxels: F_tip(k) = sum_i R_i (f_i(k) - baseline_i).

    Args:
        readings: (n, n_taxels, 3) in taxel frames [count or N].
        sensor: whose readings they are.
        tare: the baseline: seconds from the start, "first", "none", or (start, end) [s].
        times: (n,) [s]; by default 0, 1, 2, ... over the sensor's rate.

    Returns:
        (n, 3) in the fingertip frame, in the unit of the readings; NaN until the tare is
        complete and where a reading is not finite.

    Raises:
        RecordingError: another number of taxels, axes or times.
        ValueError: an unknown tare, or an interval without samples.

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
    force = np.full((len(values), 3), np.nan)
    _forces(values[first:], baseline, sensor.rotations, force[first:])
    return force


def baseline_of(values: Array, times: Array, tare: Tare, period: float) -> tuple[Array, int]:
    """The baseline (n_taxels, 3), and the first sample that it may be used for.

    Raises:
        ValueError: no finite sample in the time that the tare takes.
    """
    if tare.kind == "none" or not (len(values) or tare.kind == "interval"):
        return np.zeros(values.shape[1:]), 0
    finite = np.isfinite(values).all(axis=(1, 2))
    start = int(finite.argmax()) if len(values) else 0
    if tare.kind == "first":
        return values[start], start
    if tare.kind == "interval":
        taken = finite & (times >= tare.interval[0]) & (times < tare.interval[1])
        first = 0
    else:
        running = times - times[start] + HALF * period < tare.seconds
        running[: start + 1] = True  # one sample at least
        taken = finite & running
        first = int(running.sum())
    if not taken.any():
        raise ValueError(f"tare {tare}: no finite sample in that time")
    return np.add.accumulate(values[taken], axis=0)[-1] / taken.sum(), first


@compiled_parallel
def _forces(values: Array, baseline: Array, rotations: Array, force: Array) -> None:
    for k in numba.prange(len(values)):
        x, y, z, _ = force_of(values[k], baseline, rotations, 0, len(baseline))
        if math.isfinite(x + y + z):
            force[k, 0], force[k, 1], force[k, 2] = x, y, z


def tare_amplitude(module: Tactile, tare: Tare, rate: float) -> Array:
    """F_a of the samples that a tare by seconds is taken from, with that very tare.

    Args:
        module: readings of a finger.
        tare: by seconds.
        rate: samples per second [Hz].

    Returns:
        (n,) what the sensor shows without contact [unit of the readings].
    """
    n_enough = int(np.searchsorted(module.times, module.times[0] + tare.seconds + 1)) + 1
    values = np.ascontiguousarray(module.readings[:n_enough], dtype=np.float64)
    baseline, first = baseline_of(values, module.times[:n_enough], tare, 1 / rate)
    force = np.full((first, 3), np.nan)
    _forces(values[:first], baseline, module.sensor.rotations, force)
    amplitude: Array = np.linalg.norm(force, axis=1)
    return amplitude[np.isfinite(amplitude)]
