"""Readout of a uSkin fingertip: silicone, magnets, temperature, noise and whole counts."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.uskin_parameters import UskinParameters

Counts = npt.NDArray[np.uint16]

ROUNDING_VARIANCE = 1 / 12
"""Variance of rounding to whole counts [count^2]."""
UINT16_MAX = 65535.0


class Taxels(NamedTuple):
    """Fixed properties of the taxels of one fingertip.

    Attributes:
        mixing: (n_taxels, 3, 3) gain and cross-talk, from a force to a reading by axis.
        baseline: (n_taxels, 3) reading at rest [count].
        thermal: (n_taxels, 3) drift of the baseline [count/K].
    """

    mixing: Array
    baseline: Array
    thermal: Array


class Readout:
    """Run of one fingertip, with the state of its silicone and its temperature.

    Attributes:
        warmth: temperature above that at the start [K].
    """

    def __init__(
        self, parameters: UskinParameters, taxels: Taxels, generator: np.random.Generator
    ) -> None:
        self.warmth = 0.0
        self._parameters = parameters
        self._taxels = taxels
        self._generator = generator
        self._rate = 0.0
        self._last: tuple[float, Array, Array] | None = None  # time, force and delayed parts

    def counts(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> Counts:
        """Compute the next samples; arguments, result and errors are those of `Uskin.counts`."""
        forces, clock = self._checked(taxel_forces, times)
        if not len(clock):
            return np.zeros(forces.shape, dtype=np.uint16)
        parameters = self._parameters
        drawn = self._generator.standard_normal((len(clock), 1 + self._taxels.baseline.size))
        warmth = self._temperature(clock, drawn[:, 0])
        passed = self._delayed(forces, clock)
        white = np.sqrt(max(parameters.noise_counts**2 - ROUNDING_VARIANCE, 0.0))
        limits, scales = np.array(parameters.limits), np.array(parameters.counts_per_newton)
        counts = np.empty(forces.shape, dtype=np.uint16)
        _write_counts(passed, warmth, white * drawn[:, 1:], self._taxels, limits, scales, counts)
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
            raise ValueError("increasing times expected")
        return forces, clock

    def _delayed(self, forces: Array, clock: Array) -> Array:
        """Return the forces after the silicone, which delays parts of them.

        The result is exact for forces that are linear between samples.
        """
        shares = np.array(self._parameters.lag_shares)
        taus = np.array(self._parameters.lag_times)
        if self._last is None:
            state = np.repeat(forces[None, 0], len(taus), axis=0)
            self._last = (float(clock[0]), forces[0], state)
        last, force, state = self._last
        passed = np.empty_like(forces)
        _low_pass(forces, np.diff(clock, prepend=last), force, state, shares, taus, passed)
        self._last = (float(clock[-1]), forces[-1].copy(), state)
        return passed

    def _temperature(self, clock: Array, drawn: Array) -> Array:
        """Return the temperature above that at the start, (n,) [K]: an integrated random rate."""
        parameters = self._parameters
        spread = parameters.warming_rate
        warmth = np.empty(len(clock))
        if self._last is None:
            start, self._rate = float(clock[0]), spread * float(drawn[0])
        else:
            start = self._last[0]
        steps = np.diff(clock, prepend=start)
        state = np.array([self._rate, self.warmth])
        _advance_warming(steps, drawn, spread, parameters.thermal_time, state, warmth)
        self._rate, self.warmth = state.tolist()
        return warmth


@compiled
def saturated(newtons: float, limit: float) -> float:
    """Return a reading that saturates at a limit: x / (1 + (x / limit)^4)^(1/4).

    With a limit of 7.35 N the slope falls to 85 % at 4.5 N and to 48 % at 7 N, where the data
    sheet shows a change of slope.

    Args:
        newtons: reading without a limit [N].
        limit: limit of the reading [N].

    Returns:
        The saturated reading [N].
    """
    square = (newtons / limit) ** 2
    return newtons / math.sqrt(math.sqrt(1.0 + square * square))


@compiled
def _write_counts(
    forces: Array,
    warmth: Array,
    noise: Array,
    taxels: Taxels,
    limits: Array,
    scales: Array,
    counts: Counts,
) -> None:
    """Write counts: cross-talk and gain, range, baseline, temperature, noise, rounding."""
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
def _low_pass(
    forces: Array,
    steps: Array,
    before: Array,
    state: Array,
    shares: Array,
    taus: Array,
    passed: Array,
) -> None:
    """Write the sum of a prompt part and low-pass parts; advance `state` (n_lags, n_taxels, 3).

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
def _advance_warming(
    steps: Array, drawn: Array, spread: float, tau: float, state: Array, warmth: Array
) -> None:
    """Advance rate [K/s] and temperature [K] in `state`; the first step may be 0."""
    for k in range(len(steps)):
        keep = np.exp(-steps[k] / tau)
        rate = keep * state[0] + np.sqrt(1 - keep * keep) * spread * drawn[k]
        state[1] += 0.5 * (state[0] + rate) * steps[k]
        state[0] = rate
        warmth[k] = state[1]
