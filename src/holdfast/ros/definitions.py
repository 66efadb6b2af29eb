"""Messages of ROS as plain values: by their definition, out of the bytes of ROS 1 and ROS 2.

A definition is the text that ROS keeps with a topic: the fields of a message, then, each after
a line of `=` and `MSG: package/Type`, those of the messages inside it. It is read as data;
nothing is generated from it.
"""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

NUMBERS = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
"""Number types of ROS, as NumPy calls them."""

MAX_DEPTH = 8
"""A message is nested no deeper than this."""

_STAMPS = {"time": ("uint32 secs", "uint32 nsecs"), "duration": ("int32 secs", "int32 nsecs")}
_SEPARATOR = re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)
_FIELD = re.compile(
    r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d+)?(?P<many>\[(?:<=)?(?P<size>\d*)\])?\s+"
    r"(?P<name>[A-Za-z]\w*)(?P<rest>.*)"
)


class Field(NamedTuple):
    """One field of a message.

    Attributes:
        name: what it is called.
        kind: a number type of ROS, `string`, or the name of a message.
        size: how many there are; None for one, 0 where the message says how many.
    """

    name: str
    kind: str
    size: int | None = None


class Definition(NamedTuple):
    """What a message looks like.

    Attributes:
        name: `package/Type`.
        types: the fields of it, and of all messages inside it, by their name.
    """

    name: str
    types: Mapping[str, tuple[Field, ...]]

    @property
    def fields(self) -> tuple[Field, ...]:
        """Of the message itself."""
        return self.types[self.name]


def short_name(name: str) -> str:
    """The name of a type, of ROS 1 or ROS 2, as ROS 1 writes it.

    Example:
        >>> short_name("std_msgs/msg/String")
        'std_msgs/String'
    """
    return name.replace("/msg/", "/")


def parse_definition(name: str, text: str) -> Definition:
    r"""The definition of a message out of its text.

    Raises:
        ValueError: it is none, or names a type that it does not define.

    Example:
        >>> parse_definition("pkg/Named", "string name\nfloat64[] values # [N]").fields[1]
        Field(name='values', kind='float64', size=0)
    """
    first, *others = _SEPARATOR.split(text.replace("\r\n", "\n"))
    blocks = {short_name(name): first}
    pairs = zip(others[::2], others[1::2], strict=True)
    blocks.update((short_name(other), body) for other, body in pairs)
    blocks.update((stamp, "\n".join(lines)) for stamp, lines in _STAMPS.items())
    types = {block: tuple(_fields(block, body, blocks)) for block, body in blocks.items()}
    definition = Definition(short_name(name), types)
    _check_depth(definition, definition.name, 0)
    return definition


def _fields(block: str, body: str, blocks: Mapping[str, str]) -> Iterator[Field]:
    for line in body.splitlines():
        code = line.split("#", maxsplit=1)[0].strip()
        if not code:
            continue
        match = _FIELD.fullmatch(code)
        if match is None:
            raise ValueError(f"{block}: {code[:60]!r} is no field of a message")
        if match["rest"].lstrip().startswith("="):
            continue  # a constant
        size = int(match["size"] or 0) if match["many"] else None
        bounded = match["many"] and "<=" in match["many"]
        yield Field(match["name"], _kind(match["kind"], block, blocks), 0 if bounded else size)


def _kind(kind: str, block: str, blocks: Mapping[str, str]) -> str:
    if kind in NUMBERS or kind in ("string", *_STAMPS):
        return kind
    kind = short_name(kind)
    package = block.split("/", maxsplit=1)[0]
    for full in (kind, f"{package}/{kind}", f"std_msgs/{kind}"):
        if full in blocks:
            return full
    raise ValueError(f"{block}: a field is of {kind}, which is not defined")


def _check_depth(definition: Definition, name: str, depth: int) -> None:
    if depth > MAX_DEPTH:
        raise ValueError(f"{definition.name} holds itself, or is nested too deep")
    for field in definition.types[name]:
        if field.kind in definition.types:
            _check_depth(definition, field.kind, depth + 1)
