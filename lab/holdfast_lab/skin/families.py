"""Families of features for slip, computed offline from a whole recording of a finger.

They are the families A to D and W9, and second differences of taxels, over times in seconds and
relative to the load or to the noise of the finger. They serve comparisons and the choice of
features; the features of the detector are in `holdfast.features`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from holdfast.recordings import Tactile
from holdfast.sensors.types import Array

STEPS = (0.017, 0.033, 0.067, 0.133)
"""Times between the three samples of a second difference [s]."""
SKIN_LAGS = (0.017, 0.067, 0.267)
"""Lags of the changes of families B and D [s]."""
RMS_WINDOWS = (0.067, 0.267)
"""Windows of root mean squares [s]."""
CHANGE_FLOOR_SHARE = 1e-3
"""Changes below this share of the load hardly count."""
NOISE_WEIGHT, LOAD_DECAY, NOISE_BLOCK = 100.0, 5.0, 0.2
"""Noise in a load, time constant [s] of the largest load, and block of a noise [s]: as in
`kernel/motion.c`."""
LOADED_TAXEL = 0.04
"""Least share of the normal load of a taxel that counts for the largest of W9."""

Named = tuple[str, Array]


class Finger(NamedTuple):
    """Recording of a finger, in its fingertip frame and without its least load.

    Attributes:
        taxels: (n, n_taxels, 3) forces of the taxels beyond those at the least normal force.
        force: (n, 3) their sum.
        normal: (n,) the normal load, at least the noise of the force.
        along: (n, 3) unit vector of the shear, or 0.
        across: (n, 3) the shear.
        weights: (n, n_taxels) share of each taxel in the normal load.
        load: (n,) largest load of the last seconds, and 100 times the noise.
        taxel_load: (n,) the same of the root of the sum of squares over taxels.
        noise: noise of the force.
        taxel_noise: noise of all taxels together, as a root of a sum of squares.
        axis: (3,) the normal.
        positions: (n_taxels, 3) of the taxels [m].
        rate: samples per second [Hz].
    """

    taxels: Array
    force: Array
    normal: Array
    along: Array
    across: Array
    weights: Array
    load: Array
    taxel_load: Array
    noise: float
    taxel_noise: float
    axis: Array
    positions: Array
    rate: float

    def steps(self, seconds: float) -> int:
        """Return the number of samples of a time, at least one."""
        return max(1, round(seconds * self.rate))


def finger_of(module: Tactile, rate: float) -> Finger:
    """Prepare the recording of a finger.

    Args:
        module: of the finger.
        rate: samples per second [Hz].
    """
    sensor, axis = module.sensor, np.asarray(module.sensor.normal)
    turned = np.einsum("iab,kib->kia", sensor.rotations, module.readings.astype(np.float64))
    least = int((turned.sum(axis=1) @ axis).argmin())
    taxels = turned - turned[least]
    force = taxels.sum(axis=1)
    noise, taxel_noise = (_noise(values, rate) for values in (force[:, None], taxels))
    pressed = np.maximum(taxels @ axis, 0.0)
    across = force - np.outer(force @ axis, axis)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return Finger(
        taxels, force, np.maximum(force @ axis, noise),
        across / np.maximum(length, 1e-300), across,
        pressed / np.maximum(pressed.sum(axis=1, keepdims=True), 1e-300),
        _peak(np.linalg.norm(force, axis=1), rate) + NOISE_WEIGHT * noise,
        _peak(np.sqrt((taxels**2).sum(axis=(1, 2))), rate) + NOISE_WEIGHT * taxel_noise,
        noise, taxel_noise, axis, sensor.positions, rate,
    )  # fmt: skip


def _noise(values: Array, rate: float) -> float:
    """Return the least root mean square step of all values together over a block, over sqrt 2.

    Args:
        values: (n, n_values, 3).
        rate: samples per second [Hz].
    """
    squares = (np.diff(values, axis=0) ** 2).sum(axis=(1, 2))
    squares = squares[squares > 0]  # repeated samples do not count
    block = max(5, round(NOISE_BLOCK * rate))
    if len(squares) < block:
        return 1e-9
    sums = np.convolve(squares, np.full(block, 1 / block), "valid")[::block]
    return float(np.sqrt(sums.min() / 2))


def _peak(load: Array, rate: float) -> Array:
    """Return the largest load so far, which decays with a time constant."""
    age = np.arange(len(load)) / (rate * LOAD_DECAY)
    peak: Array = np.exp(np.maximum.accumulate(np.log(np.maximum(load, 1e-9)) + age) - age)
    return peak


def family_features(finger: Finger) -> dict[str, Array]:
    """Return the features of all families by name, (n,) each; NaN before their first window."""
    parts = (_levels, _changes, _roughness, _taxel_motion, _second_differences, _weighted)
    return {name: values for part in parts for name, values in part(finger)}


def _logged(values: Array) -> Array:
    return np.log(np.abs(values) + CHANGE_FLOOR_SHARE)


def _lagged(values: Array, step: int) -> Array:
    """Return the change of values over a number of samples; NaN at the start."""
    out = np.full(values.shape, np.nan)
    out[step:] = values[step:] - values[:-step]
    return out


def _second(values: Array, step: int) -> Array:
    """Return x(k) - 2 x(k - step) + x(k - 2 step); NaN at the start."""
    return _lagged(_lagged(values, step), step)


def _rms(values: Array, window: int) -> Array:
    """Return the root mean square over the last samples; NaN where one is NaN."""
    squares = np.convolve(values**2, np.full(window, 1 / window))[: len(values)]
    squares[: window - 1] = np.nan
    return np.sqrt(squares)


def _levels(finger: Finger) -> Iterator[Named]:
    """Yield family A: the load in multiples of the noise, and shear to normal load."""
    shear = np.linalg.norm(finger.across, axis=1)
    yield "A log N/noise", np.log(finger.normal / finger.noise)
    yield "A |F_t|/N", np.minimum(shear / finger.normal, 5.0)


def _changes(finger: Finger) -> Iterator[Named]:
    """Yield family B: changes of the force along the normal, the shear and across it."""
    shear = np.linalg.norm(finger.across, axis=1)
    for lag in SKIN_LAGS:
        step = finger.steps(lag)
        change = _lagged(finger.force, step)
        normal = change @ finger.axis
        along = (change * finger.along).sum(axis=1)
        rest = change - normal[:, None] * finger.axis - along[:, None] * finger.along
        title = f"[{1e3 * lag:g} ms]"
        yield f"B dF_n/L {title}", normal / finger.load
        yield f"B dF_t along t/L {title}", along / finger.load
        ratio = np.minimum(shear / finger.normal, 5.0)
        yield f"B d(|F_t|/N) {title}", _lagged(ratio, step)
        yield f"B log |dF across|/L {title}", _logged(np.linalg.norm(rest, axis=1) / finger.load)


def _roughness(finger: Finger) -> Iterator[Named]:
    """Yield family C: root mean squares of the first to third difference of the force."""
    difference = finger.force
    for order in (1, 2, 3):
        difference = _lagged(difference, 1)
        size = np.linalg.norm(difference, axis=1)
        for window in RMS_WINDOWS:
            value = _rms(size, finger.steps(window)) / finger.load
            yield f"C log d{order}F/L [{1e3 * window:g} ms]", _logged(value)


def _taxel_motion(finger: Finger) -> Iterator[Named]:
    """Yield family D: taxels against the common motion, and where the load goes."""
    size = np.sqrt((finger.positions**2).sum(axis=1).mean())
    side = (finger.positions @ finger.along.T).T
    centre = (finger.weights * side).sum(axis=1, keepdims=True)
    trailing = side < centre
    for lag in SKIN_LAGS:
        step = finger.steps(lag)
        moved, change = _lagged(finger.taxels, step), _lagged(finger.force, step)
        own = moved - finger.weights[:, :, None] * change[:, None]
        rest = np.sqrt((own**2).sum(axis=(1, 2)))
        pressed = moved @ finger.axis
        along = np.einsum("kia,ka->ki", moved, finger.along)
        against = along * np.sign((change * finger.along).sum(axis=1, keepdims=True)) < 0
        title = f"[{1e3 * lag:g} ms]"
        yield f"D log |dg - w dF|/L {title}", _logged(rest / finger.taxel_load)
        ratio = rest / (np.linalg.norm(change, axis=1) + finger.noise)
        yield f"D log |dg - w dF|/|dF| {title}", np.log(ratio + CHANGE_FLOOR_SHARE)
        yield f"D shift of centre along t {title}", _lagged(centre[:, 0] / size, step)
        yield (
            f"D load from trailing to leading {title}",
            np.where(trailing, -pressed, pressed).sum(axis=1) / finger.load,
        )
        yield (
            f"D log shear gained/L {title}",
            _logged(np.maximum(along, 0).sum(axis=1) / finger.load),
        )
        yield (
            f"D log shear lost/L {title}",
            _logged(np.maximum(-along, 0).sum(axis=1) / finger.load),
        )
        opposed = np.where(np.isnan(along), np.nan, finger.weights * against).sum(axis=1)
        yield f"D load opposed {title}", opposed


def _second_differences(finger: Finger) -> Iterator[Named]:
    """Yield second differences of all taxels together, to the load and to white noise."""
    for seconds in STEPS:
        second = _second(finger.taxels, finger.steps(seconds))
        size = np.sqrt((second**2).sum(axis=(1, 2)))
        title = f"[{1e3 * seconds:g} ms]"
        yield f"txd2 log d2g/L {title}", _logged(size / finger.taxel_load)
        yield f"txd2 log d2g/noise {title}", np.log(size / (np.sqrt(6) * finger.taxel_noise) + 0.1)


def _weighted(finger: Finger) -> Iterator[Named]:
    """Yield family W9: second differences weighted by the normal load of each taxel."""
    n_taxels = finger.taxels.shape[1]
    for seconds in (STEPS[0], STEPS[2]):
        second = _second(finger.taxels, finger.steps(seconds))
        normal = second @ finger.axis
        shear = second - normal[:, :, None] * finger.axis
        title = f"[{1e3 * seconds:g} ms]"
        squares = (second**2).sum(axis=2)
        parts = {"whole": squares, "shear": (shear**2).sum(axis=2), "normal": normal**2}
        for name, part in parts.items():
            size = np.sqrt(n_taxels * (finger.weights * part).sum(axis=1)) / finger.taxel_load
            yield f"W9 log {name}/L {title}", _logged(size)
        whole = np.sqrt(n_taxels * (finger.weights * squares).sum(axis=1)) / finger.taxel_load
        for window in RMS_WINDOWS:
            value = _rms(whole, finger.steps(window))
            yield f"W9 log rms {1e3 * window:g} ms/L {title}", _logged(value)
        loaded = np.where(finger.weights > LOADED_TAXEL, squares, 0.0)
        largest = np.sqrt(n_taxels * loaded.max(axis=1)) / finger.taxel_load
        yield f"W9 log largest/L {title}", _logged(largest)
