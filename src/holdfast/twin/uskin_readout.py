"""One run of a uSkin fingertip: silicone, magnets, temperature, noise and whole counts."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.uskin_parameters import UskinParameters

Counts = npt.NDArray[np.uint16]

ROUNDING = 1 / 12
"""Variance of rounding to whole counts [count^2]."""
UINT16_MAX = 65535.0


class Taxels(NamedTuple):
    """What is fixed of each taxel of one fingertip.

    Attributes:
        mixing: (n_taxels, 3, 3) from a force to a reading by axis: gain and cross-talk.
        baseline: (n_taxels, 3) reading at rest [count].
        thermal: (n_taxels, 3) by which a degree moves it [count/K].
    """

    mixing: Array
    baseline: Array
    thermal: Array


class Readout:
    """A run of one fingertip: the state of its silicone and its temperature.

    Attributes:
        warmth: above the temperature at the start [K].
    """

    def __init__(
        self, parameters: UskinParameters, taxels: Taxels, generator: np.random.Generator
    ) -> None:
        self.warmth = 0.0
        self._parameters = parameters
        self._taxels = taxels
        self._generator = generator
        self._rate = 0.0
        self._last: tuple[float, Array, Array] | None = None  # time, force and late parts

    def counts(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> Counts:
        """The next samples; arguments, result and errors as of `Uskin.counts`."""
        forces, clock = self._checked(taxel_forces, times)
        if not len(clock):
            return np.zeros(forces.shape, dtype=np.uint16)
        parameters = self._parameters
        drawn = self._generator.standard_normal((len(clock), 1 + self._taxels.baseline.size))
        warmth = self._warm(clock, drawn[:, 0])
        passed = self._late(forces, clock)
        white = np.sqrt(max(parameters.noise_counts**2 - ROUNDING, 0.0))
        limits, scales = np.array(parameters.limits), np.array(parameters.counts_per_newton)
        counts = np.empty(forces.shape, dtype=np.uint16)
        _count(passed, warmth, white * drawn[:, 1:], self._taxels, limits, scales, counts)
        return counts

    def _checked(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> tuple[Array, Array]:
        forces = np.array(taxel_forces, dtype=np.float64, order="C")
        clock = np.array(times, dtype=np.float64)
        n_taxels = len(self._taxels.baseline)
        if forces.shape != (*clock.shape, n_taxels, 3) or clock.ndim != 1:
            raise ValueError(
                f"taxel forces of shape (n, {n_taxels}, 3) and n times expected, "
                f"{forces.shape} and {clock.shape} given"
            )
        if not (np.isfinite(forces).all() and np.isfinite(clock).all()):
            raise ValueError("finite taxel forces and times expected, NaN or infinity given")
        before = [] if self._last is None else [self._last[0]]
        if not (np.diff(clock, prepend=before) > 0).all():
            raise ValueError("times that increase expected")
        return forces, clock

    def _late(self, forces: Array, clock: Array) -> Array:
        """The forces as the silicone passes them on: parts of them late.

        Exact for forces that are linear between samples.
        """
        shares = np.array(self._parameters.lag_shares)
        taus = np.array(self._parameters.lag_times)
        if self._last is None:
            state = np.repeat(forces[None, 0], len(taus), axis=0)
            self._last = (float(clock[0]), forces[0], state)
        last, force, state = self._last
        passed = np.empty_like(forces)
        _follow(forces, np.diff(clock, prepend=last), force, state, shares, taus, passed)
        self._last = (float(clock[-1]), forces[-1].copy(), state)
        return passed

    def _warm(self, clock: Array, drawn: Array) -> Array:
        """(n,) the temperature above that at the start [K]: a rate that wanders, summed up."""
        parameters = self._parameters
        spread = parameters.warming_rate
        warmth = np.empty(len(clock))
        if self._last is None:
            start, self._rate = float(clock[0]), spread * float(drawn[0])
        else:
            start = self._last[0]
        steps = np.diff(clock, prepend=start)
        state = np.array([self._rate, self.warmth])
        _wander(steps, drawn, spread, parameters.thermal_time, state, warmth)
        self._rate, self.warmth = state.tolist()
        return warmth


@compiled
def saturated(newtons: float, limit: float) -> float:
    """A reading that bends towards its range: x / (1 + (x / limit)^4)^(1/4).

    Down to 85 % of its slope at 4.5 N of 7.35 N, and to 48 % at 7 N: where the data sheet sees
    the slope change.

    Args:
        newtons: unlimited [N].
        limit: that is never passed [N].

    Returns:
        The reading [N].
    """
    square = (newtons / limit) ** 2
    return newtons / math.sqrt(math.sqrt(1.0 + square * square))


@compiled
def _count(
    forces: Array,
    warmth: Array,
    noise: Array,
    taxels: Taxels,
    limits: Array,
    scales: Array,
    counts: Counts,
) -> None:
    """Cross-talk and gain, range, baseline, temperature, noise, and whole counts."""
    n, n_taxels, n_axes = forces.shape
    for k in range(n):
        for i in range(n_taxels):
            for axis in range(n_axes):
                newtons = 0.0
                for other in range(n_axes):
                    newtons += taxels.mixing[i, axis, other] * forces[k, i, other]
                value = saturated(newtons, limits[axis]) * scales[axis]
                value += taxels.baseline[i, axis] + warmth[k] * taxels.thermal[i, axis]
                value += noise[k, i * n_axes + axis]
                counts[k, i, axis] = min(max(np.rint(value), 0.0), UINT16_MAX)


@compiled
def _follow(
    forces: Array,
    steps: Array,
    before: Array,
    state: Array,
    shares: Array,
    taus: Array,
    passed: Array,
) -> None:
    """The sum of a prompt part and low-pass parts; `state` (n_lags, n_taxels, 3) is written.

    Over a step h of a force from u to v: y <- e y + (g - e) u + (1 - g) v, with
    e = exp(-h / tau) and g = (1 - e) tau / h.
    """
    n, n_taxels, n_axes = forces.shape
    prompt = 1.0 - shares.sum()
    for k in range(n):
        earlier = before if k == 0 else forces[k - 1]
        passed[k] = prompt * forces[k]
        for lag in range(len(taus)):
            ratio = steps[k] / taus[lag]
            keep = np.exp(-ratio)
            mean = 1.0 if ratio == 0.0 else -np.expm1(-ratio) / ratio
            for i in range(n_taxels):
                for axis in range(n_axes):
                    late = keep * state[lag, i, axis]
                    late += (mean - keep) * earlier[i, axis] + (1 - mean) * forces[k, i, axis]
                    state[lag, i, axis] = late
                    passed[k, i, axis] += shares[lag] * late


@compiled
def _wander(
    steps: Array, drawn: Array, spread: float, tau: float, state: Array, warmth: Array
) -> None:
    """Rate [K/s] and temperature [K] in `state`, which is written; the first step may be 0."""
    for k in range(len(steps)):
        keep = np.exp(-steps[k] / tau)
        rate = keep * state[0] + np.sqrt(1 - keep * keep) * spread * drawn[k]
        state[1] += 0.5 * (state[0] + rate) * steps[k]
        state[0] = rate
        warmth[k] = state[1]
