"""Definitions of ROS messages, parsed from their text.

ROS keeps the text of a definition with each topic. It has the fields of a message. Then, for
each message type that occurs in it, follow a line of `=`, a line `MSG: package/Type` and the
fields of that type. A definition is data: nothing is generated from it or executed.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

NUMBER_CODES = {
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
"""Number types of ROS and their codes in NumPy."""

LENGTH_SIZE = 4
"""Size of the length before a text or a sequence [bytes]."""
FIELD_SIZES = {
    "string": LENGTH_SIZE,
    **{kind: 1 if code == "?" else int(code[1:]) for kind, code in NUMBER_CODES.items()},
}
"""Minimum size of a value of each type that is no message [bytes]."""

SEPARATOR = "\n" + "=" * 80 + "\nMSG: "
"""Text between the types of a definition; the name of the next type follows."""

ROS2_HEADER = (
    SEPARATOR
    + "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    + SEPARATOR
    + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)
"""Definition in ROS 2 of the header of a message, to append to a definition."""


_STAMPS = {"time": ("uint32 secs", "uint32 nsecs"), "duration": ("int32 secs", "int32 nsecs")}
_SEPARATOR = re.compile(r"^=+\s*\nMSG:\s*(\S+)\s*$", re.MULTILINE)
_FIELD = re.compile(
    r"(?P<kind>[A-Za-z][\w/]*)(?:<=\d+)?(?P<many>\[(?:<=)?(?P<size>\d*)\])?\s+"
    r"(?P<name>[A-Za-z]\w*)(?P<rest>.*)"
)


class MessageField(NamedTuple):
    """One field of a message.

    Attributes:
        name: name of the field.
        kind: a number type of ROS, `string`, or the name of a message type.
        size: number of values; None for a single value, 0 for a sequence of any length.
    """

    name: str
    kind: str
    size: int | None = None


class Definition(NamedTuple):
    """Fields of a message type, and of all types that occur in it.

    Attributes:
        name: `package/Type`.
        types: fields of each type by its name.
        sizes: minimum number of bytes of a message of each type, without padding.
    """

    name: str
    types: Mapping[str, tuple[MessageField, ...]]
    sizes: Mapping[str, int]

    @property
    def fields(self) -> tuple[MessageField, ...]:
        """Fields of the message itself."""
        return self.types[self.name]


def short_name(name: str) -> str:
    """Return the name of a type of ROS 1 or ROS 2 as ROS 1 writes it.

    Example:
        >>> short_name("std_msgs/msg/String")
        'std_msgs/String'
    """
    return name.replace("/msg/", "/")


def parse_definition(name: str, text: str) -> Definition:
    r"""Parse the definition of a message.

    Args:
        name: name of its type.
        text: text of the definition.

    Raises:
        ValueError: a line is not a field, or a type is not defined or holds itself.

    Example:
        >>> parse_definition("pkg/Named", "string name\nfloat64[] values # [N]").fields[1]
        MessageField(name='values', kind='float64', size=0)
    """
    first, *others = _SEPARATOR.split(text.replace("\r\n", "\n"))
    blocks = {short_name(name): first}
    pairs = zip(others[::2], others[1::2], strict=True)
    blocks.update((short_name(other), body) for other, body in pairs)
    blocks.update((stamp, "\n".join(lines)) for stamp, lines in _STAMPS.items())
    types: dict[str, tuple[MessageField, ...]] = {}
    for block, body in blocks.items():
        fields: list[MessageField] = []
        for code in (line.split("#", maxsplit=1)[0].strip() for line in body.splitlines()):
            match = _FIELD.fullmatch(code)
            if code and match is None:
                raise ValueError(f"{block}: {code[:60]!r} is no field of a message")
            if match is None or match["rest"].lstrip().startswith("="):
                continue  # an empty line, or a constant
            size = int(match["size"] or 0) if match["many"] else None
            # `[<=N]` is encoded as a sequence of any length, `[N]` has no length.
            bounded = match["many"] and "<=" in match["many"]
            kind = match["kind"]
            if kind not in NUMBER_CODES and kind not in ("string", *_STAMPS):
                short, package = short_name(kind), block.split("/", maxsplit=1)[0]
                # The package of the message comes first; `Header` alone is that of std_msgs, as in
                # ROS 1.
                names = (short, f"{package}/{short}", f"std_msgs/{short}")
                kind = next((block_name for block_name in names if block_name in blocks), "")
                if not kind:
                    raise ValueError(f"{block}: a field is of {short}, which is not defined")
            fields.append(MessageField(match["name"], kind, 0 if bounded else size))
        types[block] = tuple(fields)
    sizes: dict[str, int] = {}
    _measure(short_name(name), types, sizes)
    return Definition(short_name(name), types, sizes)


def field_paths(definition: Definition) -> set[str]:
    r"""Return the path and type of every field, with fields inside messages.

    Example:
        >>> sorted(field_paths(parse_definition("p/A", "B[] b\n====\nMSG: p/B\nint8 x")))
        ['b[].x int8']
    """
    paths: set[str] = set()

    def visit(name: str, prefix: str) -> None:
        for field in definition.types[name]:
            many = "" if field.size is None else "[]"
            if field.kind in definition.types:
                visit(field.kind, f"{prefix}{field.name}{many}.")
            else:
                paths.add(f"{prefix}{field.name}{many} {field.kind}")

    visit(definition.name, "")
    return paths


def _measure(
    name: str,
    types: Mapping[str, tuple[MessageField, ...]],
    sizes: dict[str, int],
    inside: tuple[str, ...] = (),
) -> int:
    """Return the minimum size of a type, and add it to `sizes`; each type is measured once.

    Raises:
        ValueError: a type holds itself.
    """
    if name in inside:
        raise ValueError(f"{name} holds itself")
    if name not in sizes:
        size = 0
        for field in types[name]:
            field_size = FIELD_SIZES.get(field.kind)
            if field_size is None:
                field_size = _measure(field.kind, types, sizes, (*inside, name))
            size += LENGTH_SIZE if field.size == 0 else field_size * (field.size or 1)
        sizes[name] = size
    return sizes[name]
