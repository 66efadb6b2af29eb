"""What AnySkin and ReSkin boards send, decoded. No I/O, no clock.

A board sends one packet a sample, binary or text, by its firmware (the sketches of ReSkin's
authors). Binary: of each magnetometer four float32, little endian: temperature, x, y, z; then
CR LF. Text: of each x, y, z and temperature, apart by tabs; then CR LF. x, y, z are in
microtesla. Nothing but the end of the last one marks where a packet begins, and CR LF may be in
a number: what begins after CR LF is a packet where it ends where it should, and every number is
plausible.
"""

import math
import re
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

END = b"\r\n"
FLOATS = 4
"""Numbers of a magnetometer."""
SMALLEST, LARGEST = 1e-3, 1e6
"""Of a reading that is not 0 [uT]; the chip resolves 0.15 and ends at 50 000."""
HOTTEST = 200.0
"""Largest temperature, up or down [degrees Celsius]."""
LONGEST_LINE = 4096
MOST = 32
"""Packets of up to so many magnetometers are known as such where others are expected."""

_LINE = re.compile(rb"[-+.0-9eE \t]{7,%d}\r?\n" % LONGEST_LINE)
_IN_LINE = re.compile(rb"[-+.0-9eE \t]*\r?")

Sample = npt.NDArray[np.float32]


class Decoded(NamedTuple):
    """What was in some bytes.

    Attributes:
        samples: (n_mags, 3) x, y, z of each magnetometer [uT], one after the other.
        n_refused: how many packets were dropped; where none can be told from another, one for
            as many bytes as a packet has.
        other: number of magnetometers of the packets that come, where that is not the one
            expected; 0 where it is, or nobody knows.
    """

    samples: list[Sample]
    n_refused: int
    other: int


class Decoder:
    r"""Finds packets in bytes that come in pieces of any size.

    What comes first may be half a packet: it is dropped, and not counted as refused.

    Args:
        n_mags: magnetometers of the board.

    Example:
        >>> packet = np.arange(1, 9, dtype="<f4").tobytes() + b"\r\n"
        >>> Decoder(2).feed(b"...\r\n" + packet).samples[0].tolist()
        [[2.0, 3.0, 4.0], [6.0, 7.0, 8.0]]
    """

    def __init__(self, n_mags: int) -> None:
        self._n_mags = n_mags
        self._length = _length(n_mags)
        self.reset()

    def reset(self) -> None:
        """Forgets everything, as after the board was connected anew."""
        self._held = b""
        self._after_line = False
        self._recent = b""
        self._other = 0
        self._skipped = -self._length
        self._n_refused = 0

    def feed(self, data: bytes) -> Decoded:
        """Takes what came next."""
        before = self._n_refused
        samples: list[Sample] = []
        self._held += data
        self._recent = (self._recent + data)[-3 * _length(MOST) :]
        at = 0
        while (end := self._step(at, samples)) is not None:
            at = end
        if at:
            self._after_line = self._held[at - 1 : at] == b"\n"
            self._held = self._held[at:]
        if self._n_refused > before and not samples:
            self._other = _other(self._recent, self._n_mags) or self._other
        return Decoded(samples, self._n_refused - before, self._other)

    def _step(self, at: int, samples: list[Sample]) -> int | None:
        """Where what is at a place ends; None where more has to come to tell."""
        begins = self._held[at - 1 : at] == b"\n" if at else self._after_line
        if begins and (line := _LINE.match(self._held, at)):
            numbers = _numbers(line[0])
            if numbers is not None:
                self._take_line(numbers, samples)
                return line.end()
        n_left = len(self._held) - at
        if not n_left or (begins and (n_left < self._length or self._is_half_line(at))):
            return None
        sample = _packet(self._held, at, self._n_mags) if begins else None
        if sample is not None:
            self._take(sample, samples)
            return at + self._length
        end = self._held.find(b"\n", at) + 1 or len(self._held)
        self._skip(end - at)
        return end

    def _take(self, sample: Sample, samples: list[Sample]) -> None:
        samples.append(sample)
        self._skipped = self._other = 0

    def _take_line(self, numbers: Sample, samples: list[Sample]) -> None:
        """Of a line, x, y, z and temperature of each magnetometer."""
        if len(numbers) != self._n_mags:
            self._other = len(numbers)
            self._n_refused += 1
        elif _is_plausible(numbers[:, 3], numbers[:, :3]):
            self._take(numbers[:, :3].copy(), samples)
        else:
            self._n_refused += 1

    def _is_half_line(self, at: int) -> bool:
        match = _IN_LINE.match(self._held, at)
        end = match.end() if match else at
        return end == len(self._held) and end - at <= LONGEST_LINE

    def _skip(self, n_bytes: int) -> None:
        """Counts as refused what begins another packet's length."""
        counted = math.ceil(max(self._skipped, 0) / self._length)
        self._skipped += n_bytes
        self._n_refused += math.ceil(max(self._skipped, 0) / self._length) - counted


def _length(n_mags: int) -> int:
    return 4 * FLOATS * n_mags + len(END)


def _packet(data: bytes, at: int, n_mags: int) -> Sample | None:
    """The sample of a binary packet at a place, where there is one."""
    end = at + _length(n_mags)
    if data[end - len(END) : end] != END:
        return None
    numbers = np.frombuffer(data, "<f4", FLOATS * n_mags, at).reshape(n_mags, FLOATS)
    if not _is_plausible(numbers[:, 0], numbers[:, 1:]):
        return None
    return numbers[:, 1:].astype(np.float32)


def _numbers(line: bytes) -> Sample | None:
    """(n_mags, 4) of a line, where it has four numbers a magnetometer."""
    words = line.split()
    if not words or len(words) % FLOATS:
        return None
    try:
        numbers = np.array([float(word) for word in words])
    except ValueError:
        return None
    with np.errstate(over="ignore"):
        return numbers.astype(np.float32).reshape(-1, FLOATS)


def _is_plausible(temperatures: npt.NDArray[np.float32], readings: Sample) -> bool:
    with np.errstate(invalid="ignore"):  # any bytes may be here
        sizes = np.abs(readings)
        sound = (sizes <= LARGEST) & ((sizes >= SMALLEST) | (sizes == 0))
        return bool(sound.all() and (np.abs(temperatures) <= HOTTEST).all())


def _other(data: bytes, n_mags: int) -> int:
    """Of how many magnetometers two packets in a row are, other than expected; 0 for none."""
    for count in range(1, MOST + 1):
        place = data.find(END)
        while count != n_mags and place >= 0:
            at = place + len(END)
            if all(_packet(data, at + k * _length(count), count) is not None for k in range(2)):
                return count
            place = data.find(END, place + 1)
    return 0
