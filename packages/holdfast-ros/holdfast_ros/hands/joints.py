"""The joints of a hand: order and names; limits and torques of an Allegro hand. No I/O."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from holdfast.sensors.types import Array
from holdfast_grip.command import GripCommand
from holdfast_ros.topic_messages import JointStates

N_JOINTS = 16
JOINTS_PER_FINGER = 4
THUMB_FIRST = ("thumb", "index", "middle", "ring")
"""Order of the fingers in ROS 2 (V4 and Plexus)."""
THUMB_LAST = ("index", "middle", "ring", "thumb")
"""Order of the fingers in the driver of ROS 1."""

ByFinger = Mapping[str, tuple[float, ...]]
"""Values of the four joints of each finger."""


def table_of(finger: tuple[float, ...], **others: tuple[float, ...]) -> ByFinger:
    """Return the values of each finger; those of `finger` but for the others."""
    return {name: others.get(name, finger) for name in THUMB_FIRST}


V4_MAX_TORQUE = table_of((0.3125, 0.5625, 0.375, 0.2375), thumb=(0.4375, 0.3375, 0.225, 0.225))
"""Torque at which the driver of V4 clamps each joint [N m]."""
ROS1_STIFFNESS = table_of((4000 / 1200,) * 4)
"""Proportional gain of the position control of V4 in ROS 1 (gains_pd.yaml) [N m/rad]."""
ROS2_STIFFNESS = table_of((0.4167, 0.6667, 0.75, 0.4167), thumb=(0.8333, 0.5833, 0.5, 0.5))
"""Proportional gain of the position control of V4 in ROS 2 (pd_gains.yaml) [N m/rad]."""
V4_LOWEST = table_of((-0.47, -0.196, -0.174, -0.227), thumb=(0.263, -0.105, -0.189, -0.162))
V4_HIGHEST = table_of((0.47, 1.61, 1.709, 1.618), thumb=(1.396, 1.163, 1.644, 1.719))
"""Limits of the joints of V4 [rad]; those in the table of the twin."""
WIDEST = table_of((np.pi,) * 4)
"""Limits of joints whose limits are not known, to both sides of 0 [rad]: a reading that is wrong
by a whole turn is always beyond them."""
LIMIT_TOLERANCE = 0.1
"""Angle by which a reading may be beyond the limits of its joint [rad]: hands are calibrated by
eye, and their stops yield."""
V4_HOME = {
    name: tuple(float(np.deg2rad(angle)) for angle in degrees)
    for name, degrees in table_of(
        (0, -10, 45, 45), ring=(5, -5, 50, 45), thumb=(60, 25, 15, 45)
    ).items()
}
"""Home pose of the vendor's drivers [rad]."""


class JointOrder:
    """Order and names of the joints in the messages of a hand.

    Args:
        joints: names of the joints of each finger, in the order of the messages.

    Attributes:
        fingers: names of the fingers.
        names: names of all joints.

    Example:
        >>> JointOrder({"thumb": ["th_1", "th_2"], "index": ["if_1"]}).describe(1)
        'thumb joint 1'
    """

    def __init__(self, joints: Mapping[str, Sequence[str]]) -> None:
        self.fingers = tuple(joints)
        self.names = tuple(name for names in joints.values() for name in names)
        self._places = [
            (finger, joint) for finger, names in joints.items() for joint in range(len(names))
        ]

    def values(self, by_finger: ByFinger) -> Array:
        """Return the values (n_joints,) of all joints in this order."""
        return np.array([value for name in self.fingers for value in by_finger[name]])

    def scales(self, command: GripCommand) -> Array:
        """Return the force scale (n_joints,) of each joint; 1 for fingers without a command."""
        commands = [command.fingers.get(finger) for finger, _ in self._places]
        return np.array([1.0 if one is None else one.scale for one in commands])

    def describe(self, joint: int) -> str:
        """Return the finger and the number of a joint in it, from 0: "index joint 2"."""
        finger, number = self._places[joint]
        return f"{finger} joint {number}"

    def sort(self, states: JointStates) -> JointStates:
        """Return the states of the joints in this order.

        States without names, of as many joints, have this order already.

        Raises:
            ValueError: a joint of the hand is missing, or a value is not finite.
        """
        names, n = states.names, len(states.positions)
        if not names and n == len(self.names):
            places = list(range(n))
        # A publisher may name more joints than it sends positions of.
        elif missing := [name for name in self.names if name not in names[:n]]:
            have = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
            raise ValueError(f"no joint {missing[0]} (there are {have or 'no names'})")
        else:
            places = [names.index(name) for name in self.names]
        efforts = states.efforts[places] if len(states.efforts) >= n else states.efforts[:0]
        sorted_states = JointStates(self.names, states.positions[places], efforts)
        for values in sorted_states[1:]:
            if not np.isfinite(np.asarray(values)).all():
                raise ValueError("a value is not finite")
        return sorted_states


def allegro_order(fingers: Sequence[str], prefix: str) -> JointOrder:
    """Return the order of the 16 joints of an Allegro hand.

    Args:
        fingers: the four fingers in the order of the messages; four joints of each follow.
        prefix: begin of the names of the joints. After it follow finger and joint if the thumb
            is first (`ah_joint00`), otherwise the number and `.0` (`joint_0.0`).

    Example:
        >>> allegro_order(THUMB_FIRST, "ah_joint").names[4:6]
        ('ah_joint10', 'ah_joint11')
        >>> allegro_order(THUMB_LAST, "joint_").names[4:6]
        ('joint_4.0', 'joint_5.0')
    """
    thumb_first = fingers[0] == "thumb"
    return JointOrder(
        {
            finger: [
                f"{prefix}{place}{joint}"
                if thumb_first
                else f"{prefix}{JOINTS_PER_FINGER * place + joint}.0"
                for joint in range(JOINTS_PER_FINGER)
            ]
            for place, finger in enumerate(fingers)
        }
    )


class JointGrip(NamedTuple):
    """Pose and torques of a hand when the grip began, in the order of its messages.

    Attributes:
        positions: angles (n_joints,) [rad]; NaN if they are not measured.
        torques: torques (n_joints,) [N m].
    """

    positions: Array
    torques: Array
