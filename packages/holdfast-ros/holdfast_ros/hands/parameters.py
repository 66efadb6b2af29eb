"""Parameters of the URI of a hand: numbers, numbers of each joint, topics and words."""

import math
import re
from collections.abc import Sequence

import numpy as np

from holdfast.devices.uri import Address
from holdfast.sensors.types import Array
from holdfast_ros.hands.joints import N_JOINTS, THUMB_FIRST

_TOPIC = re.compile(r"(/[A-Za-z][A-Za-z0-9_]*)+")


class Parameters:
    """Parameters of the URI of a hand.

    Args:
        address: the URI, with its parameters.
    """

    def __init__(self, address: Address) -> None:
        self.text = address.text
        self._given = address.parameters

    @property
    def shared(self) -> bool:
        """Whether other publishers of the topics of the commands are allowed."""
        return self.word("shared", ("false", "true")) == "true"

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
        self, name: str, default: Array | None = None, *, each: bool = False, n: int = N_JOINTS
    ) -> Array:
        """Return a value for each joint (n,), in the order of the messages.

        Args:
            name: name of the parameter.
            default: value of a parameter that is not given.
            each: whether one number for all joints is refused.
            n: number of joints.

        Raises:
            ValueError: there are not `n` numbers, or the parameter is missing.
        """
        if name not in self._given and default is not None:
            return default
        sizes, text = ((n,), "") if each else ((1, n), "a number or ")
        found = self._numbers(name, sizes, f"{text}{n} numbers, one for each joint,")
        return np.full(n, found[0]) if len(found) == 1 else np.array(found)

    def positive_joints(
        self, name: str, default: Array | None = None, *, n: int = N_JOINTS
    ) -> Array:
        """Return a value above 0 for each joint, as `joints`."""
        values = self.joints(name, default, n=n)
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
        """Return the name of a topic or of a namespace.

        Raises:
            ValueError: it is not a name of ROS, or it is missing and has no default.
        """
        topic = self._given.get(name, default)
        if topic is None or not _TOPIC.fullmatch(topic):
            given = "nothing" if topic is None else repr(topic)
            raise ValueError(f"{self.text}: {name}=/TOPIC expected, {given} given")
        return topic

    def word(self, name: str, words: Sequence[str]) -> str:
        """Return one of some words, by default the first.

        Raises:
            ValueError: it is another word.
        """
        word = self._given.get(name, words[0])
        if word not in words:
            raise ValueError(f"{self.text}: {name}={' or '.join(words)} expected, {word!r} given")
        return word

    def fingers(self, default: Sequence[str]) -> tuple[str, ...]:
        """Return the fingers in the order of the messages, from `order=thumb,index,...`.

        Raises:
            ValueError: it is not an order of the four fingers.
        """
        found = tuple(self._given.get("order", ",".join(default)).split(","))
        if sorted(found) != sorted(THUMB_FIRST):
            raise ValueError(
                f"{self.text}: order={','.join(THUMB_FIRST)} expected, in any order, "
                f"{','.join(found)!r} given"
            )
        return found

    def named_joints(self, name: str) -> dict[str, list[str]]:
        """Return the names of the joints of each finger, from `joints=thumb:th_1:th_2,index:if_1`.

        Raises:
            ValueError: it has another form, or a name occurs twice.
        """
        given = self._given.get(name)
        parts = [part.split(":") for part in (given or "").split(",")]
        fingers, joints = [part[0] for part in parts], [one for part in parts for one in part[1:]]
        is_complete = all(len(part) > 1 and all(part) for part in parts)
        if not is_complete or len({*fingers}) < len(fingers) or len({*joints}) < len(joints):
            text = "nothing" if given is None else repr(given)
            raise ValueError(
                f"{self.text}: {name}=thumb:JOINT:JOINT,index:JOINT expected, each name once, "
                f"{text} given"
            )
        return {finger: names for finger, *names in parts}

    def name(self, name: str) -> str:
        """Return a name that must be given.

        Raises:
            ValueError: it is missing or empty.
        """
        if not self._given.get(name):
            raise ValueError(f"{self.text}: {name}=NAME expected, nothing given")
        return self._given[name]

    def prefix(self, default: str) -> str:
        """Return the beginning of the names of the joints."""
        return self._given.get("prefix", default)

    def _numbers(self, name: str, sizes: Sequence[int], expected: str) -> list[float]:
        text = self._given.get(name)
        try:
            found = [float(part) for part in (text or "").split(",")]
        except ValueError:
            # Text gets the message of a wrong number of values.
            found = []
        if len(found) not in sizes or not all(map(math.isfinite, found)):
            given = "nothing" if text is None else repr(text)
            raise ValueError(f"{self.text}: {name}: {expected} expected, {given} given")
        return found
