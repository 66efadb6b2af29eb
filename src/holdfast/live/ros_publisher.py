"""Estimates on topics of ROS, whichever ROS: what is published, when, and by which thread."""

import re
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Mapping
from threading import Condition, Thread
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self

from holdfast.contact import ContactEstimate, ContactState, HandEstimate, Reason
from holdfast.sensors.types import Unit

if TYPE_CHECKING:
    from holdfast.live.stream_detector import StreamUpdate

N_QUEUED = 64
"""Estimates that wait for ROS; then the oldest goes."""
DIAGNOSTICS_PERIOD = 1.0
"""Diagnostics come at least so often [s]."""
STALE = 1.0
"""An estimate that is older is none any more [s]."""
STRING, FLOAT = "std_msgs/String", "std_msgs/Float64"
VECTOR, WRENCH = "geometry_msgs/Vector3Stamped", "geometry_msgs/WrenchStamped"
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
"""Types of what is published."""
OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostics, as in ROS."""

_Force = tuple[float, float, float]


class Status(NamedTuple):
    """The health of a finger or of the hand, for `/diagnostics`.

    Attributes:
        name: of the finger, or `hand`.
        level: OK, WARN or ERROR.
        message: for people.
        values: the same for programs.
    """

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class RosPublisher(ABC):
    """Publishes what a detector says, in a thread of its own; it never holds up who calls.

    Of each finger `NAMESPACE/FINGER/state` (text), `stable_probability` and `instability`
    (numbers), `force` (a wrench where the unit is N, else a vector); of the hand
    `NAMESPACE/hand/state`; and `/diagnostics`, once a second and when faults change. Stamps are
    the host's, of when an estimate was given.

    Args:
        units: of the readings, by finger.
        namespace: that topics begin with.

    Attributes:
        n_dropped: estimates that ROS was too slow for.
        n_failed: estimates that ROS refused.

    Raises:
        ValueError: two fingers would have the same topics, or the namespace is no name of ROS.
    """

    def __init__(self, units: Mapping[str, Unit], namespace: str = "/holdfast") -> None:
        self._units = dict(units)
        self._names = topic_names(units, namespace)
        self._namespace = namespace.rstrip("/")
        self._waiting: deque[tuple[HandEstimate, tuple[str, ...], float]] = deque()
        self._came = Condition()
        self._thread: Thread | None = None
        self._newest: tuple[HandEstimate, float] | None = None
        self._health: tuple[int, ...] = ()
        self._due = 0.0
        self._ending = False
        self.n_dropped = self.n_failed = 0

    def open(self) -> None:
        """Becomes a node of ROS, and starts.

        Raises:
            SourceError: ROS cannot be reached.
        """
        self._connect(self.topics())
        self._ending = False
        self._thread = Thread(target=self._run, name="holdfast-ros", daemon=True)
        self._thread.start()

    def topics(self) -> dict[str, str]:
        """The type of each topic."""
        topics = {f"{self._namespace}/hand/state": STRING, "/diagnostics": DIAGNOSTICS}
        for finger, name in self._names.items():
            topics[f"{name}/state"] = STRING
            topics[f"{name}/stable_probability"] = topics[f"{name}/instability"] = FLOAT
            topics[f"{name}/force"] = WRENCH if self._units[finger] == "N" else VECTOR
        return topics

    def close(self) -> None:
        """Publishes what waits, and ends; again, it does nothing."""
        with self._came:
            self._ending = True
            self._came.notify()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
            self._disconnect()

    def put(self, update: "StreamUpdate") -> None:
        """Publish the estimates of an update; a listener of a session."""
        for one in update.estimates:
            self.publish(one.estimate, one.updated_fingers)

    def publish(self, estimate: HandEstimate, fingers: Iterable[str] | None = None) -> None:
        """Publishes an estimate, soon.

        Args:
            estimate: of the hand.
            fingers: whose estimates are new; all where not given.
        """
        new = tuple(estimate.fingers if fingers is None else fingers)
        with self._came:
            if len(self._waiting) == N_QUEUED:
                self._waiting.popleft()
                self.n_dropped += 1
            self._waiting.append((estimate, new, time.time()))
            self._came.notify()

    @abstractmethod
    def _connect(self, topics: Mapping[str, str]) -> None:
        """Becomes a node with these topics, of these types."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Ends the node."""

    @abstractmethod
    def _text(self, topic: str, text: str) -> None: ...

    @abstractmethod
    def _number(self, topic: str, number: float) -> None: ...

    @abstractmethod
    def _force(
        self, topic: str, stamp: float, finger: str, force: _Force, *, newtons: bool
    ) -> None: ...

    @abstractmethod
    def _diagnostics(self, stamp: float, statuses: Iterable[Status]) -> None: ...

    def _run(self) -> None:
        while True:
            with self._came:
                until = max(self._due - time.monotonic(), 0.0)
                self._came.wait_for(lambda: self._waiting or self._ending, until)
                if self._ending and not self._waiting:
                    return
                item = self._waiting.popleft() if self._waiting else None
            try:
                self._say(item)
            except Exception:  # whatever ROS raises: the next may do
                self.n_failed += 1

    def _say(self, item: tuple[HandEstimate, tuple[str, ...], float] | None) -> None:
        if item is not None:
            estimate, fingers, stamp = item
            self._newest = estimate, stamp
            self._estimate(estimate, fingers, stamp)
        self._look_after()

    def _estimate(self, estimate: HandEstimate, fingers: Iterable[str], stamp: float) -> None:
        for finger in fingers:
            one, name = estimate.fingers[finger], self._names[finger]
            self._text(f"{name}/state", one.state)
            self._number(f"{name}/stable_probability", one.stable_probability)
            self._number(f"{name}/instability", one.instability)
            newtons = self._units[finger] == "N"
            self._force(f"{name}/force", stamp, finger, one.force, newtons=newtons)
        self._text(f"{self._namespace}/hand/state", estimate.state)

    def _look_after(self) -> None:
        """Diagnostics, where they are due or the health is another."""
        now = time.time()
        statuses = statuses_of(self._newest, now)
        health = tuple(hash((one.level, one.message)) for one in statuses)
        if health == self._health and time.monotonic() < self._due:
            return
        self._health = health
        self._due = time.monotonic() + DIAGNOSTICS_PERIOD
        self._diagnostics(now, statuses)

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def topic_names(fingers: Iterable[str], namespace: str) -> dict[str, str]:
    """What the topics of each finger begin with.

    Names of ROS are of letters, digits and `_`, and no part begins with a digit: `index/1`
    becomes `index_1`.

    Raises:
        ValueError: two fingers would have the same, or the namespace is no name of ROS.

    Example:
        >>> topic_names(["thumb", "index/1"], "/holdfast")
        {'thumb': '/holdfast/thumb', 'index/1': '/holdfast/index_1'}
    """
    base = namespace.rstrip("/")
    if not re.fullmatch(r"(/[A-Za-z][A-Za-z0-9_]*)*", base):
        raise ValueError(f"a namespace as /holdfast expected, {namespace!r} given")
    names = {finger: f"{base}/{_name(finger)}" for finger in fingers}
    if len({*names.values(), f"{base}/hand"}) <= len(names):
        raise ValueError(f"fingers {', '.join(names)} would share topics: rename one")
    return names


