"""Step a grip loop with every estimate of a source, and while nothing arrives."""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from threading import Event
from typing import NamedTuple

from holdfast.contact import HandEstimate
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamUpdate
from holdfast_grip.command import GripCommand, GripReason
from holdfast_grip.loop.grip_loop import GripLoop

TICK = 0.01
"""Time without samples after which the loop is stepped, so that it detects silence [s]."""
MAX_PAUSE = 0.1
"""Longest time between two steps of the loop; a longer one is the fault `behind` [s]."""
MIN_TIME_STEP = 1e-6
"""Step of the source's time below which its clock stands still [s]. Samples that come with the same
stamp are one unit in the last place apart, and would never be old."""
MAX_PENDING = 512
"""Number of newest updates that wait for the next step: more than come in `MAX_PAUSE`."""


class _Arrived(NamedTuple):
    """Update, and the time at which its last byte was received, by `time.monotonic` [s]."""

    update: StreamUpdate
    received: float


class LoopRunner:
    """Step a loop with the updates that it gets, in one thread.

    `put` may be called in any thread and returns at once.

    A paced source goes on while the hand takes a command. So each step takes all pending updates:
    the controller gets every estimate, and the hand only the command of the newest one. Its age
    counts from the arrival of its samples.

    Args:
        loop: the loop to step.
        speed: ratio of the source's time to real time; 0 for a source that is not paced: then
            each estimate has its command, and only the times of the samples count.
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
        self._pending: deque[_Arrived] = deque(maxlen=MAX_PENDING)
        self._wake = Event()
        self._estimate: HandEstimate | None = None
        self._received = 0.0
        self._received_time = math.nan  # of the estimate whose samples came then
        self._stepped_at: float | None = None

    def put(self, update: StreamUpdate) -> None:
        """Append an update to those that are pending; a listener of a session."""
        self._pending.append(_arrived(update))
        self._wake.set()

    def run(self, is_over: Callable[[], bool]) -> None:
        """Step the loop until `is_over` and nothing is pending.

        Raises:
            HandError: as `GripLoop.step`.
        """
        while not is_over() or self._pending:
            self._wake.wait(TICK)
            # Before the updates are taken: one that comes after it wakes the next step.
            self._wake.clear()
            self._process([self._pending.popleft() for _ in range(len(self._pending))])

    def process(self, update: StreamUpdate | None) -> None:
        """Step the loop with an update; None if nothing arrived.

        Raises:
            HandError: as `GripLoop.step`.
        """
        self._process([] if update is None else [_arrived(update)])

    def _process(self, arrived: Sequence[_Arrived]) -> None:
        if self._speed:
            self._step(arrived)
        else:
            self._step_each(arrived)

    def _step(self, arrived: Sequence[_Arrived]) -> None:
        """Step the loop of a paced source once, with the newest estimate."""
        now = time.monotonic()
        behind = self._stepped_at is not None and now - self._stepped_at > MAX_PAUSE
        estimates = _estimates(arrived)
        for estimate in estimates[:-1]:
            self.loop.follow(estimate, estimate.time)
        if estimates:
            newest = estimates[-1]
            # `not <`: the first time before, NaN, counts as another one.
            if not abs(newest.time - self._received_time) < MIN_TIME_STEP:
                self._received_time = newest.time
                self._received = max(received for update, received in arrived if update.estimates)
            self._estimate = newest
        if self._estimate is None:
            return
        self._stepped_at = now
        fault = GripReason.BEHIND if behind else GripReason.NONE
        # An estimate younger than a tick is new: its own time counts.
        age = now - self._received
        at = self._estimate.time + (0.0 if age < TICK else self._speed * age)
        self._on_command(self.loop.step(self._estimate, at, fault, now))

    def _step_each(self, arrived: Sequence[_Arrived]) -> None:
        """Step the loop of a source that is not paced, with each estimate."""
        for estimate in _estimates(arrived):
            self._on_command(self.loop.step(estimate, estimate.time))


def run_session(
    runner: LoopRunner,
    session: Session,
    listener: Callable[..., None],
    is_over: Callable[[], bool],
) -> None:
    """Step the loop of a runner with a session until `is_over`, or the source ends.

    Args:
        runner: steps the loop.
        session: of the source; it is started only if the source is paced.
        listener: gets each update first; `wait=True` if it may wait, as nothing keeps real time.
        is_over: returns whether the loop should end.

    Raises:
        HandError: as `GripLoop.step`.
        Exception: the failure of the session.
    """
    if not session.source.paced:
        # Read the source and step the loop in turn, so that the same seed gives the same
        # commands.
        stream = session.stream
        while not (is_over() or stream.source.ended):
            update = stream.read()
            listener(update, wait=True)
            runner.process(update)
        runner.process(stream.finish())
        return
    # Reads of the source may block for longer than the loop may wait.
    session.add_listener(listener)
    session.add_listener(runner.put)
    session.start()
    runner.run(lambda: session.ended or is_over())
    if session.failure is not None:
        raise session.failure


def _estimates(arrived: Sequence[_Arrived]) -> list[HandEstimate]:
    """Return all estimates of updates, oldest first."""
    return [estimate for update, _ in arrived for estimate, _ in update.estimates]


def _arrived(update: StreamUpdate) -> _Arrived:
    """Return an update with the time of its arrival: now, if it has no samples."""
    now = time.monotonic()
    arrival = update.arrival
    return _Arrived(update, now if arrival is None else min(arrival.received, now))
