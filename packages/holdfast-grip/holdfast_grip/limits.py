"""Limits of a grip controller, and checks that they do not contradict each other."""

import math
from typing import Literal

import msgspec

FaultAction = Literal["hold", "open"]
SLACK = 1e-9
"""Rounding by which a limit may be exceeded: of scales and times, and relative of efforts."""


class Limits(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Limits of a grip controller. A scale is a multiple of the force at the start of the grip.

    The defaults are those of `holdfast hold` and `trial`
    (`docs/decisions/0013-one-set-of-grip-limits.md`).

    Attributes:
        min_scale: lowest force scale; 1 never relaxes below the first grip.
        max_scale: highest force scale.
        rise: fastest rise of a scale [1/s].
        fall: fastest fall of a scale [1/s].
        cooldown: time after the last rise in which no force falls [s].
        max_force: highest normal force of a finger, in the unit of the readings, or in N if the
            controller has a calibration. No scale exceeds the force of the start by more; a
            finger that measures 1.5 times as much is a fault. None for no such limit.
        stale_after: time by which a sample of a loaded finger may be late [s].
        fault_after: time for which a loaded finger may have no estimate [s].
        recovery: time of valid data after which the loop continues after a fault [s]; infinite:
            only after `reset`. After "open", and after a lost object, it never continues.
        on_fault: what the hand does in a fault: "hold" keeps the last command, "open" opens.
        max_rate: commands per second that a hand gets [Hz].

    Raises:
        ValueError: a limit is out of range, or two contradict each other.
    """

    min_scale: float = 0.8
    max_scale: float = 3.0
    rise: float = 100.0
    fall: float = 3.0
    cooldown: float = 0.1
    max_force: float | None = None
    stale_after: float = 0.05
    fault_after: float = 0.03
    recovery: float = 0.5
    on_fault: FaultAction = "hold"
    max_rate: float = 400.0

    def __post_init__(self) -> None:
        for name in ("min_scale", "max_scale", "rise", "fall", "stale_after", "max_rate"):
            _check(name, getattr(self, name), above=0.0)
        for name in ("cooldown", "fault_after"):
            _check(name, getattr(self, name), at_least=0.0)
        if self.max_force is not None:
            _check("max_force", self.max_force, above=0.0)
        if not self.recovery >= 0:
            raise ValueError(f"recovery: at least 0 s expected, {self.recovery} given")
        if not self.min_scale <= 1.0 <= self.max_scale:
            raise ValueError(
                f"min_scale <= 1 <= max_scale expected, {self.min_scale:g} and "
                f"{self.max_scale:g} given: the grip begins at a scale of 1"
            )
        if self.on_fault not in ("hold", "open"):
            raise ValueError(f"on_fault: hold or open expected, {self.on_fault!r} given")

    def highest_scale(self, force: float) -> float:
        """Return the highest scale of a finger that begins with a normal force.

        Example:
            >>> Limits(max_scale=3.0, max_force=5.0).highest_scale(2.0)
            2.5
        """
        if self.max_force is None or not force > 0:
            return self.max_scale
        return max(1.0, min(self.max_scale, self.max_force / force))


def _check(
    name: str, value: float, *, above: float = -math.inf, at_least: float = -math.inf
) -> None:
    if not (math.isfinite(value) and value > above and value >= at_least):
        bound = f"above {above:g}" if above > -math.inf else f"of at least {at_least:g}"
        raise ValueError(f"{name}: a finite number {bound} expected, {value} given")
