"""Troubles of magnetic skins, added to what the twin's fingertips read: fields, zeros, drift.

A function of the time and of the number of a sample: batches and single samples are the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

COUNTS_END = 65535
STILL_SECONDS_AT_START = 1.0
"""Time for which the hand is still at first: for the tare, and for the noise [s]."""
AGEING_OF_GAIN, AGEING_OF_NOISE = 0.03, 0.1
"""Loss of gain, and rise of the noise, in a month, as shares. Invented: no data sheet was found."""
UNIT_SPREAD = 0.5
"""Standard deviation over units and taxels of how fast they age, as a share. Invented."""


@dataclass(frozen=True)
class MagneticFaults:
    """Troubles of all fingertips of a hand; with the default values there are none.

    Attributes:
        field: size of a field in which the hand turns [count].
        turn_time: time of a turn by 360 degrees about one axis [s]; about another it takes 1.6
            times as long.
        zero_share: share of samples in which one taxel, another each time, reads zero.
        drift: standard deviation over taxels and axes of a steady drift [count/h].
        invented_months: age of the skin: gains fall, and noise rises, by invented numbers.

    Raises:
        ValueError: a number is negative or not finite, the turn time is 0, or the share is over 1.

    Example:
        >>> MagneticFaults(field=-1)
        Traceback (most recent call last):
        ValueError: field: at least 0 expected, -1 given
    """

    field: float = 0.0
    turn_time: float = 8.0
    zero_share: float = 0.0
    drift: float = 0.0
    invented_months: float = 0.0

    def __post_init__(self) -> None:
        for part in fields(self):
            value = getattr(self, part.name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{part.name}: at least 0 expected, {value} given")
        if self.turn_time == 0 or self.zero_share > 1:
            raise ValueError("a turn time above 0, and a share of at most 1 expected")

    @classmethod
    def parse(cls, text: str) -> "MagneticFaults":
        """Return the troubles of a text like `field=300,zero-share=0.02`; none of an empty one.

        Raises:
            ValueError: a name is unknown or given twice, or a value is no number or out of range.

        Example:
            >>> MagneticFaults.parse("field=300,turn-time=3").turn_time
            3.0
        """
        names = [part.name.replace("_", "-") for part in fields(cls)]
        values: dict[str, float] = {}
        for pair in filter(None, (text_part.strip() for text_part in text.split(","))):
            name, _, value = pair.partition("=")
            if name not in names or name.replace("-", "_") in values:
                raise ValueError(
                    f"--faults with each of {', '.join(names)} at most once expected, "
                    f"{pair!r} given"
                )
            try:
                values[name.replace("-", "_")] = float(value)
            except ValueError:
                raise ValueError(f"--faults {name}: a number expected, {value!r} given") from None
        return cls(**values)

    @property
    def changes_nothing(self) -> bool:
        """Whether there are no troubles."""
        return self == MagneticFaults(turn_time=self.turn_time)

    def field_at(self, times: npt.ArrayLike) -> Array:
        """Return (n, 3) the field beyond that at time 0, in the frame of all fingertips [count]."""
        turned_for = np.maximum(np.asarray(times, dtype=np.float64) - STILL_SECONDS_AT_START, 0)
        angle = 2 * np.pi * turned_for / self.turn_time
        other = angle / 1.6
        # From the start (1, 0, 0): turns about two axes, one after the other.
        turned = np.stack(
            [np.cos(angle) * np.cos(other), np.sin(angle), np.cos(angle) * np.sin(other)], axis=-1
        )
        return self.field * (turned - [1.0, 0.0, 0.0])

    def apply(
        self,
        sensors: Mapping[str, Sensor],
        counts: Mapping[str, npt.NDArray[np.uint16]],
        times: npt.NDArray[np.float64],
        rest: Mapping[str, npt.ArrayLike],
        seed: int,
    ) -> dict[str, npt.NDArray[np.uint16]]:
        """Return the counts with these troubles.

        Args:
            sensors: sensor of each finger.
            counts: (n, n_taxels, 3) of each finger without them.
            times: (n,) times since the start [s].
            rest: (n_taxels, 3) readings of each finger without load [count].
            seed: of the units; another one is another hand.
        """
        field, counts_by_finger = self.field_at(times), {}
        numbers = np.rint(np.asarray(times) * 1e6).astype(np.int64)
        for index, (name, sensor) in enumerate(sensors.items()):
            unit = np.random.default_rng([seed, index])
            zero, shape = np.asarray(rest[name], dtype=np.float64), (sensor.n_taxels, 3)
            age = self.invented_months * np.exp(UNIT_SPREAD * unit.standard_normal(shape))
            drift = self.drift * unit.standard_normal(shape)
            load = (counts[name] - zero) * np.exp(-AGEING_OF_GAIN * age)
            values = zero + load + drift * times[:, None, None] / 3600
            values += np.einsum("ikj,nk->nij", sensor.rotations, field)
            for k, number in enumerate(numbers.tolist()):
                if self.zero_share or self.invented_months:
                    drawn = np.random.default_rng([seed, index, number + (1 << 40)])
                    values[k] += AGEING_OF_NOISE * age * drawn.standard_normal(shape)
                    if drawn.random() < self.zero_share:
                        values[k, drawn.integers(sensor.n_taxels)] = 0
            counts_by_finger[name] = np.clip(np.rint(values), 0, COUNTS_END).astype(np.uint16)
        return counts_by_finger


WITHOUT_FAULTS = MagneticFaults()
"""No troubles."""
