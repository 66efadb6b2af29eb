"""Counts of a sensor, parsed by a compiled step from the two forms that a packet has of them.

The step accepts the forms that XELA's server writes. It returns nothing for anything else, which
`holdfast.devices.sources.xela.packet` then parses in Python, to accept it or to name the mistake.
"""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled_step

Bytes = npt.NDArray[np.uint8]
Counts = npt.NDArray[np.uint16]

QUOTE, COMMA, SPACE, OPENING_BRACKET, CLOSING_BRACKET = b'", []'
FIRST_OF_NULL = b"n"[0]
ZERO, NINE = b"09"
NO_DIGIT = -(2**20)
"""No other digits outweigh it."""
DIGIT_VALUES = np.full(256, NO_DIGIT)
"""Hexadecimal digits by their characters. A table is faster than branches, which follow no
pattern in readings."""
for _value, _characters in enumerate(zip(b"0123456789abcdef", b"0123456789ABCDEF", strict=True)):
    DIGIT_VALUES[list(_characters)] = _value


def counts_of(data: msgspec.Raw, integers: msgspec.Raw) -> Counts | None:
    """Return the counts of a sensor, if its two forms are usual and equal.

    Args:
        data: JSON string of hexadecimal numbers.
        integers: JSON list of the same numbers, or null.

    Example:
        >>> counts_of(msgspec.Raw(b'"8000,8CA0"'), msgspec.Raw(b"[32768, 36000]")).tolist()
        [32768, 36000]
        >>> counts_of(msgspec.Raw(b'"8000,8CA0"'), msgspec.Raw(b"[32768, 7]"))
    """
    text, numbers = np.frombuffer(data, np.uint8), np.frombuffer(integers, np.uint8)
    counts = np.empty(len(text) // 5, dtype=np.uint16)
    return counts if _PARSER(text, numbers, counts) else None


@compiled_step
def _parse(text: Bytes, numbers: Bytes, counts: Counts) -> bool:
    return _parse_hex(text, counts) and (
        numbers[0] == FIRST_OF_NULL or _has_integers(numbers, counts)
    )


@compiled_step
def _parse_hex(text: Bytes, counts: Counts) -> bool:
    """Parse a string of numbers of four digits, in quotes and with commas between them."""
    if len(counts) == 0 or len(text) != 5 * len(counts) + 1 or text[0] != QUOTE:
        return False
    for i in range(len(counts)):
        value = 0
        for place in range(5 * i + 1, 5 * i + 5):
            value = 16 * value + DIGIT_VALUES[text[place]]
        if value < 0:
            return False
        counts[i] = value
        if text[5 * i + 5] != (COMMA if i + 1 < len(counts) else QUOTE):
            return False
    return True


@compiled_step
def _has_integers(numbers: Bytes, counts: Counts) -> bool:
    """Return whether a JSON list of whole numbers without signs has exactly these counts."""
    if numbers[0] != OPENING_BRACKET or numbers[len(numbers) - 1] != CLOSING_BRACKET:
        return False
    place = 1
    for i in range(len(counts)):
        while numbers[place] == SPACE:
            place += 1
        value, begin = 0, place
        while ZERO <= numbers[place] <= NINE:
            value = 10 * value + numbers[place] - ZERO
            place += 1
        if place == begin or place > begin + 5 or value != counts[i]:
            return False
        while numbers[place] == SPACE:
            place += 1
        if numbers[place] != (COMMA if i + 1 < len(counts) else CLOSING_BRACKET):
            return False
        place += 1
    return place == len(numbers)


def _compiled() -> Callable[[Bytes, Bytes, Counts], bool]:
    """Return `_parse` for its argument types: a call need not find them out."""
    dispatcher: Any = _parse
    entry: Callable[[Bytes, Bytes, Counts], bool] = dispatcher.compile(
        "boolean(uint8[::1], uint8[::1], uint16[::1])"
    )
    return entry


_PARSER = _compiled()
"""Compiled when this module is imported: before a source is opened."""
