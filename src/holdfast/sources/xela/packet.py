"""One packet of XELA's server as values: what it says, checked. No state, no I/O."""

import re
from array import array
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

COUNTER = 2**32
"""Where the counter of packets begins again."""
RESTART = 2**16
"""A counter that goes on by more, or goes back, has begun anew: nothing was lost."""
EARLIEST, LATEST = -1e11, 1e11
"""Stamps beyond, 3,000 years from 1970 [s], make no sense; doubles still hold 0.1 ms there."""
ROUTINE = "routine"
"""The type of packets with samples, where a packet has a type (from 1.8 on)."""

_NOT_A_NUMBER = re.compile(rb"-?\b(?:NaN|Infinity)\b")
_NAME = 64
"""Letters that the name of a model or version has at the most."""
_WORDS = 160
"""Letters of the decoder's complaint that are passed on."""


Model = Annotated[str, msgspec.Meta(max_length=_NAME)]


class Refusal(ValueError):  # noqa: N818 (it says what was done with the packet)
    """A packet, or a sensor in it, that makes no sense; its text says why."""


class Packet(NamedTuple):
    """What the server says at one instant.

    Attributes:
        counter: of packets, from 0 to 2**32 - 1; from 0 again where the server restarts.
        time: since 1970 by the server's clock [s].
        version: of the server; "" where it does not tell (before 1.8).
        sensors: by number, in order; not looked into yet.
    """

    counter: int
    time: float
    version: str
    sensors: Mapping[int, msgspec.Raw]


class Counts(msgspec.Struct):
    """A sensor of a packet: its readings in counts, twice or in one of two forms."""

    taxels: int | None = None
    time: float | None = None
    model: Model = ""
    data: str | None = None
    integer: list[int] | None = None

    def readings(self) -> npt.NDArray[np.uint16] | None:
        """(n_taxels, 3) in counts, or None where there are none.

        Raises:
            Refusal: they contradict each other, or are no counts.
        """
        if not self.data:
            return _points(_from_integers(self.integer)) if self.integer else None
        counts = _from_hex(self.data)
        if self.integer and _from_integers(self.integer).tobytes() != counts.tobytes():
            raise Refusal("data and integer differ")
        return _points(counts)


class Calibrated(msgspec.Struct):
    """A sensor of a packet: its readings in newtons."""

    taxels: int | None = None
    time: float | None = None
    model: Model = ""
    calibrated: list[float | None] | None = None

    def readings(self) -> npt.NDArray[np.float64] | None:
        """(n_taxels, 3) [N], or None where there are none; NaN where a value is missing.

        Raises:
            Refusal: their number is no multiple of three.
        """
        if not self.calibrated:
            return None
        return _points(np.array(self.calibrated, dtype=np.float64))


_PACKET = msgspec.json.Decoder(dict[str, msgspec.Raw])
_ANY = msgspec.json.Decoder()
_COUNTS = msgspec.json.Decoder(Counts)
_CALIBRATED = msgspec.json.Decoder(Calibrated)


def read_packet(text: str | bytes) -> Packet | None:
    """What a packet says; None where it is none with samples, like the first, "Welcome".

    Raises:
        Refusal: it is no JSON object, or its counter or time make no sense.

    Example:
        >>> read_packet('{"message": "Welcome"}')
        >>> read_packet('{"message": 7, "time": 1.5, "1": {}}').counter
        7
    """
    fields = _fields(text)
    sensors = {int(key): value for key, value in fields.items() if _is_number(key)}
    counter = _value(fields, "message")
    if isinstance(counter, bool) or not isinstance(counter, int):
        return None
    if _value(fields, "type") not in (None, ROUTINE):
        return None
    if not 0 <= counter < COUNTER:
        raise Refusal("its counter is no uint32")
    time = _value(fields, "time")
    version = _value(fields, "version")
    ordered = dict(sorted(sensors.items()))
    known = version[:_NAME] if isinstance(version, str) else ""
    return Packet(counter, _stamp(time), known, ordered)


def read_sensor(raw: msgspec.Raw, *, calibrated: bool) -> Counts | Calibrated:
    """A sensor of a packet, with its readings in counts or in newtons.

    Raises:
        Refusal: it is no JSON object with fields of the types that are expected.
    """
    try:
        part = (_CALIBRATED if calibrated else _COUNTS).decode(raw)
    except (ValueError, RecursionError) as cause:
        raise Refusal(str(cause)[:_WORDS]) from cause
    if part.time is not None:
        part.time = _stamp(part.time)
    return part


def _fields(text: str | bytes) -> dict[str, msgspec.Raw]:
    try:
        given = text.encode() if isinstance(text, str) else text
        try:
            return _PACKET.decode(given)
        except msgspec.DecodeError:
            if not _NOT_A_NUMBER.search(given):
                raise
            return _PACKET.decode(_NOT_A_NUMBER.sub(b"null", given))
    except (ValueError, RecursionError) as cause:
        raise Refusal(str(cause)[:_WORDS]) from cause


def _is_number(key: str) -> bool:
    return len(key) <= 4 and key.isascii() and key.isdigit()


def _value(fields: Mapping[str, msgspec.Raw], name: str) -> Any:  # noqa: ANN401 (any JSON value)
    try:
        return _ANY.decode(fields[name]) if name in fields else None
    except (ValueError, RecursionError) as cause:
        raise Refusal(str(cause)[:_WORDS]) from cause


def _stamp(time: object) -> float:
    if isinstance(time, bool) or not isinstance(time, int | float):
        raise Refusal("its time is no number")
    if not EARLIEST < time < LATEST:
        raise Refusal("its time is thousands of years away")
    return float(time)


def _from_hex(text: str) -> npt.NDArray[np.uint16]:
    """Four hexadecimal digits a number, a comma between them."""
    n = (len(text) + 1) // 5
    if len(text) != 5 * n - 1 or text[4::5] != "," * (n - 1):
        raise Refusal("four hexadecimal digits a number expected in data, with commas between")
    try:
        digits = bytes.fromhex(text.replace(",", ""))
    except ValueError as cause:
        raise Refusal("what is no hexadecimal digit stands in data") from cause
    if len(digits) != 2 * n:  # it skips white space
        raise Refusal("what is no hexadecimal digit stands in data")
    return np.frombuffer(digits, ">u2").astype(np.uint16)


def _from_integers(values: list[int]) -> npt.NDArray[np.uint16]:
    try:
        return np.frombuffer(array("H", values), np.uint16)  # faster than NumPy's way
    except OverflowError as cause:
        raise Refusal("integer holds what is no uint16") from cause


def _points(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if len(values) % 3:
        raise Refusal(f"{len(values)} values given, three a taxel expected")
    return values.reshape(-1, 3)


def n_missing(last: int, counter: int) -> int:
    """How many packets are missing between two counts.

    Example:
        >>> n_missing(2**32 - 2, 1), n_missing(5000, 0)
        (2, 0)
    """
    step = (counter - last) % COUNTER
    return step - 1 if 0 < step < RESTART else 0
