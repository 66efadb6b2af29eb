"""Messages of ROS as plain values: by their definition, out of the bytes of ROS 1 and ROS 2.

A definition is the text that ROS keeps with a topic: the fields of a message, then, each after
a line of `=` and `MSG: package/Type`, those of the messages inside it. It is read as data;
nothing is generated from it.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

NUMBERS = {
    "bool": "u1",
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

MOST_DEPTH = 8
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
    if depth > MOST_DEPTH:
        raise ValueError(f"{definition.name} holds itself, or is nested too deep")
    for field in definition.types[name]:
        if field.kind in definition.types:
            _check_depth(definition, field.kind, depth + 1)


def _points(definition: Definition) -> dict[str, str]:
    """Number types of the messages that are x, y and z of one."""
    return {
        name: number
        for name, fields in definition.types.items()
        for number in NUMBERS
        if fields == tuple(Field(axis, number) for axis in "xyz")
    }


class Decoder:
    r"""Turns the bytes of messages of one type into dictionaries by field.

    Numbers become Python's, sequences of numbers arrays, sequences of points (messages of x, y
    and z of one number type) arrays of shape (n, 3), and other sequences lists.

    Args:
        definition: of the messages.
        ros2: they are CDR, as in ROS 2; else as ROS 1 sends them.

    Example:
        >>> decode = Decoder(parse_definition("pkg/Point", "float32 x\nfloat32 y"), ros2=False)
        >>> decode(np.array([1, 2], "<f4").tobytes())
        {'x': 1.0, 'y': 2.0}
    """

    def __init__(self, definition: Definition, *, ros2: bool) -> None:
        self._definition = definition
        self._make: Callable[[bytes], _Bytes] = _Cdr if ros2 else _Bytes
        self._points = _points(definition)

    def __call__(self, data: bytes) -> dict[str, Any]:
        """The message in these bytes.

        Raises:
            ValueError: they are no such message.
        """
        try:
            source = self._make(data)
            message = self._message(source, self._definition.name)
        except UnicodeError as cause:
            raise ValueError(f"{self._definition.name}: a text is no UTF-8") from cause
        if source.n_left > source.padding:
            raise ValueError(f"{self._definition.name}: {source.n_left} bytes too many")
        return message

    def _message(self, source: "_Bytes", name: str) -> dict[str, Any]:
        return {f.name: self._value(source, f) for f in self._definition.types[name]}

    def _value(self, source: "_Bytes", field: Field) -> Any:  # noqa: ANN401 (any of ROS's)
        if field.size is None:
            return self._one(source, field.kind)
        n = field.size or source.length()
        if field.kind in NUMBERS:
            return source.array(field.kind, n)
        if (number := self._points.get(field.kind)) is not None:
            return source.array(number, 3 * n).reshape(n, 3)
        if n > source.n_left:  # whatever it is, it takes a byte
            raise ValueError(f"{field.name}: {n} given, {source.n_left} bytes left")
        return [self._one(source, field.kind) for _ in range(n)]

    def _one(self, source: "_Bytes", kind: str) -> Any:  # noqa: ANN401 (any of ROS's)
        if kind in NUMBERS:
            return source.array(kind, 1)[0].item()
        return source.text() if kind == "string" else self._message(source, kind)


class _Bytes:
    """Takes one value after the other out of a message as ROS 1 writes it."""

    padding = 0
    """Bytes that may be left over."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._place = 0
        self._order = "<"

    @property
    def n_left(self) -> int:
        return len(self._data) - self._place

    def array(self, kind: str, n: int) -> npt.NDArray[Any]:
        dtype = np.dtype(self._order + NUMBERS[kind])
        if n:
            self._align(dtype.itemsize)
        if n * dtype.itemsize > self.n_left:
            raise ValueError(f"the message is cut: {n} {kind} expected, {self.n_left} bytes left")
        values = np.frombuffer(self._data, dtype, n, self._place) if n else np.empty(0, dtype)
        self._place += values.nbytes
        return values.astype(dtype.newbyteorder("="))

    def length(self) -> int:
        return int(self.array("uint32", 1)[0])

    def text(self) -> str:
        return self.array("uint8", self.length()).tobytes().decode()

    def _align(self, size: int) -> None:
        """ROS 1 leaves no gaps."""


class _Cdr(_Bytes):
    """Takes them out of CDR: aligned, and texts end with a zero."""

    padding = 3

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise ValueError("no CDR message")
        self._order = "<" if data[1] else ">"
        self._place = 4

    def text(self) -> str:
        return super().text().removesuffix("\x00")

    def _align(self, size: int) -> None:
        self._place = min(self._place + -(self._place - 4) % size, len(self._data))
