"""Parsing and checking of one packet of XELA's server. No state, no I/O."""

import re
from array import array
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.devices.sources.assembler import SEQUENCE_PERIOD
from holdfast.devices.sources.timeline import is_plausible

ROUTINE_TYPE = "routine"
"""Type of packets with samples; packets have a type since version 1.8."""
MAX_MODEL_NAME_LENGTH = 64
"""Longest name of a model or version [characters]."""
MAX_REASON_LENGTH = 160
"""Longest reason of the JSON decoder in a message [characters]."""

_NOT_A_NUMBER = re.compile(rb"-?\b(?:NaN|Infinity)\b")

Model = Annotated[str, msgspec.Meta(max_length=MAX_MODEL_NAME_LENGTH)]


class InvalidPacket(ValueError):  # noqa: N818 (it is not an error of the program)
    """A packet, or a sensor in it, is not valid. The message gives the reason."""


class Packet(NamedTuple):
    """Packet with samples.

    Attributes:
        counter: counter of packets, from 0 to 2**32 - 1; 0 after a restart of the server.
        time: stamp of the server's clock, since 1970 [s].
        version: version of the server; "" if the packet does not contain it (before 1.8).
        sensors: JSON of each sensor by number, in order, not parsed yet.
    """

    counter: int
    time: float
    version: str
    sensors: Mapping[int, msgspec.Raw]


class Counts(msgspec.Struct):
    """Sensor of a packet, with readings in counts in one or both of two forms."""

    taxels: int | None = None
    time: float | None = None
    model: Model = ""
    data: str | None = None
    integer: list[int] | None = None

    def readings(self) -> npt.NDArray[np.uint16] | None:
        """Return (n_taxels, 3) in counts, or None if there are none.

        Raises:
            InvalidPacket: the two forms differ, or are no counts.
        """
        if not self.data:
            return _points(_from_integers(self.integer)) if self.integer else None
        # Checked as a whole: a loop over 1,100 numbers would take most of the time of a packet.
        text = self.data
        n = (len(text) + 1) // 5
        if len(text) != 5 * n - 1 or text[4::5] != "," * (n - 1):
            raise InvalidPacket(
                "four hexadecimal digits a number expected in data, with commas between"
            )
        try:
            digits = bytes.fromhex(text.replace(",", " "))  # a text of another length takes longer
        except ValueError as cause:
            raise InvalidPacket(
                "data contains characters that are no hexadecimal digits"
            ) from cause
        if len(digits) != 2 * n:  # fromhex skips white space
            raise InvalidPacket("data contains characters that are no hexadecimal digits")
        counts = np.frombuffer(digits, ">u2").astype(np.uint16)
        # A packet that contradicts itself is damaged; comparing costs little.
        if self.integer and _from_integers(self.integer).tobytes() != counts.tobytes():
            raise InvalidPacket("data and integer differ")
        return _points(counts)


class Calibrated(msgspec.Struct):
    """Sensor of a packet, with readings in newtons."""

    taxels: int | None = None
    time: float | None = None
    model: Model = ""
    calibrated: list[float | None] | None = None

    def readings(self) -> npt.NDArray[np.float64] | None:
        """Return (n_taxels, 3) [N], NaN for missing values; None if there are none.

        Raises:
            InvalidPacket: the number of values is no multiple of three.
        """
        if not self.calibrated:
            return None
        return _points(np.array(self.calibrated, dtype=np.float64))


_PACKET = msgspec.json.Decoder(dict[str, msgspec.Raw])
_ANY = msgspec.json.Decoder()
_COUNTS = msgspec.json.Decoder(Counts)
_CALIBRATED = msgspec.json.Decoder(Calibrated)


def read_packet(text: str | bytes) -> Packet | None:
    """Parse a packet. Return None if it is no packet with samples, like the "Welcome".

    Raises:
        InvalidPacket: it is no JSON object, or its counter or time is not valid.

    Example:
        >>> read_packet('{"message": "Welcome"}')
        >>> read_packet('{"message": 7, "time": 1.5, "1": {}}').counter
        7
    """
    try:
        data = text.encode() if isinstance(text, str) else text
        try:
            fields = _PACKET.decode(data)
        except msgspec.DecodeError:
            # Tried after the plain form, which nearly all packets have.
            if not _NOT_A_NUMBER.search(data):
                raise
            fields = _PACKET.decode(_NOT_A_NUMBER.sub(b"null", data))
    except (ValueError, RecursionError) as cause:
        raise InvalidPacket(str(cause)[:MAX_REASON_LENGTH]) from cause
    sensors = {
        int(key): value
        for key, value in fields.items()
        if len(key) <= 4 and key.isascii() and key.isdigit()
    }
    # "Welcome" and answers to settings have a text or another type: they are no samples.
    counter = _value(fields, "message")
    if isinstance(counter, bool) or not isinstance(counter, int):
        return None
    if _value(fields, "type") not in (None, ROUTINE_TYPE):
        return None
    if not 0 <= counter < SEQUENCE_PERIOD:
        raise InvalidPacket("its counter is no uint32")
    time = _value(fields, "time")
    version = _value(fields, "version")
    ordered = dict(sorted(sensors.items()))
    version_text = version[:MAX_MODEL_NAME_LENGTH] if isinstance(version, str) else ""
    return Packet(counter, _stamp(time), version_text, ordered)


def read_sensor(raw: msgspec.Raw, *, calibrated: bool) -> Counts | Calibrated:
    """Parse a sensor of a packet, with its readings in counts or in newtons.

    Raises:
        InvalidPacket: it is no JSON object, or a field has another type than expected.
    """
    try:
        part: Counts | Calibrated = (_CALIBRATED if calibrated else _COUNTS).decode(raw)
    except (ValueError, RecursionError) as cause:
        raise InvalidPacket(str(cause)[:MAX_REASON_LENGTH]) from cause
    if part.time is not None:
        part.time = _stamp(part.time)
    return part


def _value(fields: Mapping[str, msgspec.Raw], name: str) -> Any:  # noqa: ANN401 (any JSON value)
    try:
        return _ANY.decode(fields[name]) if name in fields else None
    except (ValueError, RecursionError) as cause:
        raise InvalidPacket(str(cause)[:MAX_REASON_LENGTH]) from cause


def _stamp(time: object) -> float:
    if isinstance(time, bool) or not isinstance(time, int | float):
        raise InvalidPacket("its time is no number")
    if not is_plausible(time):
        raise InvalidPacket("its time is thousands of years away")
    return float(time)


def _from_integers(values: list[int]) -> npt.NDArray[np.uint16]:
    try:
        return np.frombuffer(array("H", values), np.uint16)  # faster than np.array
    except OverflowError as cause:
        raise InvalidPacket("integer contains a number that is no uint16") from cause


def _points(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    if len(values) % 3:
        raise InvalidPacket(f"{len(values)} values given, three a taxel expected")
    return values.reshape(-1, 3)
