"""Step a grip loop with every estimate of a source, and while nothing arrives."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, SimpleQueue

from holdfast.contact import ContactState, HandEstimate
from holdfast.control.command import GripCommand
from holdfast.control.loop import GripLoop
from holdfast.live.stream_detector import StreamUpdate

TICK = 0.01
"""Time without samples after which the loop is stepped, so that it detects silence [s]."""
NO_DATA = HandEstimate(0.0, ContactState.UNKNOWN, {})
"""Estimate with which a loop is stepped that is stopped before the first one."""


class LoopRunner:
    """Step a loop with the updates that it gets, in one thread.

    `put`, `stop` and `reset` may be called in any thread and return at once. A stop does not
    wait for the updates in the queue.

    Args:
        loop: the loop to step.
        speed: ratio of the source's time to real time; 0 for a source that is not paced.
        on_command: is called with every command.
    """

    def __init__(
        self,
        loop: GripLoop,
        speed: float = 1.0,
        on_command: Callable[[GripCommand], None] = lambda _: None,
    ) -> None:
        self.loop = loop
        self._speed = speed
        self._on_command = on_command
        self._updates: SimpleQueue[StreamUpdate | None] = SimpleQueue()
        self._requests: deque[tuple[Callable[[], None], Future[None]]] = deque()
        self._estimate: HandEstimate | None = None
        self._received = 0.0

    def put(self, update: StreamUpdate) -> None:
        """Append an update to the queue; a listener of a session."""
        self._updates.put(update)

    def stop(self) -> "Future[None]":
        """Bring the hand into its safe state; the result is there when the command was sent."""
        self.loop.stop()
        # Once more after a reset that is in the queue already.
        return self._request(self.loop.stop)

    def reset(self) -> "Future[None]":
        """End a stop or a fault, by the decision of a person."""
        return self._request(self.loop.resume)

    def run(self, is_over: Callable[[], bool]) -> None:
        """Step the loop until `is_over` and the queue is empty.

        Raises:
            HandError: as `GripLoop.step`.
        """
        while not (is_over() and self._updates.empty()):
            try:
                update = self._updates.get(timeout=TICK)
            except Empty:
                update = None
            self.process(update)

    def process(self, update: StreamUpdate | None) -> None:
        """Answer the requests, and step the loop with an update; None if nothing arrived.

        Raises:
            HandError: as `GripLoop.step`; waiting requests get it too.
        """
        requests = [self._requests.popleft() for _ in range(len(self._requests))]
        try:
            for work, _ in requests:
                work()
            self._step(update)
        except Exception as failure:
            for _, future in requests:
                future.set_exception(failure)
            raise
        for _, future in requests:
            future.set_result(None)

    def _step(self, update: StreamUpdate | None) -> None:
        estimates = [] if update is None else update.estimates
        for one in estimates:
            self._estimate, self._received = one.estimate, time.monotonic()
            self._on_command(self.loop.step(one.estimate, one.estimate.time))
        if estimates:
            return
        if self._estimate is None:
            if self.loop.stopped:
                self._on_command(self.loop.step(NO_DATA, NO_DATA.time))
        elif self._speed:
            elapsed = self._speed * (time.monotonic() - self._received)
            now = self._estimate.time + elapsed
            self._on_command(self.loop.step(self._estimate, now))

    def _request(self, work: Callable[[], None]) -> "Future[None]":
        """Run `work` before the next step, and step at once."""
        future: Future[None] = Future()
        self._requests.append((work, future))
        self._updates.put(None)
        return future
