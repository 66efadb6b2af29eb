"""A grip loop that runs in a thread beside a session, for the page and other programs."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from threading import Event, Thread
from types import TracebackType
from typing import Self

from msgspec.structs import asdict

from holdfast.live.session import Session
from holdfast_grip.command import GripReason, LoopState
from holdfast_grip.documents import GripDocument, GripEntry, GripFinger
from holdfast_grip.errors import HandError
from holdfast_grip.loop.grip_faults import explain_fault
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.runner import LoopRunner

N_ENTRIES = 20
"""Number of newest events that are kept."""
LOCK = (
    "the hand is armed: the tare, the thresholds and the model are locked; start again without "
    "--armed to change them"
)
"""Reason of the lock of a session whose estimates move a hand."""

GripListener = Callable[[str, float], None]
"""Function that gets each event of a loop as a text, and its time [s]. It must return at once."""


class EventLog:
    """Memory of the newest events of a loop, which passes each one on to listeners.

    Attributes:
        entries: newest events, oldest first.
    """

    def __init__(self) -> None:
        self.entries: deque[GripEntry] = deque(maxlen=N_ENTRIES)
        self._listeners: list[GripListener] = []

    def add_listener(self, listener: GripListener) -> None:
        """Call `listener` with every event from now on."""
        # A new list: the thread of the loop may be in the old one.
        self._listeners = [*self._listeners, listener]

    def __call__(self, text: str, time: float) -> None:
        """Add an event; the log of a loop."""
        self.entries.append(GripEntry(time, text))
        for listener in self._listeners:
            listener(text, time)


class LiveGrip:
    """Loop that is stepped in a thread of its own, with the updates of a session.

    It is a context manager: leaving it ends the thread, before the loop sends its last command.
    An armed loop locks the session: with another threshold or tare, the same contact would move
    the hand.
    If the hand refuses a command, the thread ends with the safe command, and the watchdog sends
    it too; `document` shows why, and leaving the context raises the error.

    Args:
        law: name of the law.
        loop: an open loop, with `log` as its log.
        session: gives the updates.
        log: of the loop.

    Attributes:
        failure: the exception that ended the loop.
    """

    def __init__(self, law: str, loop: GripLoop, session: Session, log: EventLog) -> None:
        source = session.source
        self.failure: Exception | None = None
        self._law, self._loop, self._session, self._log = law, loop, session, log
        self._runner = LoopRunner(loop, source.speed if source.paced else 0.0)
        self._over = Event()
        self._thread = Thread(target=self._run, name="holdfast-grip", daemon=True)

    def stop(self) -> "Future[None]":
        """Bring the hand into its safe state at once; the result is there when it was sent."""
        return self._ended() or self._runner.stop()

    def reset(self) -> "Future[None]":
        """End a stop or a fault, by the decision of a person."""
        return self._ended() or self._runner.reset()

    def add_listener(self, listener: GripListener) -> None:
        """Call `listener` with every event from now on."""
        self._log.add_listener(listener)

    def document(self) -> GripDocument:
        """Return the state and the newest command."""
        loop, last = self._loop, self._loop.last
        limits, highest = loop.controller.limits, loop.controller.highest_scales
        state = LoopState.FAULT if self.failure else last.state if last else LoopState.IDLE
        fault = None
        if state is LoopState.FAULT:
            fault = explain_fault(
                last.reason if last else "",
                limits,
                armed=loop.armed,
                released=last is not None and last.release,
                failure=str(self.failure or ""),
            )
        return GripDocument(
            hand=loop.hand.name,
            law=self._law,
            armed=loop.armed,
            limits=limits,
            state=state,
            reason=last.reason if last else GripReason.NONE,
            stopped=loop.stopped,
            released=last is not None and last.release,
            time=last.time if last else None,
            fingers={
                name: GripFinger(**asdict(command), highest=highest.get(name, limits.max_scale))
                for name, command in (last.fingers if last else {}).items()
            },
            n_sent=loop.n_sent,
            failure=str(self.failure or ""),
            events=list(self._log.entries),
            fault=fault,
            waiting=loop.controller.waits_for if state is LoopState.IDLE else "",
        )

    def _ended(self) -> "Future[None] | None":
        """Return the failure of a request to a loop that has ended; None while it runs."""
        if self.failure is None:
            return None
        future: Future[None] = Future()
        future.set_exception(HandError(f"the loop has ended: {self.failure}"))
        return future

    def _run(self) -> None:
        try:
            self._runner.run(self._over.is_set)
        except Exception as failure:  # leaving the context raises it
            # First the hand, then the log, which calls listeners.
            self._loop.make_safe()
            self.failure = failure
            last = self._loop.last
            self._log(f"grip FAULT (hand): {failure}", last.time if last else 0.0)

    def __enter__(self) -> Self:
        if self._loop.armed:
            self._session.lock = LOCK
        self._session.add_listener(self._runner.put)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._session.remove_listener(self._runner.put)
        self._over.set()
        # Before the lock ends: no step may use another threshold.
        self._thread.join()
        self._session.lock = ""
        if self.failure is not None and kind is None:
            raise self.failure
