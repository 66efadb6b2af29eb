"""Base classes of all sources: the contract, and reconnection of devices."""

import math
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault
from holdfast.devices.sources.timeline import clock_notice
from holdfast.openable import Openable
from holdfast.sensors import Sensor

MARKER_PREFIX = "marker: "
"""Begin of a notice that repeats a marker of a recording."""
ITERATION_TIMEOUT = 0.5
"""Timeout of each read while a source is iterated over [s]."""
MIN_RETRY_DELAY, MAX_RETRY_DELAY = 0.5, 2.0
"""Time from the loss of a connection to the first attempt to reconnect, and the longest time
between two attempts [s]; the delay doubles after each attempt."""

ModuleSamples = Mapping[str, npt.NDArray[Any]]
"""Samples of one instant: (n_taxels, 3) by module."""


class Arrival(NamedTuple):
    """Samples of one instant from a source, or a notice of a fault, or both.

    Attributes:
        time: time of the samples, on the clock of the source [s]. It is later than the time of
            every earlier arrival with samples. NaN without samples.
        samples: (n_taxels, 3) by module, of the modules that have a sample at that instant.
            Read only; the source does not write to them again.
        received: time at which the last byte was received, by `time.monotonic` [s].
        faults: faults of each module (`TAXEL_COUNT`, `PACKET_GAP`, `LATE`, `CLOCK_JUMP`). They
            hold until the next arrival with samples or faults of the module.
        n_lost: number of packets missing before this one, by the device's own counter.
        n_refused: number of packets dropped since the last arrival because they are not valid.
        notices: messages for the user, one line each.
        delay: delay from the device's stamp to `received`, relative to the quickest sample [s];
            0 where the stamps are not of a device.
    """

    time: float
    samples: ModuleSamples
    received: float
    faults: Mapping[str, tuple[Fault, ...]] = {}
    n_lost: int = 0
    n_refused: int = 0
    notices: tuple[str, ...] = ()
    delay: float = 0.0


def notice_arrival(
    received: float,
    *notices: str,
    faults: Mapping[str, tuple[Fault, ...]] | None = None,
    n_refused: int = 0,
) -> Arrival:
    """Return an arrival without samples."""
    return Arrival(np.nan, {}, received, faults or {}, n_refused=n_refused, notices=notices)


