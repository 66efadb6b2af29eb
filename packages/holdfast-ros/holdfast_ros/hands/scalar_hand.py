"""Hands that take one number: the envelop grasp of the vendor, and grippers by effort or width."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands.local import largest_scale
from holdfast_grip.limits import SLACK, Limits
from holdfast_ros.dds import Link
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.hands.ros_hand import RosHand
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
PARAMETERS = ("topic", "type", "effort", "max_effort", "open", "release")
"""Names of the parameters that a hand takes in any case."""
WIDTH_PARAMETERS = ("joint", "states", "stiffness", "gain", "stroke")
"""Names of those of a gripper by width, besides."""
MAX_STROKE = 1.0
"""Longest stroke of a gripper [m]; a longer one is in millimetres."""
POSITION_TOLERANCE = 0.05
"""Share of the stroke by which a reading may be beyond it: zeros are set by eye, stops yield."""


@dataclass(frozen=True)
class Width:
    """How a parallel gripper takes a width, as the position of a joint.

    Attributes:
        joint: name of the joint whose position is the width, in commands and joint states.
        states: topic of the joint states.
        stiffness: force that is added for each metre by which the commanded width is smaller, of
            pads and gripper together [N/m].
        gain: force of the gripper's own position control for each metre between the commanded
            width and the real one [N/m]; infinite if it reaches the width it is commanded to.
        opened: position of the open gripper [unit of the driver].
        closed: position of the closed one.
        stroke: width between the two [m].
    """

    joint: str
    states: str
    stiffness: float
    gain: float
    opened: float
    closed: float
    stroke: float

    @classmethod
    def of(cls, parameters: Parameters, opened: float, closed: float) -> Self:
        """Return the description that the URI of a gripper gives.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        uri, stroke = parameters.text, parameters.positive("stroke", abs(opened - closed))
        if stroke > MAX_STROKE:
            raise ValueError(
                f"{uri}: a stroke of at most {MAX_STROKE:g} m expected, {stroke:g} given: "
                "give open= and closed= in metres, or stroke= [m] beside them"
            )
        stiffness = parameters.positive("stiffness")
        gain = parameters.positive("gain", math.inf)
        if gain < stiffness:
            raise ValueError(
                f"{uri}: gain: at least the stiffness of {stiffness:g} N/m expected, of "
                f"which it is a part, {gain:g} given"
            )
        joint, states = parameters.name("joint"), parameters.topic("states")
        return cls(joint, states, stiffness, gain, opened, closed, stroke)

    def at(self, position: float) -> float:
        """Return the width at a position [m]."""
        return (position - self.closed) / (self.opened - self.closed) * self.stroke

    def position(self, width: float) -> float:
        """Return the position of a width [m], which is kept within the stroke."""
        share = min(max(width / self.stroke, 0.0), 1.0)
        return self.closed + share * (self.opened - self.closed)

    def closing(self, effort: float, scale: float) -> float:
        """Return by how much a commanded width is below that at the beginning of the grip [m].

        The gripper's own control needs effort / gain to keep the first force, and each newton
        more needs 1 / stiffness.
        """
        return effort / self.gain + (scale - 1.0) * effort / self.stiffness


