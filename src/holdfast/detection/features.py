"""Fingertip force and features of whole arrays and of recordings."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.detection.kernel_config import packed, stream_config
from holdfast.detection.plan import StreamPlan, Tare, TareArgument, baseline_of, offline_tare
from holdfast.detection.specs import DEFAULT_WINDOW, check_window
from holdfast.errors import RecordingError, require_extras
from holdfast.kernel import _extension
from holdfast.kernel.batch import fill_fingertip_force, fill_haar_features
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array, Integers

if TYPE_CHECKING:
    from pandas import DataFrame

FEATURE_NAMES = ("F_a", "F_x", "F_y", "F_z", "m", "sigma")
"""The paper's features, in the order of the columns of `haar_features`."""


def haar_features(force: npt.ArrayLike, window: int = DEFAULT_WINDOW) -> npt.NDArray[np.float64]:
    r"""Return the paper's six features of a fingertip force, at every sample.

    They are the amplitude F_a = |F_tip|, the three components, and two values from the Haar
    transform of F_a over the window that ends at the sample: the moving average m of the
    approximations (equation 1) and the standard deviation sigma of the details (equation 2).

        a = (x_0 + x_1) / sqrt(2),        d = (x_0 - x_1) / sqrt(2)
        m = sum(a) / N_w,                 sigma = sqrt(sum((d - mean(d))^2) / N_w)

    Args:
        force: (n, 3) fingertip force [count or N]. Windows with a row that is not finite have
            no features.
        window: N_w, number of samples in the window; even, at least 2.

    Returns:
        (n, 6) float64 in the order of `FEATURE_NAMES`; rows without a full window are NaN.

    Raises:
        ValueError: the window is odd or under 2, or the force has another shape.

    Example:
        >>> force = np.array([[3.0, 4.0, 0.0], [6.0, 8.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 0.0]])
        >>> haar_features(force, window=4)[-1].round(3).tolist()
        [5.0, 3.0, 4.0, 0.0, 4.419, 1.25]
    """
    n_window = check_window(window)
    values = np.ascontiguousarray(force, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != 3:
        raise ValueError(f"a force of shape (n, 3) expected, {values.shape} given")
    out = np.empty((len(values), len(FEATURE_NAMES)))
    fill_haar_features(values, n_window, out)
    return out


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


def stretch_features(
    module: Tactile, force: Array, window: int = DEFAULT_WINDOW
) -> tuple[Array, Integers]:
    """Return the paper's features of a module, without windows across its gaps.

    Args:
        module: whose times have the gaps.
        force: (n, 3) F_tip of its samples [unit of the readings].
        window: N_w [samples].

    Returns:
        (n, 6) features in the order of `FEATURE_NAMES`, NaN without a full window; and the
        indices of the first sample after each gap.
    """
    gaps = np.flatnonzero(np.diff(module.times) > GAP_PERIODS * module.period) + 1
    # A window across a gap has no sigma: a sample of NaN stands in the gap, and is taken out again.
    features = haar_features(np.insert(force, gaps, np.nan, axis=0), window)
    return np.delete(features, gaps + np.arange(len(gaps)), axis=0), gaps


def features_frame(
    recording: Recording, window: int = DEFAULT_WINDOW, tare: TareArgument | Tare = 0.5
) -> "DataFrame":
    """Return the paper's features of a recording as a pandas DataFrame.

    Args:
        recording: of which all modules with samples are in the frame.
        window: N_w, number of samples in the window; even, at least 2.
        tare: how the baseline of each module is found, see `fingertip_force`.

    Returns:
        A row for each finger and sample, in the order of time: `time` [s], `finger`, and the
        columns `FEATURE_NAMES` [unit of the readings], NaN without a full window.

    Raises:
        MissingExtra: pandas is not installed.
        ValueError: the window or the tare is invalid, or no finite sample lies in its time.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> frame = features_frame(synthetic_recording("made", seed=0))
        >>> list(frame.columns), len(frame)
        (['time', 'finger', 'F_a', 'F_x', 'F_y', 'F_z', 'm', 'sigma'], 5175)
    """
    require_extras("pandas")
    import pandas as pd

    parts = []
    for finger, module in recording.modules.items():
        if module.n_samples:
            features, _ = stretch_features(module, tared_force(module, tare).force, window)
            part = pd.DataFrame(features, columns=list(FEATURE_NAMES))
            part.insert(0, "time", module.times)
            part.insert(1, "finger", finger)
            parts.append(part)
    return pd.concat(parts).sort_values("time", kind="stable", ignore_index=True)


class FingerFeatures(NamedTuple):
    """Features of one finger over a recording.

    Attributes:
        features: (n, n_features); NaN where there are none.
        amplitude: (n,) F_a [unit of the readings]; NaN where there is no force.
    """

    features: Array
    amplitude: Array


def extract(plan: StreamPlan, recording: Recording) -> dict[str, FingerFeatures]:
    """Return the features of every finger of the plan, at each of its samples.

    Args:
        plan: fingers, features, tare and rate.
        recording: that has all fingers of the plan.

    Returns:
        By finger, one row for each sample of its module.

    Raises:
        ValueError: a tare by interval finds no samples.
    """
    plan = plan.for_recording(recording)
    kernel = _extension.Stream(*packed(stream_config(plan)), plan.baseline.tobytes())
    chunks: dict[str, list[FingerFeatures]] = {finger: [] for finger in plan.fingers}
    for times, present, readings in plan.samples_of(recording):
        features = np.full((*present.shape, plan.width), np.nan)
        amplitude = np.full(present.shape, np.nan)
        kernel.advance(readings, present, times, features, amplitude)
        for index, finger in enumerate(plan.fingers):
            rows, n_features = present[:, index], len(plan.features[finger])
            chunks[finger].append(
                FingerFeatures(features[rows, index, :n_features], amplitude[rows, index])
            )
    return {
        finger: FingerFeatures(*map(np.concatenate, zip(*parts, strict=True)))
        for finger, parts in chunks.items()
    }
