"""Model of a fingertip whose taxels send forces in steps, such as ORCA Touch.

Shape of the fingertip, skin and grasp are the twin's; the taxels are mounted on its pad.
"""

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Sensor, sensor
from holdfast.sensors.built_in import MODULE_TO_FINGERTIP
from holdfast.sensors.types import Array
from holdfast.twin.uskin import FingertipSkin, taxel_shares
from holdfast.twin.uskin_readout import UskinParameters

FORCE_SENSORS = ("orca-finger", "orca-thumb", "orca-pinky")
"""Sensors of `ForceSkin`; x is lateral, y distal and z palmar in their frame."""
STEP_NOISE = 1 / 16
"""Rms noise of a reading before it is rounded, in steps. None is published. A sensor that shows
exact zeros at rest has little: of this, half a step is eight times as much, which an hour of all
taxels never reaches. So noise shows only where a force lies near the border of two steps."""


class ForceReadout:
    """Run of one fingertip.

    Args:
        sensor: sensor with step and range.
        generator: generator of the noise.
    """

    def __init__(self, sensor: Sensor, generator: np.random.Generator) -> None:
        self._generator = generator
        self._step, self._range = sensor.step or 1.0, sensor.range or (-np.inf, np.inf)

    def read(self, taxel_forces: npt.ArrayLike, times: npt.ArrayLike) -> Array:
        """Compute the next readings (n, n_taxels, 3) [N]; for the arguments see `Uskin.counts`."""
        steps = np.asarray(taxel_forces, dtype=np.float64) / self._step
        noise = STEP_NOISE * self._generator.standard_normal(steps.shape)
        readings: Array = np.clip(np.rint(steps + noise) * self._step, *self._range)
        return readings + 0.0  # no negative zeros


class ForceSkin(FingertipSkin):
    """One fingertip; its taxels have no gains, lag or drift, as their device is calibrated.

    Args:
        tip: a sensor of `FORCE_SENSORS`.
        nodes: (n_nodes, 3) nodes of the skin in the fingertip frame [m].
    """

    def __init__(self, tip: Sensor, nodes: npt.ArrayLike) -> None:
        shares = taxel_shares(nodes, mounted(tip), UskinParameters.spread)
        super().__init__(tip, MODULE_TO_FINGERTIP @ tip.rotations, shares)

    def readout(self, generator: np.random.Generator) -> ForceReadout:
        """Start a run of the sensor, which takes samples in chunks of any size."""
        return ForceReadout(self.sensor, generator)


def mounted(tip: Sensor) -> Array:
    """Return (n_taxels, 3) positions of the taxels on the twin's pad, in the fingertip frame [m].

    They are stretched along each axis until they extend as far as the taxels of `uskin-curved`,
    through which the surface of the twin's skin goes.

    Example:
        >>> bool(np.ptp(mounted(sensor("orca-thumb")), axis=0)[0] > 0.013)
        True
    """
    pad = sensor("uskin-curved").positions
    positions = tip.positions @ MODULE_TO_FINGERTIP.T
    result: Array = pad.min(axis=0) + (positions - positions.min(axis=0)) * (
        np.ptp(pad, axis=0) / np.ptp(positions, axis=0)
    )
    return result
