"""How the fingers close: a path of joints for each of them, from open to pressed in.

The object stands upright before the palm, where the pads of thumb and fingers can meet it from
two sides. A thumb that pushes straight against the fingers, or in the middle of the palm, cannot
meet it with its pad: the line of the grasp is turned, and the object sits above the palm's
middle. Thumb and middle finger are opposite to each other, index and ring finger above and below:
so the three fingers share the load of the thumb.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.optimize import least_squares

from holdfast.compiled import compiled
from holdfast.sensors.types import Array
from holdfast.twin.hand import FINGERS, JOINTS, MIRRORED, MOUNTS, N_JOINTS, HandModel
from holdfast.twin.objects import Thing, distance_to

PLACE = (0.108, 0.020, 0.021)
"""Where the middle of the object is in the right palm [m]; its axis is parallel to the palm's y.
With `TURN` found by search: the smallest angles between pads and surface that the joints
allow."""
TURN = np.radians(109.0)
"""Direction in the palm's x-z plane along which the thumb pushes [rad]."""
PAD = (0.0261, 0.0, 0.016)
"""The middle of the pad in the fingertip frame [m], where the skin's normal is x."""
DEPTHS = np.linspace(0.035, -0.025, 25)
"""Gaps between pad and surface that the path goes through [m]; negative is pressed in."""
NORMAL_WEIGHT = 0.008
"""What a pad turned away by a radian counts as, in metres off the target."""
REST_WEIGHT = 0.0005
"""What a joint a radian off its place before counts as, in metres: ties redundant joints."""
MARGIN = 0.03
"""That joints keep to their limits [rad]."""
SETTLE = 20
"""Solutions, each from the last, until the first of the path has come to rest."""
MOST_MISS, LEAST_COSINE = 0.005, 0.8
"""A finger whose pad touches farther off [m], or at a larger angle, does not grasp."""


class ClosingPath(NamedTuple):
    """How joints go with the depths of the fingertips.

    Attributes:
        depths: (m,) falling gaps, evenly spaced [m].
        joints: (4, m, 4) of thumb, index, middle, ring [rad].
        misses: (4,) how far off the pad is where it should touch [m].
        cosines: (4,) of the angle between the pad's normal and the push there.
    """

    depths: Array
    joints: Array
    misses: Array
    cosines: Array

    def targets(self, depths: Array) -> Array:
        """(16,) joints [rad] for the (4,) depths of the fingertips [m]."""
        wanted = np.empty(N_JOINTS)
        _interpolate(self.depths, self.joints, _FIRST, depths, wanted)
        return wanted


def closing_path(thing: Thing, side: str = "right") -> ClosingPath:
    """The path on which a hand closes around that object.

    Args:
        thing: the object.
        side: "right", or "left", which goes the mirror image of the right hand's way.

    Raises:
        ValueError: the object cannot be grasped: a pad cannot reach it. Or another side.

    Example:
        >>> from holdfast.twin.objects import thing
        >>> path = closing_path(thing("can"))
        >>> bool(path.misses.max() < 0.002)  # [m]
        True
    """
    if side not in ("right", "left"):
        raise ValueError(f"side 'right' or 'left' expected, {side!r} given")
    hand = HandModel.build(thing)
    touch = int(np.abs(DEPTHS).argmin())
    joints = np.empty((len(FINGERS), len(DEPTHS), 4))
    misses, cosines = np.empty(len(FINGERS)), np.empty(len(FINGERS))
    for place, finger in enumerate(FINGERS):
        push, points = _aims(thing, finger)
        joints[place] = _follow(hand, place, points, push)
        pad, normal = _pad(hand, place, joints[place, touch])
        misses[place] = np.linalg.norm(pad - points[touch])
        cosines[place] = normal @ push
    _check(thing, misses, cosines)
    if side == "left":
        joints *= MIRRORED.reshape(4, 1, 4)[[3, 0, 1, 2]]
    return ClosingPath(DEPTHS, joints, misses, cosines)


def object_pose(thing: Thing, side: str = "right") -> tuple[Array, float]:
    """Where the object waits for the hand: position in the world [m], turn about z [rad].

    The position is that of its centre of mass; its middle is at `PLACE`.
    """
    mirror = 1.0 if side == "right" else -1.0
    x, y, z = PLACE
    return np.array([x, -mirror * z, y - _middle(thing)]), mirror * thing.yaw


