"""Hands that take one number: the vendor's envelop grasp, and parallel grippers."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands.local import largest_scale
from holdfast_grip.limits import SLACK, Limits
from holdfast_ros.hands.ros_hand import RosHand
from holdfast_ros.link import Link
from holdfast_ros.topic_messages import (
    GRIPPER_COMMAND,
    STRING,
    gripper_message,
    number_message,
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