class Source(Openable):
    """Source of the samples of a hand: a device, a recording or the twin.

    A source is a context manager. Entering it connects, and waits until the modules are known.
    Only entering raises. If a device is silent or disconnected later, the source waits for it,
    reconnects, and reports this in arrivals without samples. Use a source in one thread only.

    Attributes:
        name: path or URI of the source.
        sensors: sensors by module; known when the source is open.
        metadata: metadata of a recording of this source (`source`, `hand`, ...), in types of
            JSON.
        paced: whether samples arrive in the course of time, instead of as fast as they are read.
        speed: ratio of the source's time to real time; 0 is as fast as samples are read.
        is_device: whether the samples come from a device, whose rate may change.

    Example:
        To detect contact states, use `holdfast.StreamDetector`: it also resamples, and handles
        faults and modules that the model does not use.

        >>> from holdfast import Model, StreamDetector, open_source
        >>> model = Model.load("builtin:twin")
        >>> with open_source("grasp.parquet") as source:  # doctest: +SKIP
        ...     for estimate in StreamDetector(model, source):
        ...         print(estimate.time, estimate.state)
    """

    name: str = ""
    sensors: Mapping[str, Sensor] = {}
    metadata: Mapping[str, Any] = {}
    paced: bool = True
    speed: float = 1.0
    is_device: bool = False

    @abstractmethod
    def open(self) -> None:
        """Connect, and wait until the modules are known.

        Raises:
            SourceError: the source cannot be reached, sends nothing, or sends other data than
                expected.
        """

    @abstractmethod
    def read(self, timeout: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout` [s] or at the end of the source."""

    @property
    def ended(self) -> bool:
        """Whether no arrival follows; a device never ends."""
        return False

    def restart(self) -> None:
        """Begin the next recording, where the source has recordings; a device continues."""

    @abstractmethod
    def close(self) -> None:
        """Release the device. It has no effect on a source that is closed."""

    def __iter__(self) -> Iterator[Arrival]:
        """Yield all arrivals until the source ends."""
        while not self.ended:
            arrival = self.read(ITERATION_TIMEOUT)
            if arrival is not None:
                yield arrival


class DeviceSource(Source):
    """Source that is a device: it reconnects, and reports loss and silence of the device.

    A subclass connects in `open` and then calls `begin_reading`. It has `receive`, `reconnect` and
    `disconnect`, which only this class calls; its `receive` passes arrivals to `queue`, and a loss
    of the connection to `lose`.

    Attributes:
        silence_timeout: time without a new sample after which a notice reports silence [s].
    """

    is_device = True
    silence_timeout: float = math.inf

    def __init__(self) -> None:
        self._reset()

    def read(self, timeout: float) -> Arrival | None:
        """Return the next arrival, or None after `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while self._is_open and not self._pending:
            left = max(deadline - time.monotonic(), 0.0)
            if self._lost_at is not None:
                self._retry(left)
            else:
                # Wake up when the device counts as silent, so that the notice comes in time.
                until_silent = self._last_sample_at + self.silence_timeout - time.monotonic()
                if not self.receive(left if self._silent else min(left, max(until_silent, 0.0))):
                    self._check_silence(time.monotonic())
            if not left:  # after a read: a timeout of 0 reads what is there
                break
        return self._pending.popleft() if self._pending else None

    def close(self) -> None:
        """Disconnect, and drop arrivals that were not read."""
        self.disconnect()
        self._reset()

    @abstractmethod
    def receive(self, timeout: float) -> bool:
        """Process what the device sends within `timeout` [s]; return False if nothing came."""

    @abstractmethod
    def reconnect(self) -> bool:
        """Try to connect again; return whether the device is connected."""

    @abstractmethod
    def disconnect(self) -> None:
        """Close the connection, if there is one."""

    def pause(self, seconds: float) -> None:
        """Wait for the next attempt to reconnect."""
        time.sleep(seconds)

    def _reset(self) -> None:
        self._is_open = self._silent = False
        self._pending: deque[Arrival] = deque()
        self._last_sample_at = time.monotonic()
        self._lost_at: float | None = None
        self._retry_delay = MIN_RETRY_DELAY
        self._retry_at = 0.0

    def begin_reading(self, received: float) -> None:
        """Begin to read, with the first sample received at that time [s]."""
        self._is_open = True
        self._last_sample_at = received

    def queue(self, arrivals: Sequence[Arrival], received: float) -> None:
        """Queue arrivals for `read`."""
        if not any(arrival.samples for arrival in arrivals):
            self._check_silence(received)  # faults and notices do not end a silence
        else:
            if self._silent:
                silence = received - self._last_sample_at
                self.notify(received, f"samples again after {silence:.1f} s")
            self._silent = False
            self._last_sample_at = received
        self._pending.extend(arrivals)

    def note_clock(self) -> None:
        """Add a notice to the first samples if the device's clock differs much from the host's."""
        for k, arrival in enumerate(self._pending):
            if arrival.samples:
                text = clock_notice(arrival.time, time.time())
                if text is not None:
                    self._pending[k] = arrival._replace(notices=(*arrival.notices, text))
                return

    def notify(self, received: float, *notices: str) -> None:
        """Queue an arrival that only has notices."""
        self._pending.append(notice_arrival(received, *notices))

    def _check_silence(self, now: float) -> None:
        if self._silent or self._lost_at is not None:  # it was reported already
            return
        if now - self._last_sample_at >= self.silence_timeout:
            self._silent = True
            self.notify(now, f"no new sample for {self.silence_timeout:g} s")

    def lose(self, reason: object) -> None:
        """Report the loss of the connection, and schedule the first attempt to reconnect."""
        self._lost_at = time.monotonic()
        self._retry_delay = MIN_RETRY_DELAY
        self._retry_at = self._lost_at + self._retry_delay
        self.notify(self._lost_at, f"connection lost ({reason})")

    def _retry(self, timeout: float) -> None:
        """Wait for the next attempt to reconnect, up to `timeout` [s], and make it."""
        wait = self._retry_at - time.monotonic()
        if wait > 0:
            self.pause(min(wait, timeout))
        if wait > timeout or self._lost_at is None:  # `pause` may have found it again
            return
        if self.reconnect():
            self.resume()
        else:
            self._retry_delay = min(2 * self._retry_delay, MAX_RETRY_DELAY)
            self._retry_at = time.monotonic() + self._retry_delay

    def resume(self) -> None:
        """Report that the device is connected again."""
        now = time.monotonic()
        if self._lost_at is not None:
            self.notify(now, f"connected again after {now - self._lost_at:.1f} s")
        self._lost_at = None
        self._last_sample_at = now
        self._silent = False