_FIRST = np.array([JOINTS[finger] for finger in FINGERS])


@compiled
def _interpolate(grid: Array, joints: Array, first: Array, depths: Array, out: Array) -> None:
    last = len(grid) - 1
    for i in range(len(first)):
        at = min(max((grid[0] - depths[i]) / (grid[0] - grid[last]), 0.0), 1.0) * last
        k = min(int(at), last - 1)
        share = at - k
        for j in range(4):
            out[first[i] + j] = (1 - share) * joints[i, k, j] + share * joints[i, k + 1, j]


def _middle(thing: Thing) -> float:
    """Height of the object's middle over its centre of mass [m]."""
    return float(thing.foot[2]) + thing.half_height


def _aims(thing: Thing, finger: str) -> tuple[Array, Array]:
    """Direction in which a pad pushes, and (m, 3) where it shall be, in the right palm."""
    along = np.array([np.cos(TURN), 0.0, np.sin(TURN)])
    push = along if finger == "thumb" else -along
    height = {"index": thing.finger_height, "ring": -thing.finger_height}.get(finger, 0.0)
    reach = _reach(thing, -push, height + _middle(thing))
    meet = np.add(PLACE, (0.0, height, 0.0)) - push * reach
    return push, meet - push * DEPTHS[:, None]


def _reach(thing: Thing, outward: Array, height: float) -> float:
    """From the object's axis to its surface in a direction of the palm, at that height [m]."""
    distances = np.linspace(0.0, 0.09, 901)
    angle = np.arctan2(-outward[2], outward[0]) - thing.yaw  # palm x, z to world x, y
    line = np.array([np.cos(angle), np.sin(angle), 0.0])
    points = distances[:, None] * line + [0.0, 0.0, height]
    inside = np.flatnonzero(distance_to(thing, points) < 0)
    return float(distances[inside[-1]]) if len(inside) else 0.0


def _follow(hand: HandModel, place: int, points: Array, push: Array) -> Array:
    """(m, 4) joints that bring the pad to the points, one from the other."""
    guess = np.array([1.2, 0.4, 0.2, 0.4] if FINGERS[place] == "thumb" else [0.0, 0.3, 0.6, 0.5])
    for _ in range(SETTLE):
        guess = _solve(hand, place, points[0], push, guess)
    joints = np.empty((len(points), 4))
    for k, point in enumerate(points):
        joints[k] = guess = _solve(hand, place, point, push, guess)
    return joints


def _solve(hand: HandModel, place: int, point: Array, push: Array, guess: Array) -> Array:
    first = JOINTS[FINGERS[place]]
    limits = hand.limits()[first : first + 4]
    low, high = limits[:, 0] + MARGIN, limits[:, 1] - MARGIN

    def residuals(joints: Array) -> Array:
        pad, normal = _pad(hand, place, joints)
        turned = NORMAL_WEIGHT * (normal - push)
        return np.concatenate([pad - point, turned, REST_WEIGHT * (joints - guess)])

    return np.asarray(least_squares(residuals, np.clip(guess, low, high), bounds=(low, high)).x)


def _pad(hand: HandModel, place: int, joints: Array) -> tuple[Array, Array]:
    """The pad's middle and normal in the palm."""
    first = JOINTS[FINGERS[place]]
    hand.data.qpos[first : first + 4] = joints
    mujoco.mj_kinematics(hand.model, hand.data)
    palm = hand.data.xmat[hand.model.body("palm").id].reshape(3, 3)
    turn = hand.data.xmat[hand.tips[place]].reshape(3, 3)
    pad = hand.data.xpos[hand.tips[place]] + turn @ (MOUNTS[place] + np.array(PAD))
    return palm.T @ pad, palm.T @ turn[:, 0]


def _check(thing: Thing, misses: Array, cosines: Array) -> None:
    worst = int(np.argmax(np.maximum(misses / MOST_MISS, (1 - cosines) / (1 - LEAST_COSINE))))
    if misses[worst] > MOST_MISS or cosines[worst] < LEAST_COSINE:
        angle = np.degrees(np.arccos(np.clip(cosines[worst], -1.0, 1.0)))
        raise ValueError(
            f"the object {thing.name!r} cannot be grasped: the pad of the {FINGERS[worst]} misses "
            f"it by {1e3 * misses[worst]:.0f} mm, at {angle:.0f} degrees; half widths of 24 to "
            "45 mm between thumb and fingers fit the hand"
        )
