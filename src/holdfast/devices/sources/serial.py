"""Source of a sensor at a serial port: AnySkin and ReSkin boards."""

import math
import time
from errno import EACCES, ENOENT
from importlib.metadata import version

from holdfast.devices.sources.anyskin import AnySkinDecoder, DecodedBytes
from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import DeviceSource, Source
from holdfast.devices.uri import Address
from holdfast.errors import MissingExtra, SourceError
from holdfast.sensors import Sensor, sensor

try:
    from serial import Serial
    from serial.tools.list_ports import comports
except ImportError as missing:
    raise MissingExtra("pyserial", "serial") from missing

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
        address.only("sensor", "fingers", "baud", "mags")
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
        self.begin_reading(time.monotonic())

    def _connect(self) -> None:
        self._decoder.reset()
        # Exclusive: two programs would each get half of the bytes.
        self._port = Serial(self._path, self._baud, exclusive=True)

    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""
        try:
            decoded = self._read_port(timeout)
        except OSError as cause:
            self.disconnect()
            self.lose(_reason(cause))
            return False
        return bool(decoded.samples)

    def reconnect(self) -> bool:
        """Try to connect again; return whether the device is connected."""
        try:
            self._connect()
        except OSError:
            return False
        return True

    def disconnect(self) -> None:
        """Close the connection, if there is one."""
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
            self.queue(self._assembler.finish(received), received)
        n = len(decoded.samples)
        period = 1 / self._sensor.rate
        # Spread over their period, but not back beyond the newest sample.
        step = min(period, (received - self._newest) / max(n, 1))
        for k, sample in enumerate(decoded.samples):
            self._assembler.stamp(received - (n - 1 - k) * step, received)
            self._assembler.add(_BOARD, sample)
            arrivals = self._assembler.finish(received)
            self._newest = arrivals[-1].time
            self.queue(arrivals, received)
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
