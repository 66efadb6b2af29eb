"""Sources of sensors at a serial port: what all share, and AnySkin and ReSkin boards."""

import math
import time
from abc import abstractmethod
from collections.abc import Sequence
from errno import EACCES, ENOENT
from importlib.metadata import version
from typing import Any

import numpy.typing as npt

from holdfast.devices.sources.anyskin import AnySkinDecoder, DecodedBytes
from holdfast.devices.sources.assembler import Assembler, Device
from holdfast.devices.sources.base import DeviceSource, Source
from holdfast.devices.sources.timeline import ArrivalClock
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
BOARD = 1
"""Number of the board as a device."""


class PortSource(DeviceSource):
    """Source of a device at a serial port, which has no clock.

    The time of a sample follows from its arrival, on the host's monotonic clock (see
    `ArrivalClock`). A subclass has the decoder of the bytes.

    Attributes:
        problem: what is wrong with the newest bytes, if waiting does not change it; else empty.
        assembler: collector of what the subclass reports.

    Args:
        address: its path is the port; `baud` is the speed.
        baud: speed if the address has none [bit/s].
        period: nominal time between two samples [s]; None if it is measured.

    Raises:
        ValueError: there is no port, or the speed is not valid.
    """

    max_wait = math.inf
    """Maximum time to wait for bytes before `request` is called again [s]."""

    def __init__(self, address: Address, baud: int, period: float | None) -> None:
        super().__init__()
        self.name, self.problem = address.text, ""
        self._path = address.host + address.path
        if not self._path:
            scheme = address.text.partition(":")[0]
            raise ValueError(f"{address.text}: a port expected, as in {scheme}:///dev/ttyACM0")
        self.baud = address.integer("baud", baud, 1)
        self._period = period
        self.assembler = Assembler()
        self._port: Serial | None = None

    @abstractmethod
    def begin(self) -> None:
        """Begin to decode, after the port was opened: what came before is forgotten."""

    @abstractmethod
    def decode(self, data: bytes, received: float) -> Sequence[npt.NDArray[Any]]:
        """Return the samples in the next bytes; report what is refused to the assembler."""

    @abstractmethod
    def explain_silence(self) -> str:
        """Return why there was no sample after `SERIAL_OPEN_TIMEOUT`."""

    def request(self, now: float) -> bytes:
        """Return the bytes to send now."""
        return b""

    def open(self) -> None:
        """Open the port, and wait for the first sample.

        Raises:
            SourceError: there is no such port, it cannot be opened, or no sample comes.
        """
        self.close()
        self.assembler = Assembler()
        self.sensors = {}
        self._clock = ArrivalClock(self._period)
        try:
            self._connect()
            deadline = time.monotonic() + SERIAL_OPEN_TIMEOUT
            while not self._read_port(max(deadline - time.monotonic(), 0.0)):
                if self.problem or time.monotonic() >= deadline:
                    raise SourceError(f"{self.name}: {self.problem or self.explain_silence()}")
        except (OSError, ValueError) as cause:  # ValueError: the port does not support the speed
            ports = ", ".join(sorted(port.device for port in comports())) or "none"
            raise SourceError(f"{self.name}: {_reason(cause)}; serial ports: {ports}") from cause
        self.sensors = self.assembler.sensors
        self.metadata = {"source": self.name, "pyserial": version("pyserial")}
        self.begin_reading(time.monotonic())

    def _connect(self) -> None:
        self.begin()
        # Exclusive: two programs would each get half of the bytes.
        self._port = Serial(self._path, self.baud, exclusive=True)

    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""
        try:
            return self._read_port(timeout) > 0
        except OSError as cause:
            self.disconnect()
            self.lose(_reason(cause))
            return False

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

    def _read_port(self, timeout: float) -> int:
        """Queue the samples that come within `timeout` [s], and return their number.

        Raises:
            OSError: the port was disconnected.
        """
        if self._port is None:
            return 0
        if to_send := self.request(time.monotonic()):
            self._port.write(to_send)
        self._port.timeout = min(timeout, self.max_wait)
        # One byte waits for the device; then what is there already, without another wait.
        data = self._port.read(1)
        if data:
            data += self._port.read(min(self._port.in_waiting, MAX_READ_SIZE))
        received = time.monotonic()
        samples = self.decode(data, received)
        if reports := self.assembler.finish(received):
            self.queue(reports, received)
        times = self._clock.times(len(samples), received)
        for at, sample in zip(times, samples, strict=False):
            self.assembler.stamp(at, received)
            self.assembler.add(BOARD, sample)
            self.queue(self.assembler.finish(received), received)
        return len(times)


class SerialSource(PortSource):
    """Source of a board of magnetometers at a serial port.

    Args:
        address: `serial:///dev/ttyACM0?sensor=anyskin&fingers=1:index&baud=115200&mags=5`.

    Raises:
        ValueError: a parameter is not valid.
    """

    def __init__(self, address: Address) -> None:
        address.only("sensor", "fingers", "baud", "mags")
        self._sensor = address.sensor() or sensor("anyskin")
        super().__init__(address, DEFAULT_BAUD, 1 / self._sensor.rate)
        self._n_mags = address.integer("mags", self._sensor.n_taxels, 1)
        modules = dict.fromkeys(_modules(address, self._n_mags, self._sensor), self._sensor)
        self._devices = {BOARD: Device(BOARD, self._sensor.name, modules)}
        self._decoder = AnySkinDecoder(self._n_mags)

    def begin(self) -> None:
        """Begin to decode, after the port was opened."""
        self._n_refused, self.assembler.devices = 0, self._devices
        self._decoder.reset()

    def decode(self, data: bytes, received: float) -> Sequence[npt.NDArray[Any]]:
        """Return the samples in the next bytes."""
        decoded = self._decoder.feed(data)
        self.problem = self._wrong_count(decoded) if decoded.other_n_mags else ""
        self._n_refused += decoded.n_refused
        self.assembler.n_refused += decoded.n_refused
        if decoded.n_refused and self.problem:
            self.assembler.report_taxel_count(BOARD, self.problem, received)
        elif decoded.n_refused:
            self.assembler.notify("packet", "invalid packets are dropped", received)
        return decoded.samples

    def explain_silence(self) -> str:
        """Return why there was no sample."""
        came = f"{self._n_refused} invalid packets came" if self._n_refused else "nothing came"
        return (
            f"{came} within {SERIAL_OPEN_TIMEOUT:g} s; packets of {self._n_mags} magnetometers "
            f"at {self.baud} baud expected"
        )

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
    stated = address.names()
    if unknown := sorted(set(stated) - set(range(1, n_modules + 1))):
        raise ValueError(
            f"{address.text}: a name for finger {unknown[0]} given; with {n_mags} magnetometers "
            f"of {kind.name} there are {n_modules}"
        )
    names = tuple(stated.get(k, f"finger{k}") for k in range(1, n_modules + 1))
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"{address.text}: two fingers would be called {repeated[0]}")
    return names


def _reason(cause: Exception) -> str:
    """Return the reason why a port failed, in a few words if it is a common one."""
    reasons = {
        ENOENT: "there is no such port",
        EACCES: "it may not be opened; is the user in the group dialout?",
    }
    return reasons.get(getattr(cause, "errno", None) or 0, str(cause))
