"""Messages in MCAP recordings: samples of one topic, and texts with a time.

A message of samples has three fields: `float64[] times`, `uint32[] shape` of one sample, and
the values themselves. The schema that the file carries lets Foxglove and the `mcap` tools
decode it.
"""

from functools import cache
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.io.definitions import parse_definition
from holdfast.sensors.types import Array

TEXT_TYPE = "holdfast_msgs/msg/Text"
TEXT_SCHEMA = "# A text and when it was set [s].\nfloat64 time\nstring text\n"

MAX_TEXTS_SIZE = 1 << 28
"""Maximum size of the texts of one message in memory [bytes]."""

_TEXT = parse_definition(TEXT_TYPE, TEXT_SCHEMA)
_ENCODE_TEXT, _DECODE_TEXT = MessageEncoder(_TEXT), MessageDecoder(_TEXT, ros2=True)
_PACKAGE, _SUFFIX = "holdfast_msgs/msg/", "Samples"
_ROS_TYPES = {"str": "string"}


def samples_type(number: str) -> str:
    """Return the type name of a message of samples of a number type.

    Example:
        >>> samples_type("uint16")
        'holdfast_msgs/msg/Uint16Samples'
    """
    return f"{_PACKAGE}{number.capitalize()}{_SUFFIX}"


def number_of_type(name: str) -> str:
    """Return the number type of a message of samples, by its type name.

    Example:
        >>> number_of_type("holdfast_msgs/msg/Uint16Samples")
        'uint16'
    """
    return name.removeprefix(_PACKAGE).removesuffix(_SUFFIX).lower()


def samples_schema(number: str) -> str:
    """Return the `ros2msg` schema of a message of samples of a number type."""
    return (
        "# Samples of one module or quantity, oldest first.\n"
        "float64[] times   # of each sample [s], on the clock of the recording\n"
        "uint32[] shape    # of one sample, such as 30 3 for 30 taxels\n"
        f"{_ROS_TYPES.get(number, number)}[] values   # all samples, last axis fastest\n"
    )


def encode_samples(times: Array, values: npt.NDArray[Any]) -> bytes:
    """Encode samples as a message.

    Args:
        times: (n,) [s].
        values: (n, ...).
    """
    number = "str" if values.dtype.kind == "U" else values.dtype.name
    flat = values.ravel()
    message = {
        "times": np.asarray(times, dtype=np.float64),
        "shape": values.shape[1:],
        "values": flat.tolist() if number == "str" else flat,
    }
    return _samples_codecs(number)[0](message)


def decode_samples(data: bytes, number: str) -> tuple[Array, npt.NDArray[Any]]:
    """Return the times (n,) [s] and values (n, ...) of a message of samples.

    Raises:
        ValueError: the bytes are not a message of samples of this number type.
    """
    message = _samples_codecs(number)[1](data)
    times, shape = message["times"], tuple(message["shape"].tolist())
    values = message["values"]
    if number == "str":
        # In an array each text takes as much as the longest, so one long text multiplies the size.
        if (size := 4 * len(values) * max(map(len, values), default=0)) > MAX_TEXTS_SIZE:
            raise ValueError(
                f"texts take {size} bytes in memory, at most {MAX_TEXTS_SIZE} expected"
            )
        values = np.array(values, dtype=str)
    if len(values) != len(times) * prod(shape):
        raise ValueError(f"{len(values)} values given for {len(times)} samples of shape {shape}")
    return times, values.reshape(len(times), *shape)


def encode_text(time: float, text: str) -> bytes:
    """Encode a text and its time [s] as a message."""
    return _ENCODE_TEXT({"time": time, "text": text})


def decode_text(data: bytes) -> tuple[float, str]:
    """Return the time [s] and the text of a message.

    Raises:
        ValueError: the bytes are not a message of a text.
    """
    message = _DECODE_TEXT(data)
    return message["time"], message["text"]


@cache
def _samples_codecs(number: str) -> tuple[MessageEncoder, MessageDecoder]:
    """Return the encoder and the decoder of the samples of a number type, which are made once."""
    definition = parse_definition(samples_type(number), samples_schema(number))
    return MessageEncoder(definition), MessageDecoder(definition, ros2=True)