@dataclass(frozen=True)
class ScalarSetup:
    """Description of a hand that takes one number.

    Attributes:
        topic: topic of the commands.
        message: its message type.
        effort: value when the grip begins [unit of the driver]; of a width, the force [N].
        max_effort: ceiling of the value.
        opened: value that opens the hand, or position of an open gripper that moves to positions.
        closed: position that a `GripperCommand` closes to, beyond any object [m].
        home_topic: topic on which the word `home` opens the hand; None if there is none.
        fingers: fingers of the hand; None for any.
        width: how it takes a width; None if it takes the value.
    """

    topic: str
    message: str
    effort: float
    max_effort: float
    opened: float
    closed: float
    home_topic: str | None
    fingers: tuple[str, ...] | None
    width: Width | None

    @classmethod
    def of(cls, parameters: Parameters) -> Self:
        """Return the description that the URI of a hand gives.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        by_width, message = parameters.word("command") == "width", parameters.message()
        moves, home = by_width or message == GRIPPER_COMMAND, parameters.word("release") == "home"
        used = {"closed": moves, "home_topic": home} | dict.fromkeys(WIDTH_PARAMETERS, by_width)
        parameters.only(*PARAMETERS, *(name for name in used if used[name]))
        opened = parameters.number("open", None if moves else 0.0)
        closed = parameters.number("closed", 0.0)
        if moves and opened == closed:
            raise ValueError(
                f"{parameters.text}: open= another position than closed= expected, {opened:g} given"
            )
        return cls(
            topic=parameters.topic("topic"),
            message=message,
            effort=parameters.positive("effort"),
            max_effort=parameters.positive("max_effort"),
            opened=opened,
            closed=closed,
            home_topic=parameters.topic("home_topic") if home else None,
            fingers=tuple(parameters.row["fingers"]) if "fingers" in parameters.row else None,
            width=Width.of(parameters, opened, closed) if by_width else None,
        )


class ScalarHand(RosHand):
    """Hand that takes one number, for the largest scale of all fingers.

    The number is the value of the grip times the scale, or the width that makes this force.

    Args:
        link: connection to ROS.
        given: parameters of its URI.

    Attributes:
        setup: description of the hand.
    """

    def __init__(self, link: Link, parameters: Parameters) -> None:
        self.setup = setup = ScalarSetup.of(parameters)
        topics = {setup.topic: setup.message}
        if setup.home_topic is not None:
            topics[setup.home_topic] = STRING
        super().__init__(
            link, parameters, topics, None if setup.width is None else setup.width.states
        )
        self.fingers = setup.fingers
        self._max_scale = 1.0
        self._begin_width = 0.0

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the fingers, and the value and the travel at the highest scale.

        Raises:
            ValueError: the hand lacks a finger, or one of the two is more than it has.
        """
        super().check(limits, fingers)
        setup = self.setup
        self._max_scale = limits.max_scale
        if problem := self._excess(limits.max_scale):
            raise ValueError(f"{problem} at max_scale {limits.max_scale:g}: lower one of them")
        if setup.width is None:
            return
        travel = setup.width.closing(setup.effort, limits.max_scale)
        if travel > setup.width.stroke:
            raise ValueError(
                f"{self.name}: closing by at most {setup.width.stroke:g} m expected, {travel:.3g} "
                f"m given at max_scale {limits.max_scale:g}: lower it, or check stiffness= [N/m]"
            )

    def _checked(self, states: JointStates) -> JointStates:
        """Return the state of the joint alone.

        Raises:
            ValueError: it is missing, not finite, or beyond the stroke.
        """
        width, names = self.setup.width, states.names[: len(states.positions)]
        if width is None:
            return states
        if width.joint not in names:
            have = ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")
            raise ValueError(f"no joint {width.joint} (there are {have or 'no names'})")
        position = states.positions[names.index(width.joint)]
        beyond = abs(width.at(position) - width.stroke / 2) - width.stroke / 2
        if not beyond <= POSITION_TOLERANCE * width.stroke:  # NaN as well
            low, high = sorted((width.opened, width.closed))
            raise ValueError(f"{width.joint} at {position:g}, {low:g} to {high:g} expected")
        return JointStates((width.joint,), np.array([position]), np.empty(0))

    def _begin(self) -> None:
        if (width := self.setup.width) is None:
            return
        position = float(np.median([states.positions[0] for _, states in self._states]))
        self._begin_width = width.at(position)
        closing = width.closing(self.setup.effort, self._max_scale)
        if closing > self._begin_width:
            raise HandError(
                f"{self.name}: a width of at least {closing:.3g} m at the beginning of the grip "
                f"expected, {self._begin_width:.3g} m given at max_scale {self._max_scale:g}: "
                "lower it, or check stiffness= [N/m]"
            )

    def _content(self, command: GripCommand) -> object:
        return command.release, None if command.release else largest_scale(command)

    def _press(self, command: GripCommand) -> None:
        setup, scale = self.setup, largest_scale(command)
        if problem := self._excess(scale):
            raise HandError(problem)
        position = setup.closed
        if setup.width is not None:
            closing = setup.width.closing(setup.effort, scale)
            position = setup.width.position(self._begin_width - closing)
        self._publish(setup.topic, self._message(position, setup.effort * scale))

    def _release(self) -> None:
        setup = self.setup
        if setup.home_topic is not None:
            self._publish(setup.home_topic, {"data": HOME})
        else:
            # A gripper that moves to a position needs an effort to open, too.
            effort = setup.effort if setup.message == GRIPPER_COMMAND else setup.opened
            self._publish(setup.topic, self._message(setup.opened, effort))

    def _message(self, position: float, effort: float) -> Mapping[str, Any]:
        """Return the message of a value, or of a position where the driver takes one."""
        setup, width = self.setup, self.setup.width
        if setup.message == GRIPPER_COMMAND:
            # A width makes the force; the effort only limits the motor then.
            return gripper_message(position, effort if width is None else setup.max_effort)
        if width is None:
            return number_message(effort)
        if setup.message == JOINT_TRAJECTORY:
            return trajectory_message([width.joint], np.array([position]))
        if setup.message == FLOAT_ARRAY:
            return array_message(np.array([position]))
        return number_message(position)

    def _excess(self, scale: float) -> str:
        """Return a message about a value that exceeds its ceiling; empty if it does not."""
        setup, unit = self.setup, "" if self.setup.width is None else " N"
        value = scale * setup.effort
        if value <= setup.max_effort * (1.0 + SLACK):
            return ""
        return f"{self.name}: at most {setup.max_effort:g}{unit} expected, {value:g}{unit} given"
