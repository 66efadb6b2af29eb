"""Model of a uSkin fingertip: from the forces on the nodes of its skin to counts.

Silicone spreads a force over the taxels and delays part of it. Magnets mix the axes and saturate.
Temperature moves the baseline. Noise and rounding to whole counts come last.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.twin.uskin_readout import Counts, Readout, Taxels, UskinParameters

MAX_STAMP_SHIFT = 0.45
"""Maximum shift of a packet's stamp, in periods; below a half, so stamps keep their order."""


def taxel_shares(nodes: npt.ArrayLike, taxels: npt.ArrayLike, spread: float) -> Array:
    """Compute the shares of the taxels in the force on each node; each row sums to 1.

    A Gaussian of the distance, normalised so that no force is lost or gained:
    w_ni = exp(-|p_n - p_i|^2 / (2 s^2)) / sum_j exp(-|p_n - p_j|^2 / (2 s^2)). The outer walls
    of the fingertip are ten standard deviations apart, so no force passes between them.

    Args:
        nodes: (n, 3) positions of the nodes [m].
        taxels: (n_taxels, 3) positions of the taxels in the same frame [m].
        spread: standard deviation of the Gaussian [m].

    Returns:
        Shares, (n, n_taxels).

    Example:
        >>> taxel_shares([[1e-3, 0, 0]], [[0, 0, 0], [2e-3, 0, 0]], 2.8e-3).tolist()
        [[0.5, 0.5]]
    """
    between = np.asarray(nodes, dtype=float)[:, None] - np.asarray(taxels, dtype=float)
    exponent = -0.5 * (between**2).sum(axis=2) / spread**2
    bell = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    shares: Array = bell / bell.sum(axis=1, keepdims=True)
    return shares


class FingertipSkin:
    """One fingertip, from the forces on the nodes of its skin to readings.

    Args:
        sensor: sensor with the poses of the taxels.
        rotations: (n_taxels, 3, 3) from taxel frame to the twin's fingertip frame.
        shares: (n_nodes, n_taxels) shares of the taxels in the force on a node.
    """

    def __init__(self, sensor: Sensor, rotations: Array, shares: Array) -> None:
        self.sensor, self.shares, self._rotations = sensor, shares, rotations

    def taxel_forces(self, node_forces: npt.ArrayLike) -> Array:
        """Compute the true force of each taxel in its own frame, positive when pressed.

        f_i = -R_i^T sum_n w_ni F_n. F_n acts on the fingertip. Under pressure it points inwards,
        against the taxel's outward z, so the minus sign makes f_z positive, and
        sum_i R_i f_i = -sum_n F_n is the force of the finger on the object.

        Args:
            node_forces: (n_samples, n_nodes, 3) forces on the skin in the fingertip frame [N].

        Returns:
            Forces, (n_samples, n_taxels, 3) [N].

        Raises:
            ValueError: the array has another number of nodes or axes.
        """
        forces = np.asarray(node_forces, dtype=np.float64)
        if forces.ndim != 3 or forces.shape[1:] != (len(self.shares), 3):
            raise ValueError(
                f"node forces of shape (n, {len(self.shares)}, 3) expected, {forces.shape} given"
            )
        by_axis = forces.transpose(0, 2, 1).reshape(3 * len(forces), len(self.shares))
        on_taxels = (by_axis @ self.shares).reshape(len(forces), 3, self.sensor.n_taxels)
        turned = on_taxels.transpose(2, 0, 1) @ -self._rotations  # taxel first
        result: Array = np.ascontiguousarray(turned.swapaxes(0, 1))
        return result


