"""How the fingers close: a path of joints for each of them, from open to pressed in.

The object stands upright before the palm, where the pads of thumb and fingers can meet it from
two sides. A thumb that pushes straight against the fingers cannot meet it with its pad, so the
line of the grasp is turned.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from scipy.optimize import least_squares

from holdfast.sensors.values import Array
from holdfast.twin.hand import FINGERS, JOINTS, MOUNTS, N_JOINTS, HandModel
from holdfast.twin.objects import Thing, distance_to

AXIS = (0.081, 0.040)
"""Where the object's axis stands: x and z in the palm [m]; it is parallel to the palm's y."""
TURN = np.radians(117.0)
"""Direction in the palm's x-z plane along which the thumb pushes."""
THUMB_HEIGHT = 0.009
"""Of the thumb's pad above the middle of the object [m]."""
PAD = (0.0262, 0.0, 0.016)
"""The middle of the pad in the fingertip frame [m]; its normal is x."""
DEPTHS = np.linspace(0.035, -0.025, 13)
"""Gaps between pad and surface that the path goes through [m]; negative is pressed in."""
NORMAL_WEIGHT = 0.008
"""What a pad turned away by a radian counts as, in metres off the target."""
REST_WEIGHT = 0.0005
"""What a joint a radian off its place before counts as, in metres: ties redundant joints."""
MARGIN = 0.02
"""That joints keep to their limits [rad]."""


class ClosingPath(NamedTuple):
    """How joints go with the depths of the fingertips.

    Attributes:
        depths: (m,) falling gaps [m].
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
        for place, finger in enumerate(FINGERS):
            for k in range(4):
                wanted[JOINTS[finger] + k] = np.interp(
                    -depths[place], -self.depths, self.joints[place, :, k]
                )
        return wanted


def closing_path(thing: Thing, side: str = "right") -> ClosingPath:
    """The path on which a hand closes around that object.

    Raises:
        ValueError: the object cannot be grasped: a pad cannot reach it.
    """
    hand = HandModel.build(thing, side)
    joints = np.empty((len(FINGERS), len(DEPTHS), 4))
    misses, cosines = np.empty(len(FINGERS)), np.empty(len(FINGERS))
    touch = int(np.abs(DEPTHS).argmin())
    for place, finger in enumerate(FINGERS):
        push, points = _targets(thing, finger, side)
        guess = _start(hand, finger)
        for k, point in enumerate(points):
            guess = _solve(hand, place, point, push, guess)
            joints[place, k] = guess
        pad, normal = _pad(hand, place, joints[place, touch])
        misses[place] = np.linalg.norm(pad - points[touch])
        cosines[place] = normal @ push
    if misses.max() > 0.01 or cosines.min() < 0.6:
        worst = FINGERS[int(misses.argmax())]
        raise ValueError(
            f"the object {thing.name!r} cannot be grasped: the pad of the {worst} misses it by "
            f"{1e3 * misses.max():.0f} mm; half widths of 20 to 45 mm fit the hand"
        )
    return ClosingPath(DEPTHS, joints, misses, cosines)


def object_pose(thing: Thing, side: str = "right") -> tuple[Array, float]:
    """Where the object waits for the hand: position in the world [m], turn about z [rad]."""
    x, z = AXIS
    mirror = 1.0 if side == "right" else -1.0
    height = 0.0
    return np.array([x, -z, height]), mirror * thing.yaw


def _targets(thing: Thing, finger: str, side: str) -> tuple[Array, Array]:
    """Direction in which a pad pushes, and (m, 3) where it shall be, in the palm."""
    mirror = 1.0 if side == "right" else -1.0
    along = np.array([np.cos(TURN), 0.0, np.sin(TURN)])
    push = along if finger == "thumb" else -along
    heights = {
        "thumb": THUMB_HEIGHT,
        "index": thing.finger_height,
        "middle": 0.0,
        "ring": -thing.finger_height,
    }
    centre = np.array([AXIS[0], mirror * heights[finger], AXIS[1]])
    radius = _reach(thing, -push, heights[finger])
    return push, centre - push * (radius + DEPTHS[:, None])


def _reach(thing: Thing, outward: Array, height: float) -> float:
    """From the object's axis to its surface in a direction of the palm, at that height [m]."""
    distances = np.linspace(0.0, 0.09, 901)
    world = np.array([outward[0], -outward[2]])  # palm x, z to world x, y
    c, s = np.cos(thing.yaw), np.sin(thing.yaw)
    x, y = c * world[0] + s * world[1], -s * world[0] + c * world[1]
    points = np.column_stack([distances * x, distances * y, np.full(len(distances), height)])
    inside = np.flatnonzero(distance_to(thing, points) < 0)
    return float(distances[inside[-1]]) if len(inside) else 0.0


def _start(hand: HandModel, finger: str) -> Array:
    limits = hand.limits()[JOINTS[finger] : JOINTS[finger] + 4]
    if finger == "thumb":
        return np.array([1.2, 0.4, 0.2, 0.4])
    return np.clip([0.0, 0.3, 0.6, 0.5], limits[:, 0], limits[:, 1])


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
