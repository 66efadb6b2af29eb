"""Decoding of the packets of AnySkin and ReSkin boards. No I/O and no clock.

A board sends one packet a sample, binary or text, by its firmware (the sketches of ReSkin's
authors). Binary: four little-endian float32 of each magnetometer (temperature, x, y, z), then CR
LF. Text: x, y, z and temperature of each magnetometer, separated by tabs, then CR LF. x, y, z are
in microtesla. Only the end of a packet marks the beginning of the next one, and a number may
contain CR LF. Therefore the bytes after CR LF are a packet if it ends at the expected offset and
every number is plausible.
"""

import math
import re
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

END = b"\r\n"
N_FLOATS = 4
"""Numbers of a magnetometer."""
MIN_READING, MAX_READING = 1e-3, 1e6
"""Magnitude of a plausible reading that is not 0 [uT]; the chip resolves 0.15 up to 50,000."""
MAX_TEMPERATURE = 200.0
"""Largest magnitude of a plausible temperature [degrees Celsius]."""
MAX_LINE_LENGTH = 4096
"""Longest line of text [bytes]."""
MAX_OTHER_MAGS = 32
"""Packets with another number of magnetometers than expected are recognized up to this number."""

_LINE = re.compile(rb"[-+.0-9eE \t]{7,%d}\r?\n" % MAX_LINE_LENGTH)
_IN_LINE = re.compile(rb"[-+.0-9eE \t]*\r?")

Sample = npt.NDArray[np.float32]


class DecodedBytes(NamedTuple):
    """Content of some bytes.

    Attributes:
        samples: (n_mags, 3) x, y, z of each magnetometer [uT], in order.
        n_refused: number of dropped packets; if they cannot be separated, one for the length of
            a packet.
        other_n_mags: number of magnetometers in the packets, if it is recognized and not the
            expected one; 0 otherwise.
    """

    samples: list[Sample]
    n_refused: int
    other_n_mags: int


class AnySkinDecoder:
    r"""Decoder of packets in chunks of bytes of any size.

    The first bytes may be half a packet. They are dropped, and not counted as refused.

    Args:
        n_mags: number of magnetometers of the board.

    Example:
        >>> packet = np.arange(1, 9, dtype="<f4").tobytes() + b"\r\n"
        >>> AnySkinDecoder(2).feed(b"...\r\n" + packet).samples[0].tolist()
        [[2.0, 3.0, 4.0], [6.0, 7.0, 8.0]]
    """

    def __init__(self, n_mags: int) -> None:
        self._n_mags = n_mags
        self._length = _length(n_mags)
        self.reset()

    def reset(self) -> None:
        """Drop all bytes, because the board was connected again."""
        # Bytes that are not decoded yet, and whether a packet may begin with them.
        self._buffer = b""
        self._after_line = False
        # The newest bytes, in which packets of another length are looked for.
        self._recent = b""
        self._other_n_mags = 0
        # Bytes skipped since the last sample. It begins one packet below 0: half a packet at the
        # beginning is normal, and is not counted.
        self._n_skipped = -self._length
        self._n_refused = 0

    def feed(self, data: bytes) -> DecodedBytes:
        """Decode the next bytes."""
        before = self._n_refused
        samples: list[Sample] = []
        self._buffer += data
        self._recent = (self._recent + data)[-3 * _length(MAX_OTHER_MAGS) :]
        at = 0
        while (end := self._step(at, samples)) is not None:
            at = end
        if at:
            self._after_line = self._buffer[at - 1 : at] == b"\n"
            self._buffer = self._buffer[at:]
        # Looked for only where nothing else fits: it is slow, and may find a packet by chance.
        if self._n_refused > before and not samples:
            self._other_n_mags = _other_n_mags(self._recent, self._n_mags) or self._other_n_mags
        return DecodedBytes(samples, self._n_refused - before, self._other_n_mags)

    def _step(self, at: int, samples: list[Sample]) -> int | None:
        """Decode or skip the bytes at an offset; return where they end, None if more are needed."""
        begins = self._buffer[at - 1 : at] == b"\n" if at else self._after_line
        # Text before binary: hardly any binary packet has digits and blanks only.
        if begins and (line := _LINE.match(self._buffer, at)):
            numbers = _numbers(line[0])
            if numbers is not None:
                if len(numbers) == self._n_mags and _is_plausible(numbers[:, 3], numbers[:, :3]):
                    self._take(numbers[:, :3].copy(), samples)
                else:
                    if len(numbers) != self._n_mags:
                        self._other_n_mags = len(numbers)
                    self._n_refused += 1
                return line.end()
        n_left = len(self._buffer) - at
        if begins and n_left >= self._length:
            match = _IN_LINE.match(self._buffer, at)
            line_end = match.end() if match else at
            if line_end == len(self._buffer) and n_left <= MAX_LINE_LENGTH:
                return None  # half a line
        elif begins or not n_left:
            return None
        sample = _packet(self._buffer, at, self._n_mags) if begins else None
        if sample is not None:
            self._take(sample, samples)
            return at + self._length
        end = self._buffer.find(b"\n", at) + 1 or len(self._buffer)
        # A packet counts as refused for each length of a packet that begins in these bytes.
        counted = math.ceil(max(self._n_skipped, 0) / self._length)
        self._n_skipped += end - at
        self._n_refused += math.ceil(max(self._n_skipped, 0) / self._length) - counted
        return end

    def _take(self, sample: Sample, samples: list[Sample]) -> None:
        samples.append(sample)
        self._n_skipped = self._other_n_mags = 0


def _length(n_mags: int) -> int:
    return 4 * N_FLOATS * n_mags + len(END)


def _packet(data: bytes, at: int, n_mags: int) -> Sample | None:
    """Return the sample of a binary packet at an offset, or None if there is none."""
    end = at + _length(n_mags)
    if data[end - len(END) : end] != END:
        return None
    numbers = np.frombuffer(data, "<f4", N_FLOATS * n_mags, at).reshape(n_mags, N_FLOATS)
    if not _is_plausible(numbers[:, 0], numbers[:, 1:]):
        return None
    return numbers[:, 1:].astype(np.float32)


def _numbers(line: bytes) -> Sample | None:
    """Return (n_mags, 4) numbers of a line, or None if it has not four for each magnetometer."""
    fields = line.split()
    if not fields or len(fields) % N_FLOATS:
        return None
    try:
        numbers = np.array([float(field) for field in fields])
    except ValueError:
        return None
    with np.errstate(over="ignore"):
        return numbers.astype(np.float32).reshape(-1, N_FLOATS)


def _is_plausible(temperatures: npt.NDArray[np.float32], readings: Sample) -> bool:
    with np.errstate(invalid="ignore"):  # any bytes may be here
        sizes = np.abs(readings)
        plausible = (sizes <= MAX_READING) & ((sizes >= MIN_READING) | (sizes == 0))
        return bool(plausible.all() and (np.abs(temperatures) <= MAX_TEMPERATURE).all())


def _other_n_mags(data: bytes, n_mags: int) -> int:
    """Return the unexpected number of magnetometers of two successive packets, 0 for none."""
    for count in range(1, MAX_OTHER_MAGS + 1):
        # Two in a row: one would be found by chance in other packets.
        end = data.find(END)
        while count != n_mags and end >= 0:
            at = end + len(END)
            if all(_packet(data, at + k * _length(count), count) is not None for k in range(2)):
                return count
            end = data.find(END, end + 1)
    return 0