class Uskin(FingertipSkin):
    """Fingertip with fixed gains, cross-talk, baselines and thermal behaviour of each taxel.

    Attributes:
        parameters: parameters of this kind of sensor.
        taxels: fixed properties of the taxels.
    """

    def __init__(
        self,
        parameters: UskinParameters,
        sensor: Sensor,
        nodes: npt.ArrayLike,
        generator: np.random.Generator,
    ) -> None:
        """Draw the properties of the taxels.

        Args:
            parameters: parameters of this kind of sensor.
            sensor: sensor with the poses of the taxels.
            nodes: (n_nodes, 3) nodes of the skin in the fingertip frame [m].
            generator: random number generator; the same state gives the same sensor and counts.
        """
        shares = taxel_shares(nodes, sensor.positions, parameters.spread)
        super().__init__(sensor, sensor.rotations, shares)
        self.parameters = parameters
        # The order of the draws is part of the seed; still taxels have a generator of their own, so
        # that they leave it as it is. Gains have the median 1.
        n = sensor.n_taxels
        gains = np.exp(parameters.gain_spread * generator.standard_normal(n))
        axes = parameters.cross_talk * generator.standard_normal((n, 3, 3))
        axes[:, range(3), range(3)] = 1.0
        rest, warm = generator.standard_normal((2, n, 3))
        still = generator.spawn(1)[0].random(n) < parameters.still_share
        self.taxels = Taxels(
            gains[:, None, None] * axes,
            parameters.baseline + rest * parameters.baseline_spread,
            parameters.thermal_counts + warm * parameters.thermal_spread,
            np.where(still, 0.0, 1.0),
        )
        self._generator = generator

    def readout(self, generator: np.random.Generator | None = None) -> Readout:
        """Start a run of the sensor from rest, which takes samples in chunks of any size.

        Args:
            generator: generator of noise and warming; by default the sensor's.
        """
        return Readout(self.parameters, self.taxels, generator or self._generator)

    def counts(
        self,
        taxel_forces: npt.ArrayLike,
        times: npt.ArrayLike,
        generator: np.random.Generator | None = None,
    ) -> Counts:
        """Compute the counts that the fingertip sends for the true forces of its taxels.

        At the start the silicone is at rest under the first sample's force.

        Args:
            taxel_forces: (n, n_taxels, 3) forces in taxel frames [N].
            times: (n,) increasing times [s].
            generator: generator of noise and warming; by default that of the sensor.

        Returns:
            Counts, (n, n_taxels, 3).

        Raises:
            ValueError: the shapes do not agree, a force or time is not finite, or the times do
                not increase.
        """
        return self.readout(generator).read(taxel_forces, times)


def with_server_effects(
    times: npt.ArrayLike,
    readings: npt.NDArray[Any],
    generator: np.random.Generator,
    jitter: float = 1.0e-3,
    repeat_share: float = 0.075,
) -> tuple[Array, npt.NDArray[Any]]:
    """Return stamps and readings like a real server's: unsteady, with repeated packets.

    Every stamp is shifted independently, by a Laplace distribution limited to 0.45 of a period.
    A repeated packet replaces its successor; no packet comes three times in a row. The defaults
    are from five recordings of a uSkin server at 60 Hz (6 to 9 % of the packets repeat the one
    before, none twice; steps of 3 to 24 ms, standard deviation 1.2 to 1.5 ms).

    Args:
        times: (n,) strictly increasing times [s].
        readings: (n, ...) readings at these times; stack fingers that come in one packet.
        generator: random number generator.
        jitter: standard deviation of a stamp [s].
        repeat_share: share of packets that repeat the one before, below 0.5.

    Returns:
        Strictly increasing times (n,) [s], the first unchanged, and readings (n, ...).

    Raises:
        ValueError: the jitter is below 0, the share is not in [0, 0.5), the times do not
            increase, or their number is not that of the readings.

    Example:
        >>> import numpy as np
        >>> times, readings = np.arange(600) / 150, np.arange(600)
        >>> _, sent = with_server_effects(times, readings, np.random.default_rng(1))
        >>> int((np.diff(sent) == 0).sum())
        40
    """
    clock = np.array(times, dtype=np.float64)
    steps = np.diff(clock)
    if not (jitter >= 0 and 0 <= repeat_share < 0.5):
        raise ValueError(
            f"jitter of at least 0 s and a share of repeats in [0, 0.5) expected, "
            f"{jitter} and {repeat_share} given"
        )
    if clock.shape != (len(readings),) or not (steps > 0).all():
        raise ValueError(f"{len(readings)} increasing times expected, shape {clock.shape} given")
    if len(clock) < 2:
        return clock, readings.copy()
    shift = generator.laplace(0.0, jitter / np.sqrt(2), len(clock))
    chosen = generator.random(len(clock)) < repeat_share / (1 - repeat_share)
    shift[0], chosen[0] = 0.0, False
    room = np.minimum(np.append(steps, steps[-1]), np.insert(steps, 0, steps[0]))
    clock += np.clip(shift, -MAX_STAMP_SHIFT * room, MAX_STAMP_SHIFT * room)
    index = np.arange(len(clock))
    run = index - np.maximum.accumulate(
        np.where(chosen, 0, index)
    )  # position in a run of repeats, from 1
    return clock, readings[index - run % 2]
