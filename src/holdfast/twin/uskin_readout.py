"""Parameters and state of the readout of a uSkin fingertip, which c/uskin_readout.c computes.

Every parameter has its source.
"""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array, Integers
from holdfast.twin.skin import Three
from holdfast.twin.steps import read_out


@dataclass(frozen=True)
class UskinParameters:
    """Parameters of the model of a uSkin fingertip.

    Nothing is published on the curved fingertip. "Data sheet" means that of the flat uSPa46 (July
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
        noise_by_axis: factor on the noise of each axis.
        n_averaged: number of readings of a taxel that the sensor averages; `noise_counts` is the
            noise after it.
        scan_time: time in which the taxels are read one after the other [s]; a packet has the
            last reading of each. With 0 they are all read when the packet is sent.
        scan_line: number of taxels that share a line and are read in turn; lines are read at the
            same time.
        slow_share: share of the noise's variance that changes slowly, from 0 to 1.
        slow_time: correlation time of that part [s].
        walk: random walk of a reading, rms in a second, in multiples of the noise.
        step: step of the readings [count]; they are multiples of it.
        still_share: share of taxels that are read without noise.

    Raises:
        ValueError: a parameter has another number of values, is not finite or is negative; a
            limit, scale, time or step is 0; shares add up to more than 1; or a number of
            readings or taxels is no integer.
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
    noise_by_axis: Three = (1.0, 1.0, 1.0)
    n_averaged: int = 1
    scan_time: float = 0.0
    scan_line: int = 8
    slow_share: float = 0.0
    slow_time: float = 0.06
    walk: float = 0.0
    step: int = 1
    still_share: float = 0.0

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
        for name in ("n_averaged", "scan_line", "step"):
            if (number := getattr(self, name)) != int(number):
                raise ValueError(f"{name}: an integer expected, {number} given")
        for name in ("slow_share", "still_share"):
            if (share := getattr(self, name)) > 1:
                raise ValueError(f"{name}: at most 1 expected, {share} given")
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
    "n_averaged",
    "scan_line",
    "slow_time",
    "step",
)


Counts = npt.NDArray[np.uint16]

ROUNDING_VARIANCE = 1 / 12
"""Variance of rounding to whole counts [count^2]."""


class Taxels(NamedTuple):
    """Fixed properties of the taxels of one fingertip.

    Attributes:
        mixing: (n_taxels, 3, 3) gain and cross-talk, from a force to a reading by axis.
        baseline: (n_taxels, 3) reading at rest [count].
        thermal: (n_taxels, 3) drift of the baseline [count/K].
        noise: (n_taxels,) factor on the noise.
    """

    mixing: Array
    baseline: Array
    thermal: Array
    noise: Array


class _Constants(NamedTuple):
    """Constants of a fingertip for c/uskin_readout.c.

    Attributes:
        taxels: properties of the taxels.
        limits: (3,) limits of the readings [N].
        scales: (3,) scales [count/N].
        shares: (n_lags,) shares of a force that the silicone delays.
        taus: (n_lags,) time constant of each [s].
        prompt: share of a force without delay.
        noise: (3,) standard deviation of the noise of a reading before rounding [count].
        scan: time in which the taxels of a line are read [s]; 0: all with the packet.
        line: number of taxels on a line.
        step: of the readings [count].
        spread: standard deviation of the rate of warming [K/s].
        thermal_time: its correlation time [s].
    """

    taxels: Taxels
    limits: Array
    scales: Array
    shares: Array
    taus: Array
    prompt: float
    noise: Array
    scan: float
    line: int
    step: float
    spread: float
    thermal_time: float


class _State(NamedTuple):
    """State of a fingertip.

    Attributes:
        force: (n_taxels, 3) last forces [N].
        delayed: (n_lags, n_taxels, 3) delayed parts of the force [N].
        numbers: (3,) time of the last sample [s], NaN before; rate of warming [K/s];
            temperature above that at the start [K].
        passed: (n_taxels, 3) forces after the silicone at the last sample [N].
        passed_now: (n_taxels, 3) the same at this sample.
        readings: (n_averaged, n_taxels, 3) last readings of each taxel [count].
        n_read: (n_taxels,) number of readings so far.
        shown: (n_taxels, 3) counts of the last sample.
        colour: (2, 3 n_taxels) slow part and random walk of the noise, in multiples of the noise.
    """

    force: Array
    delayed: Array
    numbers: Array
    passed: Array
    passed_now: Array
    readings: Array
    n_read: Integers
    shown: Counts
    colour: Array


_TIME, _RATE = range(2)
"""Positions in `_State.numbers`; the third, the temperature, is that of c/uskin_readout.c alone."""


class Readout:
    """Run of one fingertip, with the state of its silicone and its temperature."""

    def __init__(
        self, parameters: UskinParameters, taxels: Taxels, generator: np.random.Generator
    ) -> None:
        self._parameters = parameters
        # Of a single reading before rounding: averaging lowers the noise that the sensor shows.
        noises = [parameters.noise_counts * factor for factor in parameters.noise_by_axis]
        before_rounding = [math.sqrt(max(noise**2 - ROUNDING_VARIANCE, 0.0)) for noise in noises]
        shares = np.array(parameters.lag_shares)
        self._constants = _Constants(
            taxels,
            np.array(parameters.limits),
            np.array(parameters.counts_per_newton),
            shares,
            np.array(parameters.lag_times),
            1.0 - float(shares.sum()),
            np.array(before_rounding) * math.sqrt(parameters.n_averaged),
            parameters.scan_time,
            int(parameters.scan_line),
            float(parameters.step),
            parameters.warming_rate,
            parameters.thermal_time,
        )
        self._generator = generator
        # A separate generator, so that slow noise does not change the other draws.
        self._colour_generator = generator.spawn(1)[0]
        shape = taxels.baseline.shape
        self._state = _State(
            force=np.zeros(shape),
            delayed=np.zeros((len(parameters.lag_times), *shape)),
            numbers=np.array([np.nan, 0, 0]),
            passed=np.zeros(shape),
            passed_now=np.zeros(shape),
            readings=np.zeros((int(parameters.n_averaged), *shape)),
            n_read=np.zeros(len(taxels.baseline), dtype=np.intc),
            shown=np.zeros(shape, dtype=np.uint16),
            colour=np.zeros((2, len(taxels.baseline) * 3)),
        )

    def read(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> Counts:
        """Compute the next samples; arguments, result and errors are those of `Uskin.counts`."""
        forces, clock = self._checked(taxel_forces, times)
        counts = np.empty(forces.shape, dtype=np.uint16)
        if len(clock):
            drawn = self._generator.standard_normal((len(clock), 1 + self._state.force.size))
            if self._parameters.slow_share or self._parameters.walk:
                self._colour(clock, drawn)
            if math.isnan(self._state.numbers[_TIME]):  # the silicone is at rest under the forces
                state = self._state
                state.force[:] = state.delayed[:] = forces[0]
                state.numbers[_TIME] = clock[0]
                state.numbers[_RATE] = self._constants.spread * drawn[0, 0]
            read_out(forces, clock, drawn, self._constants, self._state, counts)
        return counts

    def _colour(self, clock: Array, drawn: Array) -> None:
        """Colour the noise, with random numbers of its own: white, slow and a random walk.

        The slow part is an Ornstein-Uhlenbeck process, which begins with its stationary variance:
        y <- e y + sqrt(1 - e^2) n, with e = exp(-h / tau) over a step h. The walk begins at 0.
        Averaging lowers only the white noise.
        """
        parameters, (slow, walk) = self._parameters, self._state.colour
        fresh = self._colour_generator.standard_normal((len(clock), 2, len(slow)))
        share, scale = parameters.slow_share, 1 / math.sqrt(parameters.n_averaged)
        steps = np.diff(clock, prepend=self._state.numbers[_TIME]).tolist()
        for step, normal, white in zip(steps, fresh, drawn[:, 1:], strict=True):
            keep = 0.0 if math.isnan(step) else math.exp(-step / parameters.slow_time)
            wander = 0.0 if math.isnan(step) else parameters.walk * math.sqrt(step)
            slow[:] = keep * slow + math.sqrt(1 - keep * keep) * normal[0]
            walk += wander * normal[1]
            white[:] = math.sqrt(1 - share) * white + scale * (math.sqrt(share) * slow + walk)

    def _checked(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> tuple[Array, Array]:
        forces = np.ascontiguousarray(taxel_forces, dtype=np.float64)
        clock = np.ascontiguousarray(times, dtype=np.float64)
        n_taxels = len(self._state.force)
        if forces.shape != (*clock.shape, n_taxels, 3) or clock.ndim != 1:
            raise ValueError(
                f"taxel forces of shape (n, {n_taxels}, 3) and n times expected, "
                f"{forces.shape} and {clock.shape} given"
            )
        if not (np.isfinite(forces).all() and np.isfinite(clock).all()):
            raise ValueError("finite taxel forces and times expected, NaN or infinity given")
        if (np.diff(clock, prepend=self._state.numbers[_TIME]) <= 0).any():  # before it, NaN
            raise ValueError("increasing times expected")
        return forces, clock
