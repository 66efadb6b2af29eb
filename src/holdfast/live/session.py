"""A source that is judged in a thread of its own, for as many listeners as like."""

import gc
import sys
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from threading import Event, Thread
from typing import NamedTuple

import numpy as np

from holdfast.contact import ContactEvent, StateChanges
from holdfast.detector import HAND
from holdfast.errors import SourceError
from holdfast.live.judge import Decision, Judge
from holdfast.live.watch import Watch
from holdfast.sources import Arrival, Source

N_LATENCIES = 8192
"""So many of the newest latencies are kept for their percentiles."""
SWITCH_INTERVAL = 5e-4
"""How soon a busy thread of Python lets the detector's go on [s]; Python's own is ten times it."""
ANSWER_TIME = 2.0
"""How long a tare is waited for [s]."""


class Said(NamedTuple):
    """What a session tells its listeners.

    Attributes:
        arrival: what came; None where nothing did, and the source is silent.
        decisions: what the detector says to it.
        events: which states changed.
    """

    arrival: Arrival | None
    decisions: list[Decision]
    events: list[ContactEvent]


class Latency(NamedTuple):
    """From the last byte of a packet in hand to the decision [s]; NaN before the first."""

    p50: float
    p99: float
    largest: float


Listener = Callable[[Said], None]


class Session:
    """Reads a source and judges it, in a thread of its own.

    Listeners are called in that thread, one after the other: they take what is said and return
    at once, whatever they do with it.

    Args:
        source: that is open.
        judge: of its samples.

    Attributes:
        n_packets: that came with samples: how many the module has that has most, as one packet
            may hold the samples of several instants, each of another module.
        n_lost: that are missing by the device's count.
        n_refused: that made no sense.
        ended: whether the source is over, or judging failed.
        failure: why it failed.
    """

    def __init__(self, source: Source, judge: Judge) -> None:
        self.source = source
        self.judge = judge
        self.n_packets = self.n_lost = self.n_refused = 0
        self.ended = False
        self.failure: Exception | None = None
        self._watch = Watch(source, judge)
        self._n_samples = dict.fromkeys(source.sensors, 0)
        self._listeners: list[Listener] = []
        self._requests: deque[Future[None]] = deque()
        self._stopping = Event()
        self._thread = Thread(target=self._run, name="holdfast-detector", daemon=True)
        self._changes = StateChanges((*judge.fingers, HAND))
        self._latencies = np.full(N_LATENCIES, np.nan)
        self._n_judged = 0

    @property
    def silent(self) -> bool:
        """Whether no samples come of what is judged."""
        return self._watch.silent

    def listen(self, listener: Listener) -> None:
        """Has `listener` called with all that is said from now on."""
        self._listeners = [*self._listeners, listener]

    def leave(self, listener: Listener) -> None:
        """Has it called no more."""
        self._listeners = [one for one in self._listeners if one != listener]

    def start(self) -> None:
        """Begins to read."""
        sys.setswitchinterval(SWITCH_INTERVAL)
        gc.freeze()  # what was loaded so far is not looked at by every collection
        self._thread.start()

    def stop(self) -> None:
        """Ends, and closes the source; again, it does nothing."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self.source.close()

    def tare(self) -> None:
        """Takes the tare anew.

        Raises:
            StreamError: a finger is in contact.
            SourceError: the source is over, or nothing arrives.
        """
        if self.ended:
            raise SourceError("the source has ended: no tare can be taken")
        answer: Future[None] = Future()
        self._requests.append(answer)
        try:
            answer.result(ANSWER_TIME)
        except TimeoutError as cause:
            answer.cancel()
            raise SourceError("the source does not answer: no tare can be taken") from cause

    def latency(self) -> Latency:
        """Of the newest decisions."""
        known = self._latencies[: min(self._n_judged, N_LATENCIES)]
        if not len(known):
            return Latency(np.nan, np.nan, np.nan)
        return Latency(*np.percentile(known, (50, 99, 100)).tolist())

    def _run(self) -> None:
        try:
            while not self._stopping.is_set() and not self.source.ended:
                self._turn()
            self._say(None, self.judge.finish())
        except Exception as failure:  # told by whoever started the session
            self.failure = failure
        self.ended = True

    def _turn(self) -> None:
        while self._requests:
            self._answer(self._requests.popleft())
        arrival, decisions = self._watch.turn()
        if arrival is not None:
            self._count(arrival, judged=bool(decisions))
        if arrival is not None or decisions:
            self._say(arrival, decisions)

    def _count(self, arrival: Arrival, *, judged: bool) -> None:
        if arrival.samples and judged:
            self._latencies[self._n_judged % N_LATENCIES] = time.monotonic() - arrival.received
            self._n_judged += 1
        for module in arrival.samples:
            self._n_samples[module] += 1
            self.n_packets = max(self.n_packets, self._n_samples[module])
        self.n_lost += arrival.n_lost
        self.n_refused += arrival.n_refused

    def _answer(self, request: "Future[None]") -> None:
        if not request.set_running_or_notify_cancel():
            return  # whoever asked has given up
        try:
            if self.silent:
                raise SourceError("nothing arrives: no tare can be taken")
            self.judge.tare()
            request.set_result(None)
        except Exception as failure:
            request.set_exception(failure)

    def _say(self, arrival: Arrival | None, decisions: list[Decision]) -> None:
        events = [event for decision in decisions for event in self._events(decision)]
        said = Said(arrival, decisions, events)
        for listener in self._listeners:
            listener(said)

    def _events(self, decision: Decision) -> list[ContactEvent]:
        estimate = decision.estimate
        states = [finger.state for finger in estimate.fingers.values()]
        return self._changes.update([*states, estimate.state], estimate.time)
