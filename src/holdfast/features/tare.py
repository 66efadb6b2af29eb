"""The tare: a per-taxel baseline taken without contact, then frozen."""

import math
from dataclasses import dataclass
from typing import Literal, Self

TareArgument = float | str | tuple[float, float]
"""Seconds from the start, "first", "none", "START:END", or (start, end) in seconds."""

HALF = 0.5
"""Times are compared to half a sample period, so that rounding cannot move a sample."""


@dataclass(frozen=True)
class Tare:
    """How the baseline is found.

    Attributes:
        kind: `seconds` (the mean of the first `seconds`), `first` (the first sample, for
            recordings that begin in contact), `none`, or `interval` (offline only).
        seconds: for `seconds`: how long [s].
        interval: for `interval`: start and end on the clock of the recording [s].
    """

    kind: Literal["seconds", "first", "none", "interval"]
    seconds: float = 0.0
    interval: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def parse(cls, given: "TareArgument | Tare") -> Self:
        """The tare that a user asks for.

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
            if isinstance(given, str) and ":" in given:
                start, end = given.split(":")
                return cls._interval(float(start), float(end))
            if isinstance(given, tuple):
                return cls._interval(*(float(value) for value in given))
            return cls._seconds(float(given))
        except (TypeError, ValueError) as cause:
            raise ValueError(
                f"tare: seconds above 0, 'first', 'none' or START:END expected, {given!r} given"
            ) from cause

    @classmethod
    def _interval(cls, start: float, end: float) -> Self:
        if not (math.isfinite(start) and math.isfinite(end) and start < end):
            raise ValueError("an interval ends after its start")
        return cls("interval", interval=(start, end))

    @classmethod
    def _seconds(cls, seconds: float) -> Self:
        if not (math.isfinite(seconds) and seconds > 0):
            raise ValueError("a tare takes time")
        return cls("seconds", seconds)

    @property
    def without_contact(self) -> bool:
        """Whether it is taken over a stretch that tells the noise of a sensor without contact."""
        return self.kind == "seconds"

    def __str__(self) -> str:
        if self.kind == "seconds":
            return _exact(self.seconds)
        if self.kind == "interval":
            return ":".join(map(_exact, self.interval))
        return self.kind


def _exact(number: float) -> str:
    """The shortest text that is read as the same number."""
    return repr(number).removesuffix(".0")
