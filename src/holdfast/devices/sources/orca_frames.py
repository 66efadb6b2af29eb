"""Frames of ORCA Touch, at the host and at the hand. No I/O and no clock: times are arguments.

From ORCA's public driver (orca_core, commit c783006, MIT). Numbers are little-endian, and the last
byte of each frame makes the sum of all its bytes a multiple of 256.

- Request: 55 AA, 00, function, u16 address, u16 count, data. Response: AA 55, then the same.
- Stream: AA 56, 00, u16 length, error, data: int8 fx, int8 fy and uint8 fz of each taxel [0.1 N],
  finger after finger. The length counts error and data. AA A9 begins frames of joint encoders.
"""

import math
import re
from collections.abc import Iterator, Mapping

import numpy as np

from holdfast.devices.sources.base import ModuleSamples
from holdfast.sensors.types import Array

FINGER_PLACES = {"thumb": 2, "index": 6, "middle": 10, "ring": 14, "pinky": 18}
"""Fingers in the order of the frames: the bit of each in the register of what is connected, and the
index of its fingertip in that of the numbers of taxels."""
STEP = 0.1
"""Force of a count [N]."""
REQUEST, RESPONSE, TOUCH, ENCODERS = b"\x55\xaa", b"\xaa\x55", b"\xaa\x56", b"\xaa\xa9"
"""The two bytes with which a frame begins."""
READ, WRITE = 3, 16
CONNECTED, N_TAXELS, STREAM_TYPE, STREAM_ENABLE = 0x10, 0x30, 0x16, 0x17
"""Addresses of registers."""
CONNECTED_SIZE, N_TAXELS_SIZE = 4, 56
TAXELS_ONLY, ENABLED = b"\x02", b"\x01"
MAX_LENGTH = 8192
"""Maximum length that a frame of a stream states."""
HEADER_SIZE = 8
"""Bytes that say how long a frame is; no frame of interest is shorter."""
RESPONSE_TIMEOUT = 0.5
"""Time after which a request is sent again [s]."""
REARM_SILENCE, REARM_INTERVAL = 2.0, 5.0
"""A hand that was reset sends no frame: the stream is requested again after this silence, and not
more often than once in this interval [s]."""

_BEGIN = re.compile(b"[\x55\xaa]")


def sealed(frame: bytes) -> bytes:
    """Return a frame with its checksum.

    Example:
        >>> sealed(bytes.fromhex("55aa00101700010001")).hex()
        '55aa00101700010001d8'
    """
    return frame + bytes([-sum(frame) & 0xFF])


def register_frame(begin: bytes, function: int, address: int, count: int, data: bytes) -> bytes:
    """Return a request or a response."""
    numbers = address.to_bytes(2, "little") + count.to_bytes(2, "little")
    return sealed(begin + bytes([0, function]) + numbers + data)


QUESTIONS = (
    register_frame(REQUEST, READ, CONNECTED, CONNECTED_SIZE, b""),
    register_frame(REQUEST, READ, N_TAXELS, N_TAXELS_SIZE, b""),
    register_frame(REQUEST, WRITE, STREAM_TYPE, 1, TAXELS_ONLY),
    register_frame(REQUEST, WRITE, STREAM_ENABLE, 1, ENABLED),
)
"""Requests that begin the stream; each waits for the response to the one before."""


class FrameReader:
    """Splitter of bytes, in pieces of any size, into frames whose checksum is right.

    Attributes:
        touch_length: length of the frames of the stream; others are none, so that a false header
            does not hold back the frames behind it.
    """

    def __init__(self) -> None:
        self.touch_length = self._n_skipped = 0
        self._buffer = b""

    def feed(self, data: bytes) -> Iterator[tuple[bytes, int]]:
        """Yield the next frames, each with the number of bytes before it that are no frame."""
        self._buffer += data
        while len(self._buffer) >= HEADER_SIZE and (n := self._length()) <= len(self._buffer):
            if n and not sum(self._buffer[:n]) & 0xFF:
                frame, n_skipped, self._n_skipped = self._buffer[:n], self._n_skipped, 0
                self._buffer = self._buffer[n:]
                yield frame, n_skipped
            else:
                found = _BEGIN.search(self._buffer, 1)
                n = found.start() if found else len(self._buffer)
                self._buffer = self._buffer[n:]
                self._n_skipped += n

    def _length(self) -> int:
        """Return the length of the frame that begins the buffer, 0 if none does."""
        begin, function = self._buffer[:2], self._buffer[3]
        length, count = (int.from_bytes(self._buffer[k : k + 2], "little") for k in (3, 6))
        if begin in (REQUEST, RESPONSE):
            n_data = count if begin == RESPONSE or function == WRITE else 0
            return HEADER_SIZE + n_data + 1 if count <= N_TAXELS_SIZE else 0
        is_stream = begin == ENCODERS or (begin == TOUCH and 6 + length == self.touch_length)
        return 6 + length if is_stream and 0 < length <= MAX_LENGTH else 0


