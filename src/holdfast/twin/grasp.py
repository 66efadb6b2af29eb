"""Closing of the fingers: a path of joint angles for each finger, from open to pressed in.

The object stands upright before the palm, where the pads of thumb and fingers can reach it from
two sides. The thumb cannot put its pad on the object when it pushes straight against the
fingers, or in the middle of the palm. So the direction of the grasp is turned, and the object is
above the middle of the palm. The middle finger is opposite to the thumb, index and ring finger
are above and below it: the three fingers share the load of the thumb.

The hand is controlled by position. A finger that presses has a set-point behind the surface of
the object, and the torques of its joints follow from the distance. So a force scale s moves the
set-point along the closing path until the torque along this path is s times that at the lock.
This is what a real position controller of the hand would do, and needs only its encoders.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from holdfast.sensors.types import Array
from holdfast.twin.control import PROPORTIONAL
from holdfast.twin.hand import FINGERS, JOINTS, MOUNTS, N_JOINTS, HandModel
from holdfast.twin.mujoco_import import mujoco
from holdfast.twin.objects import GraspObject, reach_of
from holdfast.twin.steps import fill_targets

MIDDLE_PLACE = (0.108, 0.020, 0.021)
"""Position of the object's middle in the right palm [m]; its axis is parallel to the palm's y.
This and `GRASP_DIRECTION` were found by search: the angles between pads and surface are the
smallest that the joints allow."""
GRASP_DIRECTION = np.radians(109.0)
"""Direction in the palm's x-z plane along which the thumb pushes [rad]."""
PAD_MIDDLE = (0.0261, 0.0, 0.016)
"""Middle of the pad in the fingertip frame [m], where the normal of the skin is x."""
PATH_GAPS = np.linspace(0.035, -0.025, 25)
"""Gaps between pad and surface along the path [m]; negative where it is pressed in."""
NORMAL_WEIGHT = 0.008
"""Weight of the pad's angle error against its position error [m/rad]."""
REST_WEIGHT = 0.0005
"""Weight of a joint's change against the pad's position error [m/rad]; resolves redundancy."""
JOINT_MARGIN = 0.03
"""Minimum distance of joints from their limits [rad]."""
N_SETTLE_SOLUTIONS = 20
"""Repeated solutions of the first point, each from the last, until it has converged."""
MAX_MISS, MIN_PAD_COSINE = 0.005, 0.8
"""Maximum position error [m] and minimum cosine of the angle error of a pad that grasps."""


class ClosingPath(NamedTuple):
    """Joint angles of each finger by the gap between pad and object.

    Attributes:
        depths: (m,) decreasing gaps, evenly spaced [m].
        joints: (4, m, 4) joint angles of thumb, index, middle, ring [rad].
        misses: (4,) distance of the pad from its target at the first touch [m].
        cosines: (4,) cosine of the angle between the pad's normal and the push there.
    """

    depths: Array
    joints: Array
    misses: Array
    cosines: Array

    def targets(self, depths: Array) -> Array:
        """Return joint angles (16,) [rad] for the gaps of the fingertips (4,) [m]."""
        wanted = np.empty(N_JOINTS)
        fill_targets(self.depths, self.joints, _FIRST, depths, wanted)
        return wanted


def closing_path(item: GraspObject) -> ClosingPath:
    """Compute the path on which the hand closes around an object.

    Raises:
        ValueError: a pad cannot reach the object.

    Example:
        >>> from holdfast.twin.objects import object_named
        >>> path = closing_path(object_named("can"))
        >>> bool(path.misses.max() < 0.002)  # [m]
        True
    """
    hand = HandModel.build(item)
    touch = int(np.abs(PATH_GAPS).argmin())
    joints = np.empty((len(FINGERS), len(PATH_GAPS), 4))
    misses, cosines = np.empty(len(FINGERS)), np.empty(len(FINGERS))
    for index, finger in enumerate(FINGERS):
        push, points = aims_of(item, finger)
        # Each point is solved from the last, so that the joints never jump; the first from itself,
        # until it no longer depends on the guess.
        is_thumb = finger == "thumb"
        guess = np.array([1.2, 0.4, 0.2, 0.4] if is_thumb else [0.0, 0.3, 0.6, 0.5])
        for _ in range(N_SETTLE_SOLUTIONS):
            guess = _solve(hand, index, points[0], push, guess)
        for k, point in enumerate(points):
            joints[index, k] = guess = _solve(hand, index, point, push, guess)
        pad, normal = _pad(hand, index, joints[index, touch])
        misses[index] = np.linalg.norm(pad - points[touch])
        cosines[index] = normal @ push
    worst = int(np.argmax(np.maximum(misses / MAX_MISS, (1 - cosines) / (1 - MIN_PAD_COSINE))))
    if misses[worst] > MAX_MISS or cosines[worst] < MIN_PAD_COSINE:
        off = np.degrees(np.arccos(np.clip(cosines[worst], -1.0, 1.0)))
        raise ValueError(
            f"the object {item.name!r} cannot be grasped: the pad of the {FINGERS[worst]} misses "
            f"it by {1e3 * misses[worst]:.0f} mm, at {off:.0f} degrees; half widths of 24 to "
            "45 mm between thumb and fingers fit the hand"
        )
    return ClosingPath(PATH_GAPS, joints, misses, cosines)


