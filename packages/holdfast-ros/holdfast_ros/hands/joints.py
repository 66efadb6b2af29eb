"""The joints of a hand: their order and names, and their states. No I/O."""

from collections.abc import Mapping, Sequence

import numpy as np

from holdfast.sensors.types import Array
from holdfast_grip.command import GripCommand
from holdfast_ros.topic_messages import JointStates


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
        self._joints = [
            (finger, joint) for finger, names in joints.items() for joint in range(len(names))
        ]

    def values(self, by_finger: Mapping[str, Sequence[float]]) -> Array:
        """Return the values (n_joints,) of all joints in this order."""
        return np.array([value for name in self.fingers for value in by_finger[name]])

    def scales(self, command: GripCommand) -> Array:
        """Return the force scale (n_joints,) of each joint; 1 for fingers without a command."""
        commands = [command.fingers.get(finger) for finger, _ in self._joints]
        return np.array(
            [1.0 if joint_command is None else joint_command.scale for joint_command in commands]
        )

    def describe(self, joint: int) -> str:
        """Return the finger and the number of a joint in it, from 0: "index joint 2"."""
        finger, number = self._joints[joint]
        return f"{finger} joint {number}"

    def sort(self, states: JointStates) -> JointStates:
        """Return the states of the joints in this order.

        States without names, of as many joints, have this order already.

        Raises:
            ValueError: a joint of the hand is missing, or a value is not finite.
        """
        names, n = states.names, len(states.positions)
        if not names and n == len(self.names):
            indices = list(range(n))
        # A publisher may name more joints than it sends positions of.
        elif missing := [name for name in self.names if name not in names[:n]]:
            have = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
            raise ValueError(f"no joint {missing[0]} (there are {have or 'no names'})")
        else:
            indices = [names.index(name) for name in self.names]
        efforts = states.efforts[indices] if len(states.efforts) >= n else states.efforts[:0]
        sorted_states = JointStates(self.names, states.positions[indices], efforts)
        for values in sorted_states[1:]:
            if not np.isfinite(np.asarray(values)).all():
                raise ValueError("a value is not finite")
        return sorted_states
