"""Run a stream detector in its own thread, for any number of listeners."""

import gc
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from math import isclose
from threading import Event, Lock, Thread
from typing import Any, NamedTuple, Self

import numpy as np

from holdfast.errors import SourceError
from holdfast.live.stream_detector import StreamDetector, StreamUpdate

Work = Callable[[], None]
MAX_KEPT_UPDATES = 4096
"""Number of newest updates that are kept for readers: 27 s at 150 Hz."""
MAX_LATENCIES = 8192
"""Number of newest latencies from which the percentiles are computed: 55 s at 150 Hz."""
SWITCH_INTERVAL = 5e-4
"""Python's thread switch interval while a session runs [s]; a tenth of the default, so that
other busy threads delay the detector less."""
MAX_FROZEN_BY_PYTHON = 1000
"""Number of objects up to which Python itself froze them, at its start: 375 in Python 3.12. A
program that calls `gc.freeze` freezes many thousands."""
REQUEST_TIMEOUT = 2.0
"""Maximum time that a request waits for the detector's thread [s]."""


class RequestQueue:
    """Queue of requests. Any thread may append one; one thread carries them out.

    Example:
        >>> requests = RequestQueue()
        >>> result = requests.append(lambda: print("carried out"))
        >>> requests.carry_out()
        carried out
        >>> result.done()
        True
    """

    def __init__(self) -> None:
        self._requests: deque[tuple[Work, Future[None]]] = deque()

    def append(self, work: Work) -> "Future[None]":
        """Append a request, and return its result, which is there when it was carried out.

        The caller may cancel it while it waits, as after a time-out.

        Args:
            work: is called in the thread that carries out the requests.
        """
        future: Future[None] = Future()
        self._requests.append((work, future))
        return future

    def carry_out(self) -> None:
        """Carry out the requests that wait now; one that fails has its exception as its result."""
        # Those that wait now: one that a request appends comes in the next round.
        for _ in range(len(self._requests)):
            work, future = self._requests.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                work()
            except Exception as failure:
                future.set_exception(failure)
            else:
                future.set_result(None)


class InterpreterSettings:
    """Settings of Python that delay a detector less. They last while any session runs.

    Sessions share the settings: the first one that begins changes them, the last one that ends
    sets them back. A setting that the program has changed meanwhile stays as it is. Objects that
    the program itself had frozen are not thawed: nothing is frozen then.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        # Sessions that run; the switch interval before the first one; whether objects are frozen.
        self._n_users = 0
        self._before = 0.0
        self._freezes = False

    def begin(self) -> None:
        """Change the settings, for one more session."""
        with self._lock:
            if not self._n_users:
                self._before = sys.getswitchinterval()
                # `end` would thaw objects that the program itself froze: then nothing is frozen.
                self._freezes = gc.get_freeze_count() <= MAX_FROZEN_BY_PYTHON
                sys.setswitchinterval(SWITCH_INTERVAL)
            self._n_users += 1
            if self._freezes:
                gc.freeze()  # collections do not scan the objects that exist now

    def end(self) -> None:
        """Set the settings back after the last session."""
        with self._lock:
            self._n_users -= 1
            if self._n_users:
                return
            # Python stores whole microseconds, so the value is only close to what was set.
            if isclose(sys.getswitchinterval(), SWITCH_INTERVAL):
                sys.setswitchinterval(self._before)
            if self._freezes:
                gc.unfreeze()


_SETTINGS = InterpreterSettings()


class Latency(NamedTuple):
    """Time from the last byte of a packet to its estimate [s]; NaN before the first estimate."""

    p50: float
    p99: float
    largest: float


Listener = Callable[[StreamUpdate], None]


class TimedUpdate(NamedTuple):
    """Update of the stream, and the host's time at which it was made [s since 1970]."""

    time: float
    update: StreamUpdate


