"""Source of a sensor at a serial port: AnySkin and ReSkin boards, and the decoder of their packets.

A board sends one packet a sample, binary or text, by its firmware (the sketches of ReSkin's
authors). Binary: four little-endian float32 of each magnetometer (temperature, x, y, z), then CR
LF. Text: x, y, z and temperature of each magnetometer, separated by tabs, then CR LF. x, y, z are
in microtesla. Only the end of a packet marks the beginning of the next one, and a number may
contain CR LF. Therefore the bytes after CR LF are a packet if it ends at the expected place and
every number is plausible. The decoder has no I/O and no clock.
"""

import math
import re
import time
from errno import EACCES, ENOENT
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import DeviceSource, Source
from holdfast.devices.uri import Address
from holdfast.errors import MissingExtra, SourceError
from holdfast.sensors import Sensor, sensor

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
        """Decode or skip the bytes at a place; return where they end, None if more are needed."""
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
    """Return the sample of a binary packet at a place, or None if there is none."""
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
        place = data.find(END)
        while count != n_mags and place >= 0:
            at = place + len(END)
            if all(_packet(data, at + k * _length(count), count) is not None for k in range(2)):
                return count
            place = data.find(END, place + 1)
    return 0


try:
    from serial import Serial
    from serial.tools.list_ports import comports
except ImportError as missing:
    raise MissingExtra("pyserial", "serial") from missing

PARAMETERS = ("sensor", "fingers", "baud", "mags")
"""Names of the parameters of the URI."""
SERIAL_OPEN_TIMEOUT = 3.0
"""Longest wait for the first sample [s]; boards restart when their port is opened."""
DEFAULT_BAUD = 115200
MAX_READ_SIZE = 1 << 16
"""Largest number of bytes to read at a time."""
_BOARD = 1
"""Number of the board as a device."""


