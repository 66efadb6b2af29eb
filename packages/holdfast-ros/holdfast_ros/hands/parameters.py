"""Parameters of the URI of a hand: numbers, numbers of each joint, topics and words."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from holdfast.devices.uri import Address
from holdfast.sensors.types import Array
from holdfast_ros.hands.joints import JointOrder
from holdfast_ros.topic_messages import MESSAGE_TYPES

COMMON = ("domain", "shared")
"""Names of the parameters of every hand."""
_TOPIC = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")


class Parameters:
    """Parameters of the URI of a hand; what it does not give is that of the row of the hand.

    Args:
        address: the URI, with its parameters.
        row: row of the hand in hands.toml.

    Attributes:
        text: the URI.
        row: row of the hand.
    """

    def __init__(self, address: Address, row: Mapping[str, Any]) -> None:
        self.text = address.text
        self.row = row
        self._address = address
        self._given = address.parameters

    @property
    def shared(self) -> bool:
        """Whether other publishers of the topics of the commands are allowed."""
        return self.word("shared", ("false", "true")) == "true"

    def only(self, *names: str) -> None:
        """Check that all given parameters are known; those of every hand are.

        Raises:
            ValueError: one is not among `names`.
        """
        self._address.only(*COMMON, *names)

    def has(self, name: str) -> bool:
        """Return whether a parameter is given."""
        return name in self._given

    def number(self, name: str, default: float | None = None) -> float:
        """Return a finite number.

        Raises:
            ValueError: it is not one, or it is missing and has no default.
        """
        if name not in self._given and default is not None:
            return default
        return self._numbers(name, (1,), "a number")[0]

    def joints(
        self, name: str, order: JointOrder, default: Array | None = None, *, per_joint: bool = False
    ) -> Array:
        """Return a value for each joint (n,), in the order of the messages.

        Args:
            name: name of the parameter.
            order: the joints.
            default: value where neither the URI nor the row has one.
            per_joint: whether one number for all joints is refused.

        Raises:
            ValueError: there are not `n` numbers, or the parameter is missing.
        """
        if name not in self._given and name in self.row:
            return order.values(self.row[name])
        if name not in self._given and default is not None:
            return default
        n = len(order.names)
        sizes, text = ((n,), "") if per_joint else ((1, n), "a number or ")
        numbers = self._numbers(name, sizes, f"{text}{n} numbers, one for each joint,")
        return np.full(n, numbers[0]) if len(numbers) == 1 else np.array(numbers)

    def positive_joints(self, name: str, order: JointOrder) -> Array:
        """Return a value above 0 for each joint, as `joints`."""
        values = self.joints(name, order)
        if not (values > 0).all():
            raise ValueError(
                f"{self.text}: {name}: numbers above 0 expected, {min(values):g} given"
            )
        return values

    def positive(self, name: str, default: float | None = None) -> float:
        """Return a number above 0, as `number`."""
        value = self.number(name, default)
        if not value > 0:
            raise ValueError(f"{self.text}: {name}: a number above 0 expected, {value:g} given")
        return value

    def topic(self, name: str, default: str | None = None) -> str:
        """Return the name of a topic.

        Raises:
            ValueError: it is not a name of ROS, or it is missing and has no default.
        """
        topic = self._given.get(name, self.row.get(name, default))
        if topic is None or not _TOPIC.fullmatch(topic):
            shown = "nothing" if topic is None else repr(topic)
            raise ValueError(f"{self.text}: {name}=/TOPIC expected, {shown} given")
        return str(topic)

    def word(self, name: str, words: Sequence[str] = ()) -> str:
        """Return one of some words, by default those of the row, and of these the first.

        Raises:
            ValueError: it is another word.
        """
        words = words or self.row[name]
        word = self._given.get(name, words[0])
        if word not in words:
            raise ValueError(f"{self.text}: {name}={' or '.join(words)} expected, {word!r} given")
        return word

    def message(self, types: Sequence[str] = ()) -> str:
        """Return the message type of the commands, from `type=Float64`, as `word`."""
        kind = self.word("type", types)
        return next(name for name in MESSAGE_TYPES if name.endswith(f"/{kind}"))

    def joint_order(self) -> JointOrder:
        """Return the joints of each finger, from `joints=thumb:th_1:th_2,index:if_1`.

        Raises:
            ValueError: it has another form, a name occurs twice, or the hand has other joints.
        """
        joints, stated = self.row.get("joints"), self._given.get("joints")
        if joints and stated is None:
            return JointOrder(joints)
        parts = [part.split(":") for part in (stated or "").split(",")]
        order = {finger: names for finger, *names in parts}
        names = [name for names in order.values() for name in names]
        is_complete = all(len(part) > 1 and all(part) for part in parts)
        if not is_complete or len(order) < len(parts) or len({*names}) < len(names):
            text = "nothing" if stated is None else repr(stated)
            raise ValueError(
                f"{self.text}: joints=thumb:JOINT:JOINT,index:JOINT expected, each name once, "
                f"{text} given"
            )
        if joints and {key: len(order[key]) for key in order} != {
            k: len(joints[k]) for k in joints
        }:
            fingers = ", ".join(f"{len(joints[finger])} of {finger}" for finger in joints)
            raise ValueError(f"{self.text}: joints: {fingers} expected, {stated!r} given")
        return JointOrder(order)

    def name(self, name: str) -> str:
        """Return a name that must be given.

        Raises:
            ValueError: it is missing or empty.
        """
        if not self._given.get(name):
            raise ValueError(f"{self.text}: {name}=NAME expected, nothing given")
        return self._given[name]

    def _numbers(self, name: str, sizes: Sequence[int], expected: str) -> list[float]:
        text = self._given.get(name)
        try:
            numbers = [float(part) for part in (text or "").split(",")]
        except ValueError:
            # Text gets the message of a wrong number of values.
            numbers = []
        if len(numbers) not in sizes or not all(map(math.isfinite, numbers)):
            shown = "nothing" if text is None else repr(text)
            raise ValueError(f"{self.text}: {name}: {expected} expected, {shown} given")
        return numbers
