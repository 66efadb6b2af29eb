"""Parameters of the model of a uSkin fingertip, with the source of each."""

from dataclasses import dataclass, fields

import numpy as np

Three = tuple[float, float, float]


@dataclass(frozen=True)
class UskinParameters:
    """Parameters of the model of a uSkin fingertip.

    Nothing is published on the curved fingertip. "Data sheet" is that of the flat uSPa46 (July
    2025, high sensitivity). "Packets" are two packets of whole Allegro hands, 368 taxels each.

    Attributes:
        spread: standard deviation of the spread of a force in the silicone [m]. Own choice:
            less than half of the taxels' pitch of 6.4 mm.
        gain_spread: standard deviation of the logarithm of the taxels' gains. Own choice; XELA
            sells a calibration of each taxel in place of the general one.
        cross_talk: standard deviation of the six ratios by which one axis of a taxel reads
            another. Own choice.
        limits: limit of the readings of each axis [N]. Data sheet: the range.
        lag_shares: shares of a force that the silicone shows with delay. Own choice, typical of
            silicones. With `lag_times`, a cycle of 20 s up and 20 s down has a hysteresis of
            1 % of its height (data sheet: 1.06 % on z; its cycle is not published).
        lag_times: time constant of each share [s]. Own choice.
        counts_per_newton: scale of each axis [count/N]. Data sheet: 0.000628, 0.000628,
            0.000729 N/count.
        baseline: mean reading of each axis at rest [count]. Packets.
        baseline_spread: standard deviation of the baseline over taxels [count]. Packets.
        thermal_counts: drift of the baseline of each axis [count/K]. Data sheet: 120 counts on z
            for 3.5 degrees.
        thermal_spread: standard deviation of that drift over taxels, every axis [count/K]. Own
            choice: a fifth of the drift.
        warming: standard deviation of the temperature's change over `warming_time` [K]. Data
            sheet: its test. The course of the temperature is an own choice.
        warming_time: time of the change `warming` [s]. Data sheet: 50 minutes.
        thermal_time: correlation time of the rate of warming [s]. Own choice: 5 mm of silicone
            conduct heat in about 100 s, so the temperature is smooth from sample to sample.
        noise_counts: rms noise of a reading at rest, with rounding [count]. Data sheet: mean
            square 0.8 (x, y) and 0.9 (z).

    Raises:
        ValueError: a parameter has another number of values, is not finite or is negative; a
            limit, scale or time is 0; or the lag shares add up to more than 1.
    """

    spread: float = 2.8e-3
    gain_spread: float = 0.15
    cross_talk: float = 0.04
    limits: Three = (0.87, 0.87, 7.35)
    lag_shares: tuple[float, float] = (0.10, 0.05)
    lag_times: tuple[float, float] = (0.030, 2.0)
    counts_per_newton: Three = (1 / 0.000628, 1 / 0.000628, 1 / 0.000729)
    baseline: Three = (32768.0, 32768.0, 36200.0)
    baseline_spread: Three = (260.0, 260.0, 750.0)
    thermal_counts: Three = (0.0, 0.0, 120 / 3.5)
    thermal_spread: float = 7.0
    warming: float = 3.5
    warming_time: float = 3000.0
    thermal_time: float = 100.0
    noise_counts: float = 0.9

    def __post_init__(self) -> None:
        for part in fields(self):
            values = np.asarray(getattr(self, part.name), dtype=np.float64)
            positive = part.name in _ABOVE_ZERO
            if values.shape != np.asarray(part.default).shape:
                raise ValueError(
                    f"{part.name}: numbers like {part.default} expected, {values} given"
                )
            if not (np.isfinite(values).all() and (values >= 0).all()):
                raise ValueError(f"{part.name}: finite, not negative expected, {values} given")
            if positive and not (values > 0).all():
                raise ValueError(f"{part.name}: above 0 expected, {values} given")
        if sum(self.lag_shares) > 1:
            raise ValueError(f"lag_shares: at most 1 in sum expected, {self.lag_shares} given")

    @property
    def warming_rate(self) -> float:
        """Standard deviation of the rate of warming [K/s].

        The rate is an Ornstein-Uhlenbeck process. Its integral over t has the variance
        2 (rate tau)^2 (t / tau - 1 + exp(-t / tau)), where tau is the thermal time.
        """
        periods = self.warming_time / self.thermal_time
        walk = np.sqrt(2 * (periods - 1 + np.exp(-periods)))
        return float(self.warming / (self.thermal_time * walk))


_ABOVE_ZERO = (
    "spread",
    "limits",
    "lag_times",
    "counts_per_newton",
    "warming_time",
    "thermal_time",
)
