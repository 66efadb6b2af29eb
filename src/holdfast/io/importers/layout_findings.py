"""Find wrong layouts of readings: signs, units, sentinels and axes that cannot be true.

`import`, `info` and `doctor` use it. The kernel finds faults of single samples.
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Sensor, taxel_numbers
from holdfast.sensors.types import Array

SENTINELS = (65535.0, -1.0, -9999.0)
"""Numbers that loggers write in place of a reading."""
MIN_SAMPLES = 20
"""Number of samples from which on readings say something of their layout."""
MIN_SHARE = 0.001
"""Share of readings that a sentinel has at least."""
ZEROS_SHARE = 0.1
"""Share of samples at which the readings become zero or come back from it."""
MAX_TAXEL_FORCE = 100.0
"""Force on one taxel above which the unit of the readings is in doubt [N]."""
MIN_RANGE = 1e-3
"""Share of the range of a device that its readings span at least, if they are in counts."""
GRAVITY = {"N": (9.81, 1.0), "count": (16384.0, 8192.0, 4096.0, 1000.0)}
"""Length of the vector of an accelerometer at rest, by the unit of the readings."""
GRAVITY_TOLERANCE = 0.03
"""Relative deviation of such a vector, in its mean and in its spread."""
TURNED_SHARE = 0.5
"""Share of the largest change of z that z of a turned taxel falls at least."""


LayoutKind = Literal[
    "unit", "sentinel", "zeros", "unsigned", "wraps", "gravity", "angle", "norm", "turned"
]  # fmt: skip


class LayoutFinding(NamedTuple):
    """A property of readings that their layout explains.

    Attributes:
        kind: what was found.
        text: what was found, and what follows from it, in one line.
        option: field of `Columns` and its value, as `wrap=65536`, that mends it; empty without.
        stops: whether it makes every state wrong.
    """

    kind: LayoutKind
    text: str
    option: str = ""
    stops: bool = False

    @property
    def advice(self) -> str:
        """The finding with the option of an import that mends it."""
        what, _, value = self.option.partition("=")
        option = f"--{what} {value}" if what == "unit" else f"--columns {self.option}"
        return f"{self.text}; import it with {option}" if value else self.text


def layout_findings(
    readings: npt.NDArray[np.generic], skin: Sensor, unit: str | None = None
) -> list[LayoutFinding]:
    """Return the findings about readings (n, n_taxels, 3) of a sensor, in its unit or another.

    Example:
        >>> from holdfast.sensors import flat_sensor
        >>> counts = np.random.default_rng(0).integers(-9, 10, (100, 4, 3)) % 65536
        >>> [finding.option for finding in layout_findings(counts, flat_sensor("a", 2, 2, 1e-3))]
        ['wrap=65536']
    """
    values = np.asarray(readings, dtype=np.float64)
    if len(values) < MIN_SAMPLES or not np.isfinite(values).any():
        return []
    if first := next(_sentinels(values, skin), None):
        return [first]  # it hides all others
    values = filled(values)
    unit = unit or skin.unit
    return [*_wraps(values), *_units(values, skin, unit), *_quantities(values, skin, unit)]


def _sentinels(values: Array, skin: Sensor) -> Iterator[LayoutFinding]:
    for number in SENTINELS:
        is_missing = (values == number).all(axis=2)
        others = values[~is_missing]
        near = np.abs(others - number) <= 2
        if is_missing.mean() >= MIN_SHARE and len(others) and near.mean() < MIN_SHARE:
            text = f"{100 * is_missing.mean():.2g} % of the readings are {number:g} in all axes, "
            text += "which stands for a missing reading"
            yield LayoutFinding("sentinel", text, f"missing={number:g}", stops=True)
    zero = (values == 0).all(axis=(1, 2))
    n_changes = np.count_nonzero(zero[1:] != zero[:-1])
    if n_changes > ZEROS_SHARE * len(values) and not skin.rests_at_zero and not zero.all():
        kept = values[~zero]
        steps = np.abs(np.diff(kept, axis=0))
        # Zeros between readings that are far from zero are no rest.
        if np.median(np.abs(kept)) > 10 * np.median(steps):
            text = f"{100 * zero.mean():.3g} % of the samples are zero in all taxels, between "
            text += "others that are not: the sensor was read before it was ready"
            yield LayoutFinding("zeros", text, "missing=0", stops=True)


def _wraps(values: Array) -> Iterator[LayoutFinding]:
    """Yield the finding that integers are signed and kept unsigned, or that readings wrap."""
    if (values == np.rint(values)).all() and values.min() >= 0:
        for n_bits in (8, 16):
            size = 2.0**n_bits
            low, high = np.mean(values < size / 4), np.mean(values >= 0.75 * size)
            ends = values.max() < size and low + high > 1 - 1e-9
            if ends and min(low, high) >= MIN_SHARE:
                text = f"readings lie at both ends of 0 to {size - 1:g} and not between: int"
                text += f"{n_bits} written as uint{n_bits}"
                yield LayoutFinding("unsigned", text, f"wrap={size:g}", stops=True)
                return
    lowest, highest = values.min(axis=0), values.max(axis=0)
    spans = highest - lowest
    typical = float(np.median(spans))
    for taxel, axis in np.argwhere(spans > 4 * typical) if typical > 0 else ():
        series, span = values[:, taxel, axis], spans[taxel, axis]
        steps = np.diff(series)
        at = np.flatnonzero(np.abs(steps) > 0.8 * span)
        middle = np.abs(series - (lowest + highest)[taxel, axis] / 2) < span / 4
        # A range of signed integers ends at opposite numbers.
        if (
            len(at)
            and not middle.any()
            and (np.abs(series[at] + series[at + 1]) < 0.1 * np.abs(steps[at])).all()
        ):
            drift = (np.take(steps, at - 1, mode="clip") + np.take(steps, at + 1, mode="clip")) / 2
            calm = np.abs(drift) < 0.1 * span
            period = float(np.median(np.abs(steps[at] - np.where(calm, drift, 0.0))))
            text = f"{'xyz'[axis]} of taxel {taxel + 1} jumps between the ends of its range, from "
            text += f"{series[at[0]]:.6g} to {series[at[0] + 1]:.6g}: it wraps"
            yield LayoutFinding("wraps", text, f"wrap={period:.6g}", stops=True)
            return


def _units(values: Array, skin: Sensor, unit: str) -> Iterator[LayoutFinding]:
    """Yield the finding that the readings cannot have the unit of the sensor."""
    lowest, highest = float(values.min()), float(values.max())
    # Counts of a device with a known range are whole numbers, or reach far into it.
    least = 1.0 if skin.range is None else MIN_RANGE * (skin.range[1] - skin.range[0])
    is_whole = skin.range is not None and bool((values == np.rint(values)).all())
    if (values == values[0]).all():  # a sensor that is disconnected
        return
    if unit == "count" and highest - lowest < least and not is_whole:
        text = f"readings between {lowest:.4g} and {highest:.4g} are too close for counts, and so "
        yield LayoutFinding(
            "unit", text + "taken for noise: is their unit N?", "unit=N", stops=True
        )
    largest = max(abs(lowest), abs(highest))
    if unit == "N" and largest > MAX_TAXEL_FORCE:
        text = f"readings up to {largest:.4g} N on a taxel: is their unit mN or count?"
        yield LayoutFinding("unit", text, "unit=mN", stops=True)


def _quantities(values: Array, skin: Sensor, unit: str) -> Iterator[LayoutFinding]:
    """Yield findings about numbers that are no x, y and z of a force or field."""
    norm = np.sqrt((values**2).sum(axis=2))
    for length in GRAVITY[unit]:
        near = np.abs(norm.mean(axis=0) / length - 1) < GRAVITY_TOLERANCE
        if near.all() and 0 < norm.std() < GRAVITY_TOLERANCE * length:
            text = f"all vectors have the length {length:g}, as gravity: an accelerometer?"
            yield LayoutFinding("gravity", text, "axes", stops=True)
    steps = np.abs(np.diff(values, axis=0))
    for axis in range(3):
        least, most = values[:, :, axis].min(), values[:, :, axis].max()
        for low, high, margin in ((-np.pi, np.pi, 0.05), (0.0, 360.0, 5.0)):
            n_turns = (steps[:, :, axis] > 0.8 * (high - low)).sum(axis=0)
            is_inside = low - 1e-3 <= least < low + margin and high - margin < most <= high + 1e-3
            if is_inside and (n_turns > 2).all():
                text = f"{'xyz'[axis]} of every taxel goes around {low:.4g} to {high:.4g}: an angle"
                yield LayoutFinding("angle", text, "axes", stops=True)
    shear, normal = values[:, :, :2], values[:, :, 2]
    is_signed = (shear.min(axis=0) < 0) & (shear.max(axis=0) > 0)
    is_longer = normal**2 >= (shear**2).sum(axis=2) * (1 - 1e-6)
    if is_signed.mean() > 0.8 and normal.min() > 0 and is_longer.mean() > 0.999:
        text = "the third number of each taxel is never below the length of the other two: the "
        text += "norm, not z; sign and direction of the force are not known"
        yield LayoutFinding("norm", text)
    if skin.magnetic:
        yield from _turned(normal)


def _turned(normal: Array) -> Iterator[LayoutFinding]:
    """Yield the finding that z falls at some taxels while it rises at others."""
    n_rest = max(len(normal) // 20, 2)
    change = normal - np.median(normal[:n_rest], axis=0)
    size = np.abs(change).mean(axis=1)
    pressed = change[size >= np.quantile(size, 0.9)].mean(axis=0)
    if size[-n_rest:].mean() > 0.1 * size.max():  # it does not rest at its start or its end
        return
    largest = float(np.abs(pressed).max())
    noise = float(np.median(normal[:n_rest].std(axis=0)))
    down = pressed < -TURNED_SHARE * largest
    if largest > 20 * noise > 0 and down.any() and (pressed > TURNED_SHARE * largest).any():
        numbers = ", ".join(map(str, taxel_numbers(np.flatnonzero(down).tolist())))
        text = f"the signs of z differ under load: taxels {numbers} fall where others rise; are "
        yield LayoutFinding("turned", text + "their magnets turned around?")


def mended(values: Array, missing: str | None, wrap: str | None) -> Array:
    """Return readings (n, n_taxels, 3) whose missing ones are NaN, and that do not wrap.

    Args:
        values: of one module; it is changed.
        missing: as in `Columns`.
        wrap: as in `Columns`.

    Example:
        >>> mended(np.array([1.0, 0, 65535]).reshape(3, 1, 1) * np.ones(3), None, "65536")[:, 0, 0]
        array([ 1.,  0., -1.])
    """
    if missing not in (None, "none"):
        values[(values == float(missing)).all(axis=2)] = np.nan
    if wrap not in (None, "none"):
        period = float(wrap)
        whole = np.unwrap(filled(values), period=period, axis=0)
        start = np.floor(whole[:1] / period + 0.5) * period
        values = np.where(np.isfinite(values), whole - start, np.nan)
    return values


def filled(values: Array) -> Array:
    """Return values (n, ...) with the one before, or the first, in place of one that is missing."""
    is_finite = np.isfinite(values)
    if is_finite.all():
        return values
    rows = np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1))
    last = np.maximum.accumulate(np.where(is_finite, rows, is_finite.argmax(axis=0)), axis=0)
    return np.nan_to_num(np.take_along_axis(values, last, axis=0), posinf=0.0, neginf=0.0)