class OrcaClient:
    """The host's side of the connection, which begins with the opening of the port.

    Attributes:
        fingers: number of taxels of each connected finger, in the order of the frames.
        n_bytes: number of bytes received.
        n_responses: number of responses to the questions.
    """

    def __init__(self) -> None:
        self.fingers: dict[str, int] = {}
        self.n_bytes = self.n_responses = self._connected = 0
        self._reader = FrameReader()
        # The number of the question that waits for its response, when it was sent, when the first
        # one was, and when the newest frame of the stream came [s].
        self._question, self._asked_at, self._begun_at = 0, -math.inf, -math.inf
        self._frame_at = -math.inf

    def request(self, now: float) -> bytes:
        """Return the request to send now, or nothing."""
        is_silent = now >= max(self._frame_at + REARM_SILENCE, self._begun_at + REARM_INTERVAL)
        if is_silent and self._question == len(QUESTIONS):
            self._question = 0
        if self._question == len(QUESTIONS) or now < self._asked_at + RESPONSE_TIMEOUT:
            return b""
        self._asked_at, self._begun_at = now, self._begun_at if self._question else now
        return QUESTIONS[self._question]

    def feed(self, data: bytes, now: float) -> tuple[list[Array], int, int]:
        """Decode the next bytes, received at a time [s].

        Returns:
            (n_taxels, 3) of all fingers [N] of each frame; the number of frames whose checksum is
            wrong, or that report an error; and the number of gaps in the bytes, in each of which
            at least one frame was cut or lost.
        """
        self.n_bytes += len(data)
        samples: list[Array] = []
        n_damaged = n_lost = 0
        for frame, n_skipped in self._reader.feed(data):
            if self._frame_at > -math.inf:  # the first frame was cut when the port was opened
                # Whole lengths are damaged frames; a rest is what is left of a frame that was cut.
                whole, rest = divmod(n_skipped, self._reader.touch_length)
                n_damaged, n_lost = n_damaged + whole, n_lost + (rest > 0)
            if frame[:2] == RESPONSE and self._question < len(QUESTIONS):
                self._answer(frame)
            elif frame[:2] == TOUCH:
                self._frame_at, self._question = now, len(QUESTIONS)
                n_damaged += frame[5] > 0
                samples += [] if frame[5] else [forces_of(frame[6:-1])]
        return samples, n_damaged, n_lost

    def _answer(self, frame: bytes) -> None:
        """Take the response to the newest question; a late one to another is ignored."""
        data = frame[HEADER_SIZE:-1]
        # A write that was refused is sent again after the timeout.
        if frame[2:6] != QUESTIONS[self._question][2:6] or (frame[3] == WRITE and any(data)):
            return
        if self._question == 0:
            self._connected = int.from_bytes(data, "little")
        elif self._question == 1:
            counts = np.frombuffer(data, "<u2").tolist()
            connected = (x for x in FINGER_PLACES.items() if self._connected >> x[1] & 1)
            self.fingers = {name: counts[k] for name, k in connected if counts[k]}
            self._reader.touch_length = 7 + 3 * sum(self.fingers.values())
        self.n_responses += 1
        self._question += 1
        self._asked_at = -math.inf  # the next question at once


def forces_of(data: bytes) -> Array:
    """Return (n_taxels, 3) [N] of the data of a frame."""
    raw = np.frombuffer(data, np.uint8).reshape(-1, 3)
    counts = raw.astype(np.float64)
    counts[:, :2] = raw[:, :2].view(np.int8)
    return STEP * counts


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
        counts = np.zeros(N_TAXELS_SIZE // 2, "<u2")
        counts[[FINGER_PLACES[name] for name in self.fingers]] = list(self.fingers.values())
        connected = sum(1 << FINGER_PLACES[name] for name in self.fingers)
        self._registers = {
            CONNECTED: connected.to_bytes(CONNECTED_SIZE, "little"),
            N_TAXELS: counts.tobytes(),
        }
        self._reader = FrameReader()

    def feed(self, data: bytes) -> bytes:
        """Return the responses to the requests in the next bytes."""
        responses = b""
        for request, _ in self._reader.feed(data):
            function, address = request[3:5]
            # A write stops the stream, unless it is the one that begins it.
            begins = request == QUESTIONS[-1]
            self.is_streaming = begins or (self.is_streaming and function == READ)
            content = self._registers.get(address, b"") if function == READ else b"\x00"
            responses += register_frame(RESPONSE, function, address, len(content), content)
        return responses

    def frame(self, samples: ModuleSamples) -> bytes:
        """Return the frame of the (n_taxels, 3) of each finger [N]."""
        forces = np.concatenate([samples[name] for name in self.fingers])
        counts = np.clip(np.rint(forces / STEP), (-128, -128, 0), (127, 127, 255))
        data = b"\x00" + counts.astype(np.int64).astype(np.uint8).tobytes()
        return sealed(TOUCH + b"\x00" + len(data).to_bytes(2, "little") + data)
