"""The tare: a per-taxel baseline taken without contact, then frozen; offline and live.

`baseline_of` computes it from a recording, `kernel/tare.c` sample by sample in a stream. Both
add the same samples in the same order, so that both give the same bits.
"""

import math
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt

from holdfast.recordings import Tactile
from holdfast.sensors.types import Array

TareArgument = float | str | tuple[float, float]
"""Seconds from the start, "first", "none", "START:END", or (start, end) in seconds."""

SEARCH_BLOCK = 1024
"""Samples in which the first finite one is searched at a time."""


@dataclass(frozen=True)
class Tare:
    """How the baseline is found.

    Attributes:
        kind: `seconds` (the mean of the first `seconds`), `first` (the first sample, for
            recordings that begin in contact), `none`, or `interval` (offline only).
        seconds: duration, for `seconds` [s].
        interval: start and end on the clock of the recording, for `interval` [s].
    """

    kind: Literal["seconds", "first", "none", "interval"]
    seconds: float = 0.0
    interval: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def parse(cls, given: "TareArgument | Tare") -> Self:
        """Return the tare that a number, a text or a pair of times describes.

        Raises:
            ValueError: it is none of the known forms.

        Example:
            >>> Tare.parse("0.5").seconds, Tare.parse("first").kind, Tare.parse("1:2").interval
            (0.5, 'first', (1.0, 2.0))
        """
        if isinstance(given, Tare):
            return cls(given.kind, given.seconds, given.interval)
        if given in ("first", "none"):
            return cls(given)  # type: ignore[arg-type]
        try:
            times = given.split(":") if isinstance(given, str) and ":" in given else given
            if isinstance(times, list | tuple):
                start, end = (float(time) for time in times)
                if not (math.isfinite(start) and math.isfinite(end) and start < end):
                    raise ValueError("an interval must end after its start")
                return cls("interval", interval=(start, end))
            seconds = float(times)
            if not (math.isfinite(seconds) and seconds > 0):
                raise ValueError("a duration above 0 s is needed")
            return cls("seconds", seconds)
        except (TypeError, ValueError) as cause:
            raise ValueError(
                f"tare: seconds above 0, 'first', 'none' or START:END expected, {given!r} given"
            ) from cause

    @property
    def without_contact(self) -> bool:
        """Whether its samples show the noise of the sensor without contact."""
        return self.kind == "seconds"

    def __str__(self) -> str:
        # `repr` is the shortest text that is read back as the same number: a model file has it.
        numbers = {"seconds": (self.seconds,), "interval": self.interval}.get(self.kind)
        if numbers is None:
            return self.kind
        return ":".join(repr(number).removesuffix(".0") for number in numbers)


def baseline_of(
    readings: npt.NDArray[Any], times: Array, tare: Tare, period: float
) -> tuple[Array, int]:
    """Return the baseline of a recorded module.

    Times are compared with half a sample period of tolerance, so that their rounding does not
    move a sample into the tare or out of it.

    Args:
        readings: (n, n_taxels, 3) [count or N].
        times: (n,) [s].
        tare: how the baseline is found.
        period: of the samples [s].

    Returns:
        (n_taxels, 3) float64 in the unit of the readings, and the first sample from which it may
        be subtracted without looking ahead (0 for an interval).

    Raises:
        ValueError: no finite sample lies in the time of the tare.
    """
    if tare.kind == "none" or not (len(readings) or tare.kind == "interval"):
        return np.zeros(readings.shape[1:]), 0
    if tare.kind == "interval":
        inside = (times >= tare.interval[0]) & (times < tare.interval[1])
        return _mean(readings[inside], tare), 0
    start = first_finite(readings)
    if tare.kind == "first":
        return readings[start].astype(np.float64), start
    # From the first finite sample on, as in a stream.
    inside = times - times[start] + 0.5 * period < tare.seconds
    inside[: start + 1] = True  # one sample at least
    return _mean(readings[inside], tare), int(inside.sum())


def offline_tare(tare: TareArgument | Tare, module: Tactile) -> Tare:
    """Return the same tare for all samples of a module, those before it is complete included.

    A tare by seconds becomes the interval of those seconds from the first finite sample on.

    Raises:
        ValueError: the tare is unknown.
    """
    how = Tare.parse(tare)
    if how.kind != "seconds" or not module.n_samples:
        return how
    start = float(module.times[first_finite(module.readings)])
    return Tare("interval", interval=(start, start + max(how.seconds, module.period / 2)))


def first_finite(readings: npt.NDArray[Any]) -> int:
    """Return the index of the first sample without a reading that is not finite; 0 if none."""
    for row in range(0, len(readings), SEARCH_BLOCK):
        finite = np.isfinite(readings[row : row + SEARCH_BLOCK]).all(axis=(1, 2))
        if finite.any():
            return row + int(finite.argmax())
    return 0


def _mean(readings: npt.NDArray[Any], tare: Tare) -> Array:
    """Return the mean of the finite samples, added one after the other as in a stream."""
    values = readings[np.isfinite(readings).all(axis=(1, 2))].astype(np.float64)
    if not len(values):
        raise ValueError(f"tare {tare}: no finite sample in that time")
    # Not `mean`, which adds by pairs: a stream adds one sample after the other.
    return np.asarray(np.add.accumulate(values, axis=0)[-1] / len(values))
