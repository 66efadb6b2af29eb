"""Grip force of the twin's hand as a multiple of that at the lock.

The hand of the twin is controlled by position. A finger that presses has a set-point behind the
surface of the object, and the torques of its joints follow from the distance. So a force scale s
moves the set-point along the closing path until the torque along this path is s times that at the
lock. This is what a real position controller of the hand would do, and needs only its encoders.
"""

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.control import PROPORTIONAL
from holdfast.twin.grasp import ClosingPath
from holdfast.twin.hand import FINGERS, JOINTS, N_JOINTS

SERIES_GAIN = 1.8
"""Displacement of the set-point for a given rise of torque, over that of a rigid finger and object.
The pad yields, so the joints follow their set-points in part. Measured on the twin: with it, a
scale of 2 doubles the force within 10 %."""
PATH_STEP = 1e-3
"""Part of the path from which its direction is computed [m]."""


class Pressing:
    """Displacement of the set-points by which the fingers press at the lock.

    The error of the set-points e is projected on the direction t of the closing path, with the
    gains K of the joints as weights: e_press = t (t K e) / (t K t).

    Args:
        path: closing path.
        depths: (4,) set-point of each fingertip on it [m].
        joints: (16,) joint angles [rad].
    """

    def __init__(self, path: ClosingPath, depths: Array, joints: Array) -> None:
        target = path.targets(depths)
        ahead = path.targets(depths - PATH_STEP) - path.targets(depths + PATH_STEP)
        error = target - joints
        self._pressing = np.zeros(N_JOINTS)
        self._finger = np.zeros(N_JOINTS, dtype=np.intp)
        for place, finger in enumerate(FINGERS):
            one = slice(JOINTS[finger], JOINTS[finger] + 4)
            weighted = PROPORTIONAL[one] * ahead[one]
            length = float(weighted @ ahead[one])
            share = float(weighted @ error[one]) / length if length > 0 else 0.0
            self._pressing[one] = share * ahead[one]
            self._finger[one] = place

    def displacement(self, scales: Array) -> Array:
        """Return the displacement of the set-points (16,) [rad] for force scales (4,)."""
        moved: Array = SERIES_GAIN * (scales - 1.0)[self._finger] * self._pressing
        return moved
