"""Messages of holdfast in CDR, the encoding of ROS 2, little endian.

A message of samples has three fields, whatever its number type: `float64[] times`,
`uint32[] shape` of one value, and the values themselves. Foxglove and the `mcap` tools decode
it by the schema that the file carries.
"""

from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors.values import Array

HEAD = b"\x00\x01\x00\x00"
"""CDR, little endian, no options; alignment counts from its end."""

TEXT_TYPE = "holdfast_msgs/msg/Text"
TEXT_SCHEMA = "# A text and when it was set [s].\nfloat64 time\nstring text\n"

_ROS_TYPES = {"bool": "bool", "str": "string"}


def type_name(number: str) -> str:
    """The name of the message of samples of a number type.

    Example:
        >>> type_name("uint16")
        'holdfast_msgs/msg/Uint16Samples'
    """
    return f"holdfast_msgs/msg/{number.capitalize()}Samples"


def schema(number: str) -> str:
    """The definition of that message, as a `ros2msg` schema."""
    return (
        "# Samples of one module or quantity, oldest first.\n"
        "float64[] times   # of each sample [s], on the clock of the recording\n"
        "uint32[] shape    # of one sample, such as 30 3 for 30 taxels\n"
        f"{_ROS_TYPES.get(number, number)}[] values   # all samples, last axis fastest\n"
    )


def pack_samples(times: Array, values: npt.NDArray[Any]) -> bytes:
    """The message of these samples.

    Args:
        times: (n,) [s].
        values: (n, ...).
    """
    data = bytearray(HEAD)
    _put(data, np.asarray(times, "<f8"))
    _put(data, np.array(values.shape[1:], "<u4"))
    if values.dtype.kind == "U":
        _put_texts(data, values)
    else:
        _put(data, values.astype(values.dtype.newbyteorder("<"), copy=False))
    return bytes(data)


def unpack_samples(data: bytes, number: str) -> tuple[Array, npt.NDArray[Any]]:
    """Times and values out of a message of samples.

    Raises:
        ValueError: it is none.
    """
    reader = _Reader(data)
    times = reader.array("<f8")
    shape = tuple(reader.array("<u4").tolist())
    if number == "str":
        values = np.array(reader.texts(), dtype=str)
    else:
        values = reader.array(np.dtype(number).newbyteorder("<"))
    if len(values) != len(times) * prod(shape):
        raise ValueError(f"{len(values)} values given for {len(times)} samples of shape {shape}")
    return times, values.reshape(len(times), *shape)


def pack_text(time: float, text: str) -> bytes:
    """The message of a text and its time [s]."""
    data = bytearray(HEAD)
    data += np.array([time], "<f8").tobytes()
    _put_text(data, text)
    return bytes(data)


def unpack_text(data: bytes) -> tuple[float, str]:
    """Time [s] and text out of the message.

    Raises:
        ValueError: it is none.
    """
    reader = _Reader(data)
    return float(reader.take("<f8", 1)[0]), reader.text()


def _align(data: bytearray, size: int) -> None:
    data += bytes(-(len(data) - len(HEAD)) % size)


def _put(data: bytearray, array: npt.NDArray[Any]) -> None:
    _align(data, 4)
    data += np.uint32(array.size).astype("<u4").tobytes()
    if array.size:
        _align(data, array.itemsize)
        data += array.tobytes()


def _put_texts(data: bytearray, texts: npt.NDArray[Any]) -> None:
    _align(data, 4)
    data += np.uint32(texts.size).astype("<u4").tobytes()
    for text in texts.ravel().tolist():
        _put_text(data, text)


def _put_text(data: bytearray, text: str) -> None:
    _align(data, 4)
    raw = text.encode() + b"\x00"
    data += np.uint32(len(raw)).astype("<u4").tobytes()
    data += raw


class _Reader:
    """Takes one field after the other out of a message."""

    def __init__(self, data: bytes) -> None:
        if data[: len(HEAD)] != HEAD:
            raise ValueError("no little-endian CDR message")
        self._data = data
        self._place = len(HEAD)

    def take(self, dtype: npt.DTypeLike, n: int) -> npt.NDArray[Any]:
        kind = np.dtype(dtype)
        self._place += -(self._place - len(HEAD)) % kind.itemsize
        values = np.frombuffer(self._data, kind, n, self._place)
        self._place += values.nbytes
        return values.astype(kind.newbyteorder("="), copy=False)

    def array(self, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        n = int(self.take("<u4", 1)[0])
        return self.take(dtype, n) if n else np.empty(0, np.dtype(dtype).newbyteorder("="))

    def text(self) -> str:
        n = int(self.take("<u4", 1)[0])
        raw = self.take("u1", n).tobytes()
        return raw[:-1].decode()

    def texts(self) -> list[str]:
        n = int(self.take("<u4", 1)[0])
        return [self.text() for _ in range(n)]
