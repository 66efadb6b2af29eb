"""Hands that take one number: the envelop grasp of the vendor, and grippers by effort or width."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands.local import largest_scale
from holdfast_grip.limits import SLACK, Limits
from holdfast_ros.hands.ros_hand import RosHand
from holdfast_ros.link import Link
from holdfast_ros.topic_messages import (
    FLOAT_ARRAY,
    GRIPPER_COMMAND,
    JOINT_TRAJECTORY,
    STRING,
    JointStates,
    array_message,
    gripper_message,
    number_message,
    trajectory_message,
)

HOME = "home"
"""Word that opens an Allegro hand, for its drivers."""


@dataclass(frozen=True)
class ScalarSetup:
    """Description of a hand that takes one number.

    Attributes:
        topic: topic of the commands.
        message: its message type.
        effort: value when the grip begins [unit of the driver].
        max_effort: ceiling of the value.
        open_value: value that opens the hand, if it has no topic for words.
        word_topic: topic on which the word `home` opens the hand; None if there is none.
        fingers: fingers of the hand; None for any.
        closed: position that a `GripperCommand` closes to, beyond any object [m]. `open_value` is
            a position too then.
    """

    topic: str
    message: str
    effort: float
    max_effort: float
    open_value: float
    word_topic: str | None
    fingers: tuple[str, ...] | None
    closed: float = 0.0

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic that is published, that of the commands first."""
        topics = {self.topic: self.message}
        if self.word_topic is not None:
            topics[self.word_topic] = STRING
        return topics