class Session:
    """Run a stream detector in its own thread. Leaving it as a context manager stops it.

    It keeps the newest updates, which other threads read at their own pace: a slow reader misses
    updates, and delays no other thread. Listeners are called in the thread of the session, one
    after the other. They must return at once.

    Args:
        stream: detector of an open source.

    Attributes:
        stream: the detector.
        source: its source.
        n_packets: packets with samples. This is the largest number of samples of any module,
            because one packet may hold the samples of several instants, each of another module.
        n_lost: packets that are missing by the device's own count.
        n_refused: packets that could not be decoded.
        n_updates: updates of the stream so far.
        delay: delay of the newest sample relative to the quickest one of the source [s].
        ended: True if the source has ended, or the detector has failed.
        failure: the exception that ended the session.
    """

    def __init__(self, stream: StreamDetector) -> None:
        self.stream = stream
        self.source = stream.source
        self.n_packets = self.n_lost = self.n_refused = self.n_updates = 0
        self.delay = 0.0
        self.ended = False
        self.failure: Exception | None = None
        # By module, counted by the session's thread; `n_packets` is the largest.
        self._n_samples = dict.fromkeys(self.source.sensors, 0)
        # A new list for each change: the session's thread may be going through the old one.
        self._listeners: list[Listener] = []
        self._requests = RequestQueue()
        self._started = False  # whether `stop` has settings of Python to set back
        self._stopping = Event()
        self._thread = Thread(target=self._run, name="holdfast-detector", daemon=True)
        # A ring that the session's thread writes: a copy of it may mix two laps, which are alike.
        self._latencies = np.full(MAX_LATENCIES, np.nan)
        # The same: an update is written before it is counted.
        self._updates: list[TimedUpdate | None] = [None] * MAX_KEPT_UPDATES
        self._n_latencies = 0

    def add_listener(self, listener: Listener) -> None:
        """Call `listener` with every update from now on."""
        self._listeners = [*self._listeners, listener]

    def remove_listener(self, listener: Listener) -> None:
        """Stop calling `listener`."""
        self._listeners = [other for other in self._listeners if other != listener]

    def updates_since(self, n_read: int) -> tuple[list[TimedUpdate], int]:
        """Return the updates after the first `n_read`, as far as they are kept, and their number.

        The number is that of all updates so far: that of the next call.
        """
        end = self.n_updates
        first = max(n_read, end - MAX_KEPT_UPDATES)
        kept = (self._updates[number % MAX_KEPT_UPDATES] for number in range(first, end))
        return [update for update in kept if update is not None], end

    def start(self) -> None:
        """Start to read the source."""
        self._thread.start()
        # After the thread: if that cannot start, there is nothing to set back.
        _SETTINGS.begin()
        self._started = True

    def stop(self) -> None:
        """Stop the thread and close the source; a second call does nothing."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        if self._started:
            self._started = False
            _SETTINGS.end()
        self.source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def change(self, work: Work, consequence: str) -> None:
        """Change the tare or the thresholds of the detector, in its thread.

        Args:
            work: the change, such as `session.stream.restart_tare`.
            consequence: what is not done if the source does not answer, for the message.

        Raises:
            SourceError: the source has ended or is silent.
            StreamError, ValueError: the detector refuses the change.
        """
        if self.ended:
            raise SourceError(f"the source has ended: {consequence}")
        request = self._requests.append(work)
        try:
            request.result(REQUEST_TIMEOUT)
        except TimeoutError as cause:
            request.cancel()  # or it would be carried out long after its caller was refused
            raise SourceError(f"the source does not answer: {consequence}") from cause

    def latency(self) -> Latency:
        """Compute the percentiles of the newest latencies."""
        latencies = self._latencies[: min(self._n_latencies, MAX_LATENCIES)]
        if not len(latencies):
            return Latency(np.nan, np.nan, np.nan)
        return Latency(*np.percentile(latencies, (50, 99, 100)).tolist())

    def _run(self) -> None:
        try:
            while not self._stopping.is_set() and not self.source.ended:
                self._step()
            self._notify(self.stream.finish())
        except Exception as failure:  # the owner of the session raises it again
            self.failure = failure
        self.ended = True

    def _step(self) -> None:
        # Before the read, so that a change does not wait for the next sample.
        self._requests.carry_out()
        update = self.stream.read()
        arrival = update.arrival
        if arrival is not None:
            if arrival.samples and update.estimates:
                latency = time.monotonic() - arrival.received
                self._latencies[self._n_latencies % MAX_LATENCIES] = latency
                self._n_latencies += 1
            if arrival.samples:
                self.delay = arrival.delay
            for module in arrival.samples:
                self._n_samples[module] += 1
            self.n_packets = max(self._n_samples.values(), default=0)
            self.n_lost += arrival.n_lost
            self.n_refused += arrival.n_refused
        if arrival is not None or update.estimates:
            self._notify(update)

    def _notify(self, update: StreamUpdate) -> None:
        self._updates[self.n_updates % MAX_KEPT_UPDATES] = TimedUpdate(time.time(), update)
        self.n_updates += 1
        for listener in self._listeners:
            listener(update)


@contextmanager
def publishing(
    session: Session, publishers: Sequence[Any], report: Callable[[str], None]
) -> Iterator[None]:
    """Publish the updates of a session; at the end, report how many estimates are missing.

    Args:
        session: whose updates are published.
        publishers: of plug-ins, not open yet: context managers with `put`, `n_failed` and
            `n_dropped`.
        report: called with one line for each publisher that did not publish all.
    """
    with ExitStack() as stack:
        opened = [stack.enter_context(publisher) for publisher in publishers]
        for publisher in opened:
            session.add_listener(publisher.put)
        yield
        for publisher in opened:
            if publisher.n_failed or publisher.n_dropped:
                report(
                    f"{type(publisher).__name__}: {publisher.n_failed} estimates were refused, "
                    f"{publisher.n_dropped} were dropped because it was too slow"
                )