def aims_of(item: GraspObject, finger: str) -> tuple[Array, Array]:
    """Return direction of the push and targets (m, 3) [m] of a pad in the right palm."""
    along = np.array([np.cos(GRASP_DIRECTION), 0.0, np.sin(GRASP_DIRECTION)])
    push = along if finger == "thumb" else -along
    height = {"index": item.finger_height, "ring": -item.finger_height}.get(finger, 0.0)
    angle = np.arctan2(push[2], -push[0]) - item.yaw  # palm x, z to world x, y
    outward = np.array([np.cos(angle), np.sin(angle), 0.0])
    reach = reach_of(item, outward, height + item.middle)
    reach = 0.0 if np.isnan(reach) else reach  # over or under the object: its axis
    meet = np.add(MIDDLE_PLACE, (0.0, height, 0.0)) - push * reach
    return push, meet - push * PATH_GAPS[:, None]


def object_pose(item: GraspObject) -> tuple[Array, float]:
    """Return position in the world [m] and turn about z [rad] of the object before the grasp.

    The position is the place of its centre of mass; its middle is at `MIDDLE_PLACE`.
    """
    x, y, z = MIDDLE_PLACE
    return np.array([x, -z, y - item.middle]), item.yaw


_FIRST = np.array([JOINTS[finger] for finger in FINGERS], np.intc)


def _solve(hand: HandModel, index: int, point: Array, push: Array, guess: Array) -> Array:
    first = JOINTS[FINGERS[index]]
    limits = hand.limits()[first : first + 4]
    low, high = limits[:, 0] + JOINT_MARGIN, limits[:, 1] - JOINT_MARGIN

    # Three unknown angles more than a point has coordinates: the normal, and a joint that stays
    # where it is, decide among the solutions that reach the point.
    def residuals(joints: Array) -> Array:
        pad, normal = _pad(hand, index, joints)
        turned = NORMAL_WEIGHT * (normal - push)
        return np.concatenate([pad - point, turned, REST_WEIGHT * (joints - guess)])

    return np.asarray(least_squares(residuals, np.clip(guess, low, high), bounds=(low, high)).x)


def _pad(hand: HandModel, index: int, joints: Array) -> tuple[Array, Array]:
    """Return middle and normal of the pad in the palm."""
    first = JOINTS[FINGERS[index]]
    hand.data.qpos[first : first + 4] = joints
    mujoco.mj_kinematics(hand.model, hand.data)
    palm = hand.data.xmat[hand.model.body("palm").id].reshape(3, 3)
    turn = hand.data.xmat[hand.tips[index]].reshape(3, 3)
    pad = hand.data.xpos[hand.tips[index]] + turn @ (MOUNTS[index] + np.array(PAD_MIDDLE))
    return palm.T @ pad, palm.T @ turn[:, 0]


SERIES_GAIN = 1.8
"""Displacement of the set-point for a rise of torque, over that of rigid fingers and objects.
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
        for index, finger in enumerate(FINGERS):
            joints_of_finger = slice(JOINTS[finger], JOINTS[finger] + 4)
            weighted = PROPORTIONAL[joints_of_finger] * ahead[joints_of_finger]
            length = float(weighted @ ahead[joints_of_finger])
            share = float(weighted @ error[joints_of_finger]) / length if length > 0 else 0.0
            self._pressing[joints_of_finger] = share * ahead[joints_of_finger]
            self._finger[joints_of_finger] = index

    def displacement(self, scales: Array) -> Array:
        """Return the displacement of the set-points (16,) [rad] for force scales (4,)."""
        moved: Array = SERIES_GAIN * (scales - 1.0)[self._finger] * self._pressing
        return moved
