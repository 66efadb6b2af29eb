"""The uSkin fingertip: from the forces on the nodes of its skin to the counts that it sends.

Silicone spreads a force over the taxels and follows it late; the field of a displaced magnet
mixes the axes and ends at a range; temperature moves the baseline; noise and a step of one
count come last.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.twin.uskin_parameters import UskinParameters
from holdfast.twin.uskin_readout import Counts, Readout, Taxels

STRAY = 0.45
"""Part of a period that a packet's stamp strays at most: stamps keep their order."""


def taxel_shares(nodes: npt.ArrayLike, taxels: npt.ArrayLike, spread: float) -> Array:
    """How the force on each node is shared among the taxels: rows sum to 1.

    A bell over the distance, made a partition of unity so that no force is lost or gained:
    w_ni = exp(-|p_n - p_i|^2 / (2 s^2)) / sum_j exp(-|p_n - p_j|^2 / (2 s^2)). The outer walls
    of the fingertip are ten spreads apart: nothing crosses.

    Args:
        nodes: (n, 3) positions of the nodes [m].
        taxels: (n_taxels, 3) positions of the taxels in the same frame [m].
        spread: standard deviation of the bell [m].

    Returns:
        (n, n_taxels).

    Example:
        >>> taxel_shares([[1e-3, 0, 0]], [[0, 0, 0], [2e-3, 0, 0]], 2.8e-3).tolist()
        [[0.5, 0.5]]
    """
    between = np.asarray(nodes, dtype=float)[:, None] - np.asarray(taxels, dtype=float)
    exponent = -0.5 * (between**2).sum(axis=2) / spread**2
    bell = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    shares: Array = bell / bell.sum(axis=1, keepdims=True)
    return shares


class Uskin:
    """One fingertip: gains, cross-talk, baselines and thermal behaviour of each taxel are fixed.

    Attributes:
        parameters: what it was made from.
        sensor: where its taxels are.
        shares: (n_nodes, n_taxels) of the force on a node.
        taxels: what is fixed of each taxel.
    """

    def __init__(
        self,
        parameters: UskinParameters,
        sensor: Sensor,
        nodes: npt.ArrayLike,
        generator: np.random.Generator,
    ) -> None:
        """Draw the properties of its taxels.

        Args:
            parameters: of the kind of sensor.
            sensor: poses of the taxels.
            nodes: (n_nodes, 3) of the skin in the fingertip frame [m].
            generator: of all that is drawn; the same state gives the same sensor and counts.
        """
        self.parameters = parameters
        self.sensor = sensor
        self.shares = taxel_shares(nodes, sensor.positions, parameters.spread)
        self.taxels = _drawn(parameters, sensor.n_taxels, generator)
        self._generator = generator

    def taxel_forces(self, node_forces: npt.ArrayLike) -> Array:
        """The true force of each taxel, in its own frame, positive when pressed.

        f_i = -R_i^T sum_n w_ni F_n. F_n acts on the fingertip: where it is pressed it points
        inwards, against the taxel's outward z, and the minus makes f_z positive. So
        sum_i R_i f_i = -sum_n F_n is the force of the finger on the object.

        Args:
            node_forces: (n_samples, n_nodes, 3) on the skin, in the fingertip frame [N].

        Returns:
            (n_samples, n_taxels, 3) [N].

        Raises:
            ValueError: another number of nodes or axes.
        """
        forces = np.asarray(node_forces, dtype=np.float64)
        if forces.ndim != 3 or forces.shape[1:] != (len(self.shares), 3):
            raise ValueError(
                f"node forces of shape (n, {len(self.shares)}, 3) expected, {forces.shape} given"
            )
        by_axis = forces.transpose(0, 2, 1).reshape(3 * len(forces), len(self.shares))
        on_taxels = (by_axis @ self.shares).reshape(len(forces), 3, self.sensor.n_taxels)
        turned = on_taxels.transpose(2, 0, 1) @ -self.sensor.rotations  # taxel first
        result: Array = np.ascontiguousarray(turned.swapaxes(0, 1))
        return result

    def readout(self, generator: np.random.Generator | None = None) -> Readout:
        """A run of the sensor from rest, to be fed in pieces of any size.

        Args:
            generator: of noise and warming; by default the one that drew the sensor.
        """
        return Readout(self.parameters, self.taxels, generator or self._generator)

    def counts(
        self,
        taxel_forces: npt.ArrayLike,
        times: npt.ArrayLike,
        generator: np.random.Generator | None = None,
    ) -> Counts:
        """What the fingertip sends for the true forces of its taxels, from first to last.

        The silicone begins at rest under the first sample's force.

        Args:
            taxel_forces: (n, n_taxels, 3) in taxel frames [N].
            times: (n,) increasing [s].
            generator: of noise and warming; by default the one that drew the sensor.

        Returns:
            (n, n_taxels, 3).

        Raises:
            ValueError: shapes contradict each other, a force or time is not finite, or times
                do not increase.
        """
        return self.readout(generator).counts(taxel_forces, times)


def _drawn(parameters: UskinParameters, n: int, generator: np.random.Generator) -> Taxels:
    """The fixed properties of `n` taxels; gains of median 1."""
    gains = np.exp(parameters.gain_spread * generator.standard_normal(n))
    axes = parameters.cross_talk * generator.standard_normal((n, 3, 3))
    axes[:, range(3), range(3)] = 1.0
    rest, warm = generator.standard_normal((2, n, 3))
    return Taxels(
        gains[:, None, None] * axes,
        parameters.baseline + rest * parameters.baseline_spread,
        parameters.thermal_counts + warm * parameters.thermal_spread,
    )


def with_server_effects(
    times: npt.ArrayLike,
    readings: npt.NDArray[Any],
    generator: np.random.Generator,
    jitter: float = 1.0e-3,
    repeat_share: float = 0.075,
) -> tuple[Array, npt.NDArray[Any]]:
    """Stamps and readings as a real server gives them: unsteady, some packets sent twice.

    Every stamp strays on its own, by a Laplace distribution, within 0.45 of a period; a packet
    that is repeated takes the place of its successor, and never thrice in a row. Defaults are
    those of five recordings of a uSkin server at 60 Hz (6 to 9 % of rows repeat one, none
    twice; steps of 3 to 24 ms, their standard deviation 1.2 to 1.5 ms).

    Args:
        times: (n,) strictly increasing [s].
        readings: (n, ...) at these times; stack fingers that come in one packet.
        generator: of what is drawn.
        jitter: standard deviation of a stamp [s].
        repeat_share: of the packets that repeat the one before, under a half.

    Returns:
        (n,) strictly increasing times [s], of which the first stays; (n, ...) readings.

    Raises:
        ValueError: a jitter below 0, a share outside [0, 0.5), times that do not increase, or
            another number of readings.

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
    stray = generator.laplace(0.0, jitter / np.sqrt(2), len(clock))
    chosen = generator.random(len(clock)) < repeat_share / (1 - repeat_share)
    stray[0], chosen[0] = 0.0, False
    room = np.minimum(np.append(steps, steps[-1]), np.insert(steps, 0, steps[0]))
    clock += np.clip(stray, -STRAY * room, STRAY * room)
    index = np.arange(len(clock))
    run = index - np.maximum.accumulate(np.where(chosen, 0, index))  # place in a run, from 1
    return clock, readings[index - run % 2]
