"""Messages of ROS 2 out of plain values, by their definition."""

import struct
from collections.abc import Mapping
from typing import Any

from holdfast.ros.cdr import HEAD
from holdfast.ros.definitions import NUMBERS, Definition, Field

_STRUCTS = {
    kind: struct.Struct("<" + code)
    for kind, code in zip(NUMBERS, "?BBbBhHiIqQfd", strict=True)
}  # fmt: skip
_LENGTH = _STRUCTS["uint32"]
_NO_BYTES = (b"", bytes(1), bytes(2), bytes(3), bytes(4), bytes(5), bytes(6), bytes(7))


class Encoder:
    r"""Turns dictionaries by field into the bytes of messages of one type, in CDR.

    Args:
        definition: of the messages.

    Example:
        >>> from holdfast.ros.definitions import parse_definition
        >>> encode = Encoder(parse_definition("pkg/Named", "string name\nfloat64 value"))
        >>> encode({"name": "a", "value": 0.5}).hex(" ", 4)
        '00010000 02000000 61000000 00000000 0000e03f'
    """

    def __init__(self, definition: Definition) -> None:
        self._definition = definition

    def __call__(self, message: Mapping[str, Any]) -> bytes:
        """The bytes of a message.

        Raises:
            KeyError: a field is missing.
            struct.error: a number does not fit its field.
        """
        data = bytearray()
        self._message(data, self._definition.name, message)
        return HEAD + bytes(data)

    def _message(self, data: bytearray, name: str, message: Mapping[str, Any]) -> None:
        for field in self._definition.types[name]:
            self._field(data, field, message[field.name])

    def _field(self, data: bytearray, field: Field, value: Any) -> None:  # noqa: ANN401
        if field.size is None:
            self._one(data, field.kind, value)
            return
        if field.size == 0:
            _number(data, _LENGTH, len(value))
        elif len(value) != field.size:
            raise ValueError(f"{field.name}: {field.size} values expected, {len(value)} given")
        for one in value:
            self._one(data, field.kind, one)

    def _one(self, data: bytearray, kind: str, value: Any) -> None:  # noqa: ANN401
        if (number := _STRUCTS.get(kind)) is not None:
            _number(data, number, value)
        elif kind == "string":
            raw = value.encode() + b"\x00"
            _number(data, _LENGTH, len(raw))
            data += raw
        else:
            self._message(data, kind, value)


def _number(data: bytearray, number: struct.Struct, value: float) -> None:
    data += _NO_BYTES[-len(data) % number.size]
    data += number.pack(value)
