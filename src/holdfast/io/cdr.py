"""Codec for ROS messages: CDR, the encoding of ROS 2, and the encoding of ROS 1.

MCAP recordings, ROS 2 sources and publishers, and the import of bags all use it. Messages are
plain values, described by a `Definition`; nothing is generated from a definition or executed.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from holdfast.io.definitions import FIELD_SIZES, NUMBER_CODES, Definition, MessageField

HEAD = b"\x00\x01\x00\x00"
"""First bytes of a CDR message: little endian, no options. Alignment counts from their end."""

_CODES = dict(zip(NUMBER_CODES, "?BBbBhHiIqQfd", strict=True))
"""Codes of `struct` for the number types of ROS."""
_LITTLE_ENDIAN = {kind: np.dtype("<" + code) for kind, code in NUMBER_CODES.items()}
_BIG_ENDIAN = {kind: np.dtype(">" + code) for kind, code in NUMBER_CODES.items()}
_NATIVE = {kind: np.dtype(code) for kind, code in NUMBER_CODES.items()}
_PADDING = tuple(bytes(n) for n in range(8))


class MessageDecoder:
    r"""Decoder of messages of one type into dictionaries by field.

    Numbers become numbers of Python and sequences of numbers become arrays. Sequences of points
    (messages of x, y and z of one number type) become arrays of shape (n, 3). Other sequences
    become lists.

    Args:
        definition: definition of the messages.
        ros2: whether messages are CDR, as in ROS 2; otherwise they are encoded as in ROS 1.

    Example:
        >>> from holdfast.io.definitions import parse_definition
        >>> point = parse_definition("pkg/Point", "float32 x\nfloat32 y")
        >>> decode = MessageDecoder(point, ros2=False)
        >>> decode(np.array([1, 2], "<f4").tobytes())
        {'x': 1.0, 'y': 2.0}
    """

    def __init__(self, definition: Definition, *, ros2: bool) -> None:
        self._definition = definition
        self._open: Callable[[bytes], _Ros1Bytes] = _CdrBytes if ros2 else _Ros1Bytes
        # The number type of each message of x, y and z: a sequence of them is one array, as a loop
        # over the points of a module would take most of the time.
        self._points = {
            name: number
            for name, fields in definition.types.items()
            for number in NUMBER_CODES
            if fields == tuple(MessageField(axis, number) for axis in "xyz")
        }
        self._sizes = {**FIELD_SIZES, **definition.sizes}

    def __call__(self, data: bytes) -> dict[str, Any]:
        """Decode a message.

        Raises:
            ValueError: these bytes are not a message of this type.
        """
        try:
            source = self._open(data)
            message = self._message(source, self._definition.name)
        except UnicodeError as cause:
            raise ValueError(f"{self._definition.name}: a text is no UTF-8") from cause
        if source.n_left > source.max_padding:
            raise ValueError(f"{self._definition.name}: {source.n_left} bytes too many")
        return message

    def _message(self, source: "_Ros1Bytes", name: str) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for field in self._definition.types[name]:
            if field.size is None:
                values[field.name] = self._value(source, field.kind)
                continue
            n = field.size or source.length()
            if field.kind in NUMBER_CODES:
                values[field.name] = source.array(field.kind, n)
            elif (number := self._points.get(field.kind)) is not None:
                values[field.name] = source.array(number, 3 * n).reshape(n, 3)
            # Before the list is made: a short message may claim 2^32 elements.
            elif n * self._sizes[field.kind] > source.n_left:
                raise ValueError(f"{field.name}: {n} given, {source.n_left} bytes left")
            else:
                values[field.name] = [self._value(source, field.kind) for _ in range(n)]
        return values

    def _value(self, source: "_Ros1Bytes", kind: str) -> Any:  # noqa: ANN401 (any ROS type)
        if kind in NUMBER_CODES:
            return source.array(kind, 1)[0].item()
        return source.text() if kind == "string" else self._message(source, kind)


class MessageEncoder:
    r"""Encoder of dictionaries by field into messages of one type, in CDR.

    Args:
        definition: definition of the messages.

    Example:
        >>> from holdfast.io.definitions import parse_definition
        >>> encode = MessageEncoder(parse_definition("pkg/Named", "string name\nfloat64 value"))
        >>> encode({"name": "a", "value": 0.5}).hex(" ", 4)
        '00010000 02000000 61000000 00000000 0000e03f'
    """

    def __init__(self, definition: Definition) -> None:
        self._definition = definition

    def __call__(self, message: Mapping[str, Any]) -> bytes:
        """Encode a message.

        Raises:
            KeyError: a field is missing.
            ValueError: an array of fixed size has another number of values.
            struct.error: a number does not fit its field.
        """
        data = bytearray()
        self._message(data, self._definition.name, message)
        return HEAD + bytes(data)

    def _message(self, data: bytearray, name: str, message: Mapping[str, Any]) -> None:
        for field in self._definition.types[name]:
            value = message[field.name]
            if field.size is None:
                self._value(data, field.kind, value)
                continue
            if field.size == 0:  # of any length, which precedes the values
                _append_numbers(data, "uint32", (len(value),))
            elif len(value) != field.size:
                raise ValueError(f"{field.name}: {field.size} values expected, {len(value)} given")
            if field.kind in NUMBER_CODES:
                _append_numbers(data, field.kind, value)
            else:
                for item in value:
                    self._value(data, field.kind, item)

    def _value(self, data: bytearray, kind: str, value: Any) -> None:  # noqa: ANN401
        if kind in NUMBER_CODES:
            _append_numbers(data, kind, (value,))
        elif kind == "string":
            encoded = value.encode() + b"\x00"
            _append_numbers(data, "uint32", (len(encoded),))
            data += encoded
        else:
            self._message(data, kind, value)


def _append_numbers(data: bytearray, kind: str, values: Sequence[float] | npt.NDArray[Any]) -> None:
    """Append numbers, aligned to their size; an array of the same type is copied as a whole."""
    # The length of an empty sequence is followed by no padding.
    if len(values):
        data += _PADDING[-len(data) % _LITTLE_ENDIAN[kind].itemsize]
    if isinstance(values, np.ndarray) and values.dtype == _LITTLE_ENDIAN[kind]:
        data += values.tobytes()
    else:
        data += struct.pack(f"<{len(values)}{_CODES[kind]}", *values)


class _Ros1Bytes:
    """Reader of one value after the other from a message in the encoding of ROS 1."""

    max_padding = 0
    """Number of bytes that may follow the last value."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._offset = 0
        self._byte_order: Literal["little", "big"] = "little"
        self._dtypes = _LITTLE_ENDIAN

    @property
    def n_left(self) -> int:
        return len(self._data) - self._offset

    def array(self, kind: str, n: int) -> npt.NDArray[Any]:
        dtype = self._dtypes[kind]
        if n:
            self._align(dtype.itemsize)
        if n * dtype.itemsize > self.n_left:
            raise ValueError(f"the message is cut: {n} {kind} expected, {self.n_left} bytes left")
        values = np.frombuffer(self._data, dtype, n, self._offset) if n else np.empty(0, dtype)
        self._offset += values.nbytes
        return values.astype(_NATIVE[kind])

    def length(self) -> int:
        self._align(4)
        if self.n_left < 4:
            raise ValueError(f"the message is cut: 1 uint32 expected, {self.n_left} bytes left")
        start, self._offset = self._offset, self._offset + 4
        return int.from_bytes(self._data[start : self._offset], self._byte_order)

    def text(self) -> str:
        return self.array("uint8", self.length()).tobytes().decode()

    def _align(self, size: int) -> None:
        """Do nothing: ROS 1 does not align values."""


class _CdrBytes(_Ros1Bytes):
    """Reader of a message in CDR: values are aligned, and texts end with a zero byte."""

    # Some writers pad a message to a multiple of 4 bytes.
    max_padding = 3

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        # Plain CDR, big or little endian; other numbers are encodings with parameters.
        if len(data) < 4 or data[0] != 0 or data[1] > 1:
            raise ValueError("no CDR message")
        if not data[1]:
            self._byte_order, self._dtypes = "big", _BIG_ENDIAN
        self._offset = 4

    def text(self) -> str:
        return super().text().removesuffix("\x00")

    def _align(self, size: int) -> None:
        self._offset = min(self._offset + -(self._offset - 4) % size, len(self._data))
