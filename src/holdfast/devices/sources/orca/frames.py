"""Frames of ORCA Touch, at the host and at the hand. No I/O and no clock: times are arguments.

From ORCA's public driver (orca_core, commit c783006, MIT). Numbers are little-endian, and the last
byte of each frame makes the sum of all its bytes a multiple of 256.

- Request: 55 AA, 00, function, u16 address, u16 count, data. Response: AA 55, then the same.
- Stream: AA 56, 00, u16 length, error, data: int8 fx, int8 fy and uint8 fz of each taxel [0.1 N],
  finger after finger. The length counts error and data. AA A9 begins frames of joint encoders.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from holdfast.devices.sources.base import ModuleSamples
from holdfast.sensors.types import Array

FINGER_PLACES = {"thumb": 2, "index": 6, "middle": 10, "ring": 14, "pinky": 18}
"""Fingers in the order of the frames: the bit of each in the register of what is connected, and the
index of its fingertip in that of the numbers of taxels."""
STEP = 0.1
"""Force of a count [N]."""
RESPONSE, TOUCH, ENCODERS = b"\xaa\x55", b"\xaa\x56", b"\xaa\xa9"
"""The two bytes with which frames of the hand begin."""
REQUEST = b"\x55\xaa"
READ, WRITE = 3, 16
CONNECTED, N_TAXELS, STREAM_TYPE, STREAM_ENABLE = 0x10, 0x30, 0x16, 0x17
"""Addresses of registers."""
CONNECTED_SIZE, N_TAXELS_SIZE = 4, 56
TAXELS_ONLY = 2
MAX_LENGTH = 8192
"""Maximum length that a frame of a stream states."""
HEADER_SIZE = 8
"""Bytes that say how long a frame is; no frame of the hand that matters is shorter."""

RESPONSE_TIMEOUT = 0.5
"""Time after which a request is sent again [s]."""
REARM_SILENCE, REARM_INTERVAL = 2.0, 5.0
"""A hand that was reset sends no frame: the stream is requested again after this silence, and not
more often than once in this interval [s]."""


class TouchFrames(NamedTuple):
    """Content of some bytes.

    Attributes:
        samples: (n_taxels, 3) of all fingers [N].
        n_damaged: number of frames whose checksum is wrong, or that report an error.
        n_lost: number of gaps in the bytes: at least so many frames were cut or lost.
    """

    samples: list[Array]
    n_damaged: int
    n_lost: int


def sealed(frame: bytes) -> bytes:
    """Return a frame with its checksum.

    Example:
        >>> sealed(bytes.fromhex("55aa00101700010001")).hex()
        '55aa00101700010001d8'
    """
    return frame + bytes([-sum(frame) & 0xFF])


def register_frame(begin: bytes, function: int, address: int, data: bytes, count: int) -> bytes:
    """Return a request or a response."""
    numbers = address.to_bytes(2, "little") + count.to_bytes(2, "little")
    return sealed(begin + bytes([0, function]) + numbers + data)


QUESTIONS = (
    register_frame(REQUEST, READ, CONNECTED, b"", CONNECTED_SIZE),
    register_frame(REQUEST, READ, N_TAXELS, b"", N_TAXELS_SIZE),
    register_frame(REQUEST, WRITE, STREAM_TYPE, bytes([TAXELS_ONLY]), 1),
    register_frame(REQUEST, WRITE, STREAM_ENABLE, b"\x01", 1),
)
"""Requests that begin the stream; each waits for the response to the one before."""


class OrcaClient:
    """The host's side of the connection.

    Attributes:
        fingers: number of taxels of each connected finger, in the order of the frames.
        n_bytes: number of bytes received.
        n_responses: number of responses to the questions.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the hand, because the port was opened again."""
        self.fingers: dict[str, int] = {}
        self.n_bytes = self.n_responses = 0
        self._buffer, self._n_skipped = b"", 0
        self._n_damaged = self._n_lost = self._connected = self._frame_length = 0
        # The number of the question that waits for its response, when it was sent, when the first
        # one was, and when the newest frame of the stream came [s].
        self._question, self._asked_at, self._begun_at = 0, -math.inf, -math.inf
        self._frame_at = -math.inf

    def request(self, now: float) -> bytes:
        """Return the request to send now, or nothing."""
        if self._question == len(QUESTIONS):
            silent_since = max(self._frame_at, self._asked_at)
            if now < max(silent_since + REARM_SILENCE, self._begun_at + REARM_INTERVAL):
                return b""
            self._question = 0
        if now < self._asked_at + RESPONSE_TIMEOUT:
            return b""
        if not self._question:
            self._begun_at = now
        self._asked_at = now
        return QUESTIONS[self._question]

    def feed(self, data: bytes, now: float) -> TouchFrames:
        """Decode the next bytes, received at a time [s]."""
        self.n_bytes += len(data)
        buffer, at = self._buffer + data, 0
        samples: list[Array] = []
        n_damaged, n_lost = self._n_damaged, self._n_lost
        while at < len(buffer):
            length = self._length(buffer, at)
            if length is None or at + length > len(buffer):
                break
            frame = buffer[at : at + length]
            if length and not sum(frame) & 0xFF:
                self._take(frame, samples, now)
                at += length
            else:
                end = buffer.find(TOUCH[:1], at + 1)
                end = len(buffer) if end < 0 else end
                self._n_skipped += end - at
                at = end
        self._buffer = buffer[at:]
        return TouchFrames(samples, self._n_damaged - n_damaged, self._n_lost - n_lost)

    def _length(self, buffer: bytes, at: int) -> int | None:
        """Return the length of the frame at an offset, 0 if none begins, None if it is unknown."""
        head = buffer[at : at + HEADER_SIZE]
        if head[:1] != TOUCH[:1]:
            return 0
        if len(head) < HEADER_SIZE:
            return None
        stated = int.from_bytes(head[3:5], "little")
        if head[:2] == RESPONSE:
            count = int.from_bytes(head[6:8], "little")
            return HEADER_SIZE + count + 1 if count <= N_TAXELS_SIZE else 0
        # Only the known length: a false header must not hold back the frames behind it.
        if head[:2] == TOUCH:
            return self._frame_length if 6 + stated == self._frame_length else 0
        return 6 + stated if head[:2] == ENCODERS and 0 < stated <= MAX_LENGTH else 0

    def _take(self, frame: bytes, samples: list[Array], now: float) -> None:
        if self._frame_at > -math.inf:  # else the first frame was cut when the port was opened
            # Whole lengths are damaged frames; a rest is what is left of a frame that was cut.
            whole, rest = divmod(self._n_skipped, self._frame_length)
            self._n_damaged += whole
            self._n_lost += rest > 0
        self._n_skipped = 0
        if frame[:2] == RESPONSE:
            self._answer(frame)
        elif frame[:2] == TOUCH:
            self._frame_at, self._question = now, len(QUESTIONS)
            if frame[5]:
                self._n_damaged += 1
            else:
                samples.append(forces_of(frame[6:-1]))

    def _answer(self, frame: bytes) -> None:
        """Take the response to the newest question; any other is late, and is ignored."""
        if self._question == len(QUESTIONS) or frame[2:6] != QUESTIONS[self._question][2:6]:
            return
        data = frame[HEADER_SIZE:-1]
        if frame[3] == WRITE and any(data):  # refused: it is sent again after the timeout
            return
        if self._question == 0:
            self._connected = int.from_bytes(data, "little")
        elif self._question == 1:
            counts = np.frombuffer(data, "<u2").tolist()
            self.fingers = {
                name: counts[place]
                for name, place in FINGER_PLACES.items()
                if counts[place] and self._connected >> place & 1
            }
            self._frame_length = 7 + 3 * sum(self.fingers.values())
        self.n_responses += 1
        self._question += 1
        self._asked_at = -math.inf  # the next question at once


def forces_of(data: bytes) -> Array:
    """Return (n_taxels, 3) [N] of the data of a frame."""
    raw = np.frombuffer(data, np.uint8).reshape(-1, 3)
    counts = raw.astype(np.float64)
    counts[:, :2] = raw[:, :2].view(np.int8)
    return STEP * counts


WRITES = ((STREAM_TYPE, bytes([TAXELS_ONLY])), (STREAM_ENABLE, b"\x00"), (STREAM_ENABLE, b"\x01"))
"""Writes that `OrcaHand` accepts; those to the type end the stream until it is enabled again."""
MAX_REQUEST_SIZE = 64
"""Bytes of a request that are kept until it is whole."""


class OrcaHand:
    """The hand's side of the connection, for `holdfast play`.

    Args:
        fingers: number of taxels of each finger; any of `FINGER_PLACES`.

    Attributes:
        is_streaming: whether the host has requested the stream.
    """

    def __init__(self, fingers: Mapping[str, int]) -> None:
        self.fingers = {name: fingers[name] for name in FINGER_PLACES if name in fingers}
        self.is_streaming = False
        places = [FINGER_PLACES[name] for name in self.fingers]
        counts = np.zeros(N_TAXELS_SIZE // 2, "<u2")
        counts[places] = list(self.fingers.values())
        connected = sum(1 << place for place in places).to_bytes(CONNECTED_SIZE, "little")
        self._registers = {CONNECTED: connected, N_TAXELS: counts.tobytes()}
        self._buffer = b""

    def feed(self, data: bytes) -> bytes:
        """Return the responses to the requests in the next bytes."""
        self._buffer += data
        responses = b""
        while (at := self._buffer.find(REQUEST)) >= 0:
            head = self._buffer[at : at + HEADER_SIZE]
            address, count = (int.from_bytes(head[k : k + 2], "little") for k in (4, 6))
            end = at + HEADER_SIZE + (count if head[3:4] == bytes([WRITE]) else 0) + 1
            if len(self._buffer) < end:
                break
            request, self._buffer = self._buffer[at:end], self._buffer[end:]
            if not sum(request) & 0xFF:
                responses += self._response(head[3], address, request[HEADER_SIZE:-1])
        self._buffer = self._buffer[-MAX_REQUEST_SIZE:]
        return responses

    def _response(self, function: int, address: int, data: bytes) -> bytes:
        if function == READ:
            answer = self._registers.get(address, b"")
        else:
            if is_known := (address, data) in WRITES:
                self.is_streaming = (address, data) == (STREAM_ENABLE, b"\x01")
            answer = bytes([not is_known])
        return register_frame(RESPONSE, function, address, answer, len(answer))

    def frame(self, samples: ModuleSamples) -> bytes:
        """Return the frame of the (n_taxels, 3) of each finger [N]."""
        forces = np.concatenate([samples[name] for name in self.fingers])
        counts = np.clip(np.rint(forces / STEP), (-128, -128, 0), (127, 127, 255))
        data = b"\x00" + counts.astype(np.int64).astype(np.uint8).tobytes()
        return sealed(TOUCH + b"\x00" + len(data).to_bytes(2, "little") + data)