class ScalarHand(RosHand):
    """Hand that takes one number: the value of the grip times the largest scale of all fingers.

    Args:
        name: URI of the hand.
        link: connection to ROS.
        setup: description of the hand.
        shared: as of `RosHand`.
    """

    def __init__(self, name: str, link: Link, setup: ScalarSetup, *, shared: bool) -> None:
        super().__init__(name, link, setup.topics, None, shared=shared)
        self.fingers = setup.fingers
        self._setup = setup

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the fingers, and the value at the highest scale.

        Raises:
            ValueError: the hand lacks a finger, or the value exceeds its ceiling.
        """
        super().check(limits, fingers)
        if problem := self._excess(self._setup.effort * limits.max_scale):
            raise ValueError(f"{problem} at max_scale {limits.max_scale:g}: lower one of them")

    def _content(self, command: GripCommand) -> object:
        return command.release, None if command.release else largest_scale(command)

    def _press(self, command: GripCommand) -> None:
        value = self._setup.effort * largest_scale(command)
        if problem := self._excess(value):
            raise HandError(problem)
        self._publish(self._setup.topic, self._message(self._setup.closed, value))

    def _message(self, position: float, value: float) -> dict[str, Any]:
        """Return the message of a value, at a position where the driver takes one [m]."""
        if self._setup.message == GRIPPER_COMMAND:
            return gripper_message(position, value)
        return number_message(value)

    def _release(self) -> None:
        if self._setup.word_topic is not None:
            self._publish(self._setup.word_topic, {"data": HOME})
        else:
            setup, moves = self._setup, self._setup.message == GRIPPER_COMMAND
            # A gripper that moves to a position needs an effort to open, too.
            value = setup.effort if moves else setup.open_value
            self._publish(setup.topic, self._message(setup.open_value, value))

    def _excess(self, value: float) -> str:
        """Return a message about a value that exceeds its ceiling; empty if it does not."""
        highest = self._setup.max_effort
        if abs(value) <= highest * (1.0 + SLACK):
            return ""
        return f"{self.name}: an effort of at most {highest:g} expected, {value:g} given"


POSITION_TOLERANCE = 0.05
"""Share of the stroke by which a reading may be beyond it: zeros are set by eye, stops yield."""


@dataclass(frozen=True)
class WidthSetup:
    """Description of a parallel gripper that takes a width.

    Attributes:
        topic: topic of the commands.
        message: its message type.
        joint: name of the joint whose position is the width, in commands and joint states.
        states: topic of the joint states.
        effort: force of the grip when it begins [N].
        max_effort: ceiling of the force [N].
        stiffness: force that is added for each metre by which the commanded width is smaller, of
            pads and gripper together [N/m].
        gain: force of the gripper's own position control for each metre between the commanded
            width and the real one [N/m]; infinite if it reaches the width it is commanded to.
        open_position: position of the open gripper [unit of the driver].
        closed_position: position of the closed one.
        stroke: width between the two [m].
    """

    topic: str
    message: str
    joint: str
    states: str
    effort: float
    max_effort: float
    stiffness: float
    gain: float
    open_position: float
    closed_position: float
    stroke: float

    def width(self, position: float) -> float:
        """Return the width at a position [m]."""
        travel = self.open_position - self.closed_position
        return (position - self.closed_position) / travel * self.stroke

    def position(self, width: float) -> float:
        """Return the position of a width [m], which is kept within the stroke."""
        share = min(max(width / self.stroke, 0.0), 1.0)
        return self.closed_position + share * (self.open_position - self.closed_position)

    def closing(self, scale: float) -> float:
        """Return by how much a commanded width is below that at the beginning of the grip [m].

        The gripper's own control needs effort / gain to keep the first force, and each newton
        more needs 1 / stiffness.
        """
        return self.effort / self.gain + (scale - 1.0) * self.effort / self.stiffness


class WidthHand(RosHand):
    """Gripper that takes a width, for the largest scale of all fingers.

    Args:
        name: URI of the hand.
        link: connection to ROS.
        setup: description of the gripper.
        shared: as of `RosHand`.

    Attributes:
        setup: description of the gripper.
    """

    def __init__(self, name: str, link: Link, setup: WidthSetup, *, shared: bool) -> None:
        topics = {setup.topic: setup.message}
        super().__init__(name, link, topics, setup.states, shared=shared)
        self.setup = setup
        self._max_scale = 1.0
        self._begin_width = 0.0

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the force and the travel at the highest scale.

        Raises:
            ValueError: one of them is more than the gripper has.
        """
        super().check(limits, fingers)
        self._max_scale = limits.max_scale
        at = f"given at max_scale {limits.max_scale:g}: lower"
        if problem := self._excess(limits.max_scale):
            raise ValueError(f"{problem} {at} one of them")
        travel = self.setup.closing(limits.max_scale)
        if travel > self.setup.stroke:
            raise ValueError(
                f"{self.name}: closing by at most {self.setup.stroke:g} m expected, {travel:.3g} m "
                f"{at} it, or check stiffness= [N/m]"
            )

    def _checked(self, states: JointStates) -> JointStates:
        """Return the state of the joint alone.

        Raises:
            ValueError: it is missing, not finite, or beyond the stroke.
        """
        setup, names = self.setup, states.names[: len(states.positions)]
        if setup.joint not in names:
            have = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
            raise ValueError(f"no joint {setup.joint} (there are {have or 'no names'})")
        position = states.positions[names.index(setup.joint)]
        beyond = abs(setup.width(position) - setup.stroke / 2) - setup.stroke / 2
        if not beyond <= POSITION_TOLERANCE * setup.stroke:  # NaN as well
            low, high = sorted((setup.open_position, setup.closed_position))
            raise ValueError(f"{setup.joint} at {position:g}, {low:g} to {high:g} expected")
        return JointStates((setup.joint,), np.array([position]), np.empty(0))

    def _begin(self) -> None:
        position = float(np.median([states.positions[0] for _, states in self._states]))
        self._begin_width = width = self.setup.width(position)
        if self.setup.closing(self._max_scale) > width:
            raise HandError(
                f"{self.name}: a width of at least {self.setup.closing(self._max_scale):.3g} m at "
                f"the beginning of the grip expected, {width:.3g} m given at max_scale "
                f"{self._max_scale:g}: lower it, or check stiffness= [N/m]"
            )

    def _content(self, command: GripCommand) -> object:
        return command.release, None if command.release else largest_scale(command)

    def _press(self, command: GripCommand) -> None:
        scale = largest_scale(command)
        if problem := self._excess(scale):
            raise HandError(f"{problem} given")
        width = self._begin_width - self.setup.closing(scale)
        self._publish(self.setup.topic, self._message(self.setup.position(width)))

    def _release(self) -> None:
        self._publish(self.setup.topic, self._message(self.setup.open_position))

    def _message(self, position: float) -> Mapping[str, Any]:
        setup = self.setup
        if setup.message == JOINT_TRAJECTORY:
            return trajectory_message([setup.joint], np.array([position]))
        if setup.message == FLOAT_ARRAY:
            return array_message(np.array([position]))
        if setup.message == GRIPPER_COMMAND:
            # The width makes the force; the effort only limits the motor.
            return gripper_message(position, setup.max_effort)
        return number_message(position)

    def _excess(self, scale: float) -> str:
        """Return the beginning of a message about a force above its ceiling; empty if it is not."""
        setup = self.setup
        force = scale * setup.effort
        if force <= setup.max_effort * (1.0 + SLACK):
            return ""
        return f"{self.name}: at most {setup.max_effort:g} N expected, {force:g} N"
