"""Sensors at a serial port: AnySkin and ReSkin boards."""

import time
from collections import deque
from errno import EACCES, ENOENT
from importlib.metadata import version

from holdfast.contact import Fault
from holdfast.errors import MissingExtra, SourceError
from holdfast.sensors import Sensor, sensor
from holdfast.sources.anyskin import Decoded, Decoder
from holdfast.sources.base import Arrival, Source, notice_arrival
from holdfast.sources.timeline import Timeline
from holdfast.sources.uri import Address

try:
    from serial import Serial
    from serial.tools.list_ports import comports
except ImportError as missing:
    raise MissingExtra("pyserial", "serial") from missing

PATIENCE = 3.0
"""A sample must come so soon after opening [s]: boards start anew when they are opened."""
BACKOFF = (0.5, 2.0)
"""A lost board is tried again after the first, then twice as long, up to the second [s]."""
QUIET = 1.0
"""The same is not told again within this [s]."""
BAUD = 115200
MOST_BYTES = 1 << 16
"""Read at a time."""


class Board(Source):
    """A board of magnetometers at a serial port.

    It has no clock: a sample has the time at which it was received, on the host's monotonic
    clock. Samples that were received together are apart by the sensor's period, or by less
    where that is longer than the time since the last.

    Args:
        address: `serial:///dev/ttyACM0?sensor=anyskin&fingers=1:index&baud=115200&mags=5`.

    Raises:
        ValueError: a parameter is not as expected.
    """

    def __init__(self, address: Address) -> None:
        address.only("sensor", "fingers", "baud", "mags")
        self.name = address.text
        self._path = address.host + address.path
        if not self._path:
            raise ValueError(f"{address.text}: a port expected, as in serial:///dev/ttyACM0")
        self._baud = _count(address, "baud", BAUD)
        self._sensor = address.sensor() or sensor("anyskin")
        self._n_mags = _count(address, "mags", self._sensor.n_taxels)
        self._modules = _modules(address, self._n_mags, self._sensor)
        self._decoder = Decoder(self._n_mags)
        self._port: Serial | None = None
        self._forget()

    def open(self) -> None:
        """Opens the port, and waits for the first sample.

        Raises:
            SourceError: there is no such port, it is not ours to open, or no sample comes.
        """
        self.close()
        try:
            self._connect()
            self._wait()
        except (OSError, ValueError) as cause:  # a ValueError: the port cannot go so fast
            ports = ", ".join(sorted(port.device for port in comports())) or "none"
            raise SourceError(f"{self.name}: {_reason(cause)}; serial ports: {ports}") from cause
        self.sensors = dict.fromkeys(self._modules, self._sensor)
        self.metadata = {
            "source": self.name,
            "sensor": self._sensor.name,
            "n_mags": self._n_mags,
            "pyserial": version("pyserial"),
        }

    def read(self, timeout: float) -> Arrival | None:
        """What arrived next, or None where nothing did within `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while not self._arrivals:
            left = max(deadline - time.monotonic(), 0.0)
            if self._port is None:
                self._try_again(left)
            else:
                self._receive_or_lose(left)
            if not left:
                break
        return self._arrivals.popleft() if self._arrivals else None

    def close(self) -> None:
        """Lets go of the port; what was not read is gone."""
        self._disconnect()
        self._forget()

    def _forget(self) -> None:
        self._arrivals = deque[Arrival]()
        self._timeline = Timeline()
        self._last = -1.0
        self._told: dict[str, float] = {}
        self._retry = BACKOFF[0]
        self._retry_at = 0.0

    def _connect(self) -> None:
        self._decoder.reset()
        self._port = Serial(self._path, self._baud, exclusive=True)

    def _disconnect(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def _wait(self) -> None:
        """Waits for the first sample."""
        deadline = time.monotonic() + PATIENCE
        while (left := deadline - time.monotonic()) > 0:
            decoded = self._receive(left)
            if decoded.samples:
                return
            if decoded.other:
                raise SourceError(f"{self.name}: {self._miscount(decoded)}")
        n_refused = sum(arrival.n_refused for arrival in self._arrivals)
        came = f"{n_refused} packets came that make no sense" if n_refused else "nothing came"
        raise SourceError(
            f"{self.name}: {came} within {PATIENCE:g} s; packets of {self._n_mags} "
            f"magnetometers at {self._baud} baud expected"
        )

    def _try_again(self, timeout: float) -> None:
        """Waits until the port may be tried again, and tries."""
        wait = self._retry_at - time.monotonic()
        if wait > 0:
            time.sleep(min(wait, timeout))
        if wait > timeout:
            return
        try:
            self._connect()
        except OSError:
            self._retry = min(2 * self._retry, BACKOFF[1])
            self._retry_at = time.monotonic() + self._retry
        else:
            self._retry = BACKOFF[0]
            self._arrivals.append(notice_arrival(time.monotonic(), f"{self.name}: connected again"))

    def _receive_or_lose(self, timeout: float) -> None:
        try:
            self._receive(timeout)
        except OSError as cause:
            self._disconnect()
            now = time.monotonic()
            self._retry_at = now + self._retry
            self._arrivals.append(
                notice_arrival(
                    now, f"{self.name}: the connection is lost ({_reason(cause)}); trying again"
                )
            )

    def _receive(self, timeout: float) -> Decoded:
        """Queues what comes within `timeout` [s].

        Raises:
            OSError: the port is gone.
        """
        port = self._port
        if port is None:
            return Decoded([], 0, 0)
        port.timeout = timeout
        data = port.read(1)
        if data:
            data += port.read(min(port.in_waiting, MOST_BYTES))
        decoded = self._decoder.feed(data)
        self._queue(decoded, time.monotonic())
        return decoded

    def _queue(self, decoded: Decoded, received: float) -> None:
        if decoded.n_refused:
            self._refuse(decoded, received)
        n = len(decoded.samples)
        period = 1 / self._sensor.rate
        step = period if self._last < 0 else min(period, (received - self._last) / max(n, 1))
        for k, sample in enumerate(decoded.samples):
            stamp = self._timeline.stamp(received - (n - 1 - k) * step, received)
            parts = sample.reshape(len(self._modules), -1, 3)
            faults = dict.fromkeys(self._modules, stamp.faults) if stamp.faults else {}
            samples = dict(zip(self._modules, parts, strict=True))
            self._arrivals.append(Arrival(stamp.time, samples, received, faults))
            self._last = stamp.time

    def _refuse(self, decoded: Decoded, received: float) -> None:
        """Tells of packets that were dropped, and of modules with another number of taxels."""
        wrong = bool(decoded.other)
        text = self._miscount(decoded) if wrong else "packets that make no sense are dropped"
        told = self._told.get(text)
        notices = []
        if told is None or received - told >= QUIET:
            self._told = {text: received}
            notices.append(f"{self.name}: {text}")
        faults = dict.fromkeys(self._modules, (Fault.TAXEL_COUNT,)) if wrong else {}
        self._arrivals.append(
            notice_arrival(received, *notices, faults=faults, n_refused=decoded.n_refused)
        )

    def _miscount(self, decoded: Decoded) -> str:
        return (
            f"packets of {decoded.other} magnetometers come, {self._n_mags} expected "
            f"({self._sensor.name}; mags= says how many)"
        )


def source(address: Address) -> Board:
    """The board at the port of a URI.

    Raises:
        ValueError: a parameter is not as expected.
    """
    return Board(address)


def _count(address: Address, name: str, default: int) -> int:
    text = address.parameters.get(name, str(default))
    if not (text.isascii() and text.isdecimal() and int(text)):
        raise ValueError(f"{address.text}: {name}={default}, at least 1, expected, {text!r} given")
    return int(text)


def _modules(address: Address, n_mags: int, kind: Sensor) -> tuple[str, ...]:
    """Names of the modules that the magnetometers make, in the order of the packet.

    Raises:
        ValueError: they make no whole number of sensors, or other ones are named.
    """
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
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"{address.text}: two fingers would be called {twice[0]}")
    return names


def _reason(cause: Exception) -> str:
    """Why a port failed, in a few words where they are known."""
    known = {
        ENOENT: "there is no such port",
        EACCES: "it may not be opened; is the user in the group dialout?",
    }
    return known.get(getattr(cause, "errno", None) or 0, str(cause))