def _name(finger: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_/]", "_", finger).strip("/")
    plain = re.sub(r"/+(?=[0-9_])", "_", re.sub(r"_{2,}", "_", plain))
    return plain if plain[:1].isalpha() else f"finger_{plain.lstrip('_')}"


def statuses_of(newest: tuple[HandEstimate, float] | None, now: float) -> list[Status]:
    """The health of each finger and of the hand.

    Args:
        newest: estimate, and when it was given [s].
        now: on the same clock [s].
    """
    if newest is None:
        return [Status("hand", WARN, "no estimate yet", ())]
    estimate, given = newest
    if now - given > STALE:
        silent = (("seconds_since_estimate", f"{now - given:.0f}"),)
        return [Status("hand", ERROR, "no estimates any more", silent)]
    fingers = [_status(name, finger) for name, finger in estimate.fingers.items()]
    worst = max((status.level for status in fingers), default=OK)
    faulty = [status.name for status in fingers if status.level == worst] if worst else []
    text = f"look at {', '.join(faulty)}" if faulty else "all fingers are well"
    hand = Status("hand", worst, text, (("state", str(estimate.state)),))
    return [hand, *fingers]


def _status(name: str, finger: ContactEstimate) -> Status:
    faults = ", ".join(finger.faults)
    is_blind = finger.state is ContactState.UNKNOWN and finger.reason in (Reason.FAULT, Reason.GAP)
    level = ERROR if is_blind else WARN if faults else OK
    values = (
        ("state", str(finger.state)),
        ("reason", str(finger.reason)),
        ("faults", faults),
        ("faulty_taxels", ", ".join(map(str, finger.faulty_taxels))),
    )
    return Status(name, level, faults or (str(finger.reason) if is_blind else "well"), values)