class SerialSource(DeviceSource):
    """Source of a board of magnetometers at a serial port.

    The board has no clock: the time of a sample is its time of arrival, on the host's monotonic
    clock. Samples that arrive together are a period of the sensor apart, or less if they would
    begin before the last sample.

    Args:
        address: `serial:///dev/ttyACM0?sensor=anyskin&fingers=1:index&baud=115200&mags=5`.

    Raises:
        ValueError: a parameter is not valid.
    """

    def __init__(self, address: Address) -> None:
        super().__init__()
        address.only(*PARAMETERS)
        self.name = address.text
        self._path = address.host + address.path
        if not self._path:
            raise ValueError(f"{address.text}: a port expected, as in serial:///dev/ttyACM0")
        self._baud = _positive(address, "baud", DEFAULT_BAUD)
        self._sensor = address.sensor() or sensor("anyskin")
        self._n_mags = _positive(address, "mags", self._sensor.n_taxels)
        modules = dict.fromkeys(_modules(address, self._n_mags, self._sensor), self._sensor)
        self._board = Device(_BOARD, self._sensor.name, modules)
        self._decoder = AnySkinDecoder(self._n_mags)
        self._assembler = Assembler()
        self._port: Serial | None = None

    def open(self) -> None:
        """Open the port, and wait for the first sample.

        Raises:
            SourceError: there is no such port, it cannot be opened, or no sample comes.
        """
        self.close()
        self._assembler = Assembler()
        self._assembler.devices = {_BOARD: self._board}
        self._newest = -math.inf
        try:
            self._connect()
            deadline, n_refused = time.monotonic() + SERIAL_OPEN_TIMEOUT, 0
            while not (decoded := self._read_port(max(deadline - time.monotonic(), 0.0))).samples:
                if decoded.other_n_mags:  # waiting longer would not change it
                    raise SourceError(f"{self.name}: {self._wrong_count(decoded)}")
                n_refused += decoded.n_refused
                if time.monotonic() >= deadline:
                    came = f"{n_refused} invalid packets came" if n_refused else "nothing came"
                    raise SourceError(
                        f"{self.name}: {came} within {SERIAL_OPEN_TIMEOUT:g} s; packets of "
                        f"{self._n_mags} magnetometers at {self._baud} baud expected"
                    )
        except (OSError, ValueError) as cause:  # ValueError: the port does not support the speed
            ports = ", ".join(sorted(port.device for port in comports())) or "none"
            raise SourceError(f"{self.name}: {_reason(cause)}; serial ports: {ports}") from cause
        self.sensors = self._board.modules
        self.metadata = {
            "source": self.name,
            "sensor": self._sensor.name,
            "n_mags": self._n_mags,
            "pyserial": version("pyserial"),
        }
        self._start(time.monotonic())

    def _connect(self) -> None:
        self._decoder.reset()
        # Exclusive: two programs would each get half of the bytes.
        self._port = Serial(self._path, self._baud, exclusive=True)

    def _receive(self, timeout: float) -> bool:
        try:
            decoded = self._read_port(timeout)
        except OSError as cause:
            self._disconnect()
            self._lose(_reason(cause))
            return False
        return bool(decoded.samples)

    def _reconnect(self) -> bool:
        try:
            self._connect()
        except OSError:
            return False
        return True

    def _disconnect(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def _read_port(self, timeout: float) -> DecodedBytes:
        """Queue the samples that come within `timeout` [s], and return them.

        Raises:
            OSError: the port was disconnected.
        """
        if self._port is None:
            return DecodedBytes([], 0, 0)
        self._port.timeout = timeout
        # One byte waits for the board; then what is there already, without another wait.
        data = self._port.read(1)
        if data:
            data += self._port.read(min(self._port.in_waiting, MAX_READ_SIZE))
        decoded, received = self._decoder.feed(data), time.monotonic()
        if decoded.n_refused:
            self._assembler.n_refused += decoded.n_refused
            if decoded.other_n_mags:
                self._assembler.report_taxel_count(_BOARD, self._wrong_count(decoded), received)
            else:
                self._assembler.notify("packet", "invalid packets are dropped", received)
            self._queue(self._assembler.finish(received), received)
        n = len(decoded.samples)
        period = 1 / self._sensor.rate
        # Spread over their period, but not back beyond the newest sample.
        step = min(period, (received - self._newest) / max(n, 1))
        for k, sample in enumerate(decoded.samples):
            self._assembler.stamp(received - (n - 1 - k) * step, received)
            self._assembler.add(_BOARD, sample)
            arrivals = self._assembler.finish(received)
            self._newest = arrivals[-1].time
            self._queue(arrivals, received)
        return decoded

    def _wrong_count(self, decoded: DecodedBytes) -> str:
        return (
            f"packets of {decoded.other_n_mags} magnetometers come, {self._n_mags} expected "
            f"({self._sensor.name}; mags= gives their number)"
        )


def source(address: Address) -> Source:
    """Return the source of a URI; entering it opens the port.

    Raises:
        ValueError: a parameter is not valid.
    """
    return SerialSource(address)


def state() -> str:
    """Return the serial ports of this machine."""
    return ", ".join(port.device for port in comports()) or "no serial port"


def _positive(address: Address, name: str, default: int) -> int:
    text = address.parameters.get(name, str(default))
    if not (text.isascii() and text.isdecimal() and int(text)):
        raise ValueError(f"{address.text}: {name}={default}, at least 1, expected, {text!r} given")
    return int(text)


def _modules(address: Address, n_mags: int, kind: Sensor) -> tuple[str, ...]:
    """Return the names of the modules of the magnetometers, in the order of the packet.

    Raises:
        ValueError: the magnetometers are no whole number of sensors, or a name does not fit.
    """
    # A board carries several sensors of one kind, one after the other.
    n_modules, left = divmod(n_mags, kind.n_taxels)
    if left:
        raise ValueError(
            f"{address.text}: mags={n_mags} given; {kind.name} has {kind.n_taxels} taxels, "
            f"a multiple of that expected"
        )
    given = address.names()
    if unknown := sorted(set(given) - set(range(1, n_modules + 1))):
        raise ValueError(
            f"{address.text}: a name for finger {unknown[0]} given; with {n_mags} magnetometers "
            f"of {kind.name} there are {n_modules}"
        )
    names = tuple(given.get(k, f"finger{k}") for k in range(1, n_modules + 1))
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"{address.text}: two fingers would be called {repeated[0]}")
    return names


def _reason(cause: Exception) -> str:
    """Return the reason why a port failed, in a few words if it is a common one."""
    known = {
        ENOENT: "there is no such port",
        EACCES: "it may not be opened; is the user in the group dialout?",
    }
    return known.get(getattr(cause, "errno", None) or 0, str(cause))
