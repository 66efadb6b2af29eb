"""Publish estimates on topics of ROS 2."""

import math
import re
import time
from collections import deque
from collections.abc import Iterable, Mapping
from threading import Condition, Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from msgspec.structs import asdict

from holdfast.contact import ContactState, HandEstimate, Reason
from holdfast.live.documents import numbered
from holdfast.openable import Openable
from holdfast.sensors.types import Unit
from holdfast_ros.dds import Link, Publisher
from holdfast_ros.topic_messages import (
    DIAGNOSTICS,
    FLOAT64,
    STRING,
    VECTOR,
    WRENCH,
    header,
    number_message,
)

if TYPE_CHECKING:
    from holdfast.live.stream_detector import StreamUpdate

MAX_QUEUED_ESTIMATES = 64
"""Maximum number of estimates that wait for ROS; the oldest is dropped first."""
DIAGNOSTICS_PERIOD = 1.0
"""Maximum time between two diagnostics messages [s]."""
MAX_ESTIMATE_AGE = 1.0
"""Age from which an estimate counts as missing in the diagnostics [s]."""
NUMBER_FIELDS = (
    "stable_probability", "slip_probability", "slip_speed", "slip_distance", "instability",
)  # fmt: skip
"""Fields of an estimate with a topic of numbers for each finger; NaN where there is none."""
NO_TORQUE_FIELDS = {"x": 0.0, "y": 0.0, "z": 0.0}
OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostics in ROS."""
NOT_IN_DIAGNOSTICS = frozenset({"time", "force", "cause", *NUMBER_FIELDS})
"""Fields of an estimate that the diagnostics leave out: those with a topic, the time, and the
cause, which is no problem of the sensor."""


class DiagnosticStatus(NamedTuple):
    """Health of a finger or of the hand, for `/diagnostics`.

    Attributes:
        name: of the finger, or `hand`.
        level: OK, WARN or ERROR.
        message: one line for the user.
        values: names and values for programs.
    """

    name: str
    level: int
    message: str
    values: tuple[tuple[str, str], ...]


class Ros2Publisher(Openable):
    """Publish estimates in a separate thread; it never delays the caller.

    The topics of each finger are `NAMESPACE/FINGER/state` (text), `stable_probability`,
    `slip_probability` (NaN without a slip rule), `slip_speed` [mm/s] and `slip_distance` [mm]
    (NaN without a speed rule) and `instability` (numbers), and `force` (a wrench if the unit is
    N, else a vector). The topic of the hand is `NAMESPACE/hand/state`.
    `/diagnostics` is published once a second, and when faults change. Time stamps are the host's
    time when `publish` was called.

    Args:
        units: of the readings, by finger.
        link: connection to ROS.
        namespace: prefix of the topics.

    Attributes:
        n_dropped: estimates that were dropped because ROS was too slow.
        n_failed: estimates that ROS refused.

    Raises:
        ValueError: two fingers would have the same topics, or the namespace is not a valid
            ROS name.
    """

    def __init__(self, units: Mapping[str, Unit], link: Link, namespace: str = "/holdfast") -> None:
        self._link = link
        self._publishers: dict[str, Publisher] = {}
        self._units = dict(units)
        self._names = topic_names(units, namespace)
        self._namespace = namespace.rstrip("/")
        self._queue: deque[tuple[HandEstimate, tuple[str, ...], float]] = deque()
        self._queue_changed = Condition()
        self._thread: Thread | None = None
        # Newest estimate and its time, for the diagnostics; only the thread sets it.
        self._newest: tuple[HandEstimate, float] | None = None
        self._levels: tuple[int, ...] = ()
        self._diagnostics_due = 0.0
        self._closing = False
        self.n_dropped = self.n_failed = 0

    def open(self) -> None:
        """Connect to ROS, and start the thread.

        Raises:
            SourceError: ROS cannot be reached.
        """
        self._link.open()
        topics = self.topics()
        self._publishers = {topic: self._link.publisher(topic, topics[topic]) for topic in topics}
        self._closing = False
        self._thread = Thread(target=self._run, name="holdfast-ros", daemon=True)
        self._thread.start()

    def topics(self) -> dict[str, str]:
        """Return the message type of each topic."""
        topics = {f"{self._namespace}/hand/state": STRING, "/diagnostics": DIAGNOSTICS}
        for finger, name in self._names.items():
            topics[f"{name}/state"] = STRING
            topics |= {f"{name}/{field}": FLOAT64 for field in NUMBER_FIELDS}
            topics[f"{name}/force"] = WRENCH if self._units[finger] == "N" else VECTOR
        return topics

    def close(self) -> None:
        """Publish what is in the queue, and disconnect; a second call does nothing."""
        with self._queue_changed:
            self._closing = True
            self._queue_changed.notify()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join()
            self._publishers.clear()
            self._link.close()

    def put(self, update: "StreamUpdate") -> None:
        """Publish the estimates of an update; a listener of a session."""
        for estimate, updated_fingers in update.estimates:
            self.publish(estimate, updated_fingers)

    def publish(self, estimate: HandEstimate, fingers: Iterable[str] | None = None) -> None:
        """Append an estimate to the queue.

        Args:
            estimate: of the hand.
            fingers: fingers whose estimate is new; by default all.
        """
        updated = tuple(estimate.fingers if fingers is None else fingers)
        with self._queue_changed:
            if len(self._queue) == MAX_QUEUED_ESTIMATES:
                self._queue.popleft()
                self.n_dropped += 1
            self._queue.append((estimate, updated, time.time()))
            self._queue_changed.notify()

    def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        self._publishers[topic].publish(message)

    def _publish_text(self, topic: str, text: str) -> None:
        self._publish(topic, {"data": str(text)})

    def _run(self) -> None:
        while True:
            with self._queue_changed:
                # Diagnostics go on while no estimate comes.
                until = max(self._diagnostics_due - time.monotonic(), 0.0)
                self._queue_changed.wait_for(lambda: self._queue or self._closing, until)
                if self._closing and not self._queue:
                    return
                item = self._queue.popleft() if self._queue else None
            try:
                if item is not None:
                    estimate, fingers, stamp = item
                    self._newest = estimate, stamp
                    self._publish_estimate(estimate, fingers, stamp)
                self._update_diagnostics()
            except Exception:  # of any kind; the next estimate may succeed
                self.n_failed += 1

    def _publish_estimate(
        self, estimate: HandEstimate, fingers: Iterable[str], stamp: float
    ) -> None:
        for name in fingers:
            finger, topic = estimate.fingers[name], self._names[name]
            self._publish_text(f"{topic}/state", finger.state)
            for field in NUMBER_FIELDS:
                value = getattr(finger, field)
                number = number_message(math.nan if value is None else value)
                self._publish(f"{topic}/{field}", number)
            force = dict(zip("xyz", finger.force, strict=True))
            message: dict[str, Any] = {"header": header(stamp, name), "vector": force}
            if self._units[name] == "N":
                message["wrench"] = {"force": force, "torque": NO_TORQUE_FIELDS}
            self._publish(f"{topic}/force", message)
        self._publish_text(f"{self._namespace}/hand/state", estimate.state)

    def _update_diagnostics(self) -> None:
        """Publish the diagnostics if they are due or have changed."""
        now = time.time()
        statuses = diagnostics_of(self._newest, now)
        # A new level or text is published at once, without a wait for the period.
        levels = tuple(hash((status.level, status.message)) for status in statuses)
        if levels == self._levels and time.monotonic() < self._diagnostics_due:
            return
        self._levels = levels
        self._diagnostics_due = time.monotonic() + DIAGNOSTICS_PERIOD
        messages = [
            {
                "level": status.level,
                "name": f"holdfast: {status.name}",
                "message": status.message,
                "hardware_id": "holdfast",
                "values": [{"key": key, "value": value} for key, value in status.values],
            }
            for status in statuses
        ]
        self._publish("/diagnostics", {"header": header(now), "status": messages})


def topic_names(fingers: Iterable[str], namespace: str) -> dict[str, str]:
    """Return the prefix of each finger's topics.

    A ROS name has letters, digits and `_`, and no part begins with a digit: `index/1` becomes
    `index_1`.

    Raises:
        ValueError: two fingers would have the same prefix, or the namespace is not a valid ROS
            name.

    Example:
        >>> topic_names(["thumb", "index/1"], "/holdfast")
        {'thumb': '/holdfast/thumb', 'index/1': '/holdfast/index_1'}
    """
    base = namespace.rstrip("/")
    if not re.fullmatch(r"(/[A-Za-z][A-Za-z0-9_]*)*", base):
        raise ValueError(f"a namespace as /holdfast expected, {namespace!r} given")
    names = {}
    for finger in fingers:
        name = re.sub(r"[^A-Za-z0-9_/]", "_", finger).strip("/")
        name = re.sub(r"/+(?=[0-9_])", "_", re.sub(r"_{2,}", "_", name))
        part = name if name[:1].isalpha() else f"finger_{name.lstrip('_')}"
        names[finger] = f"{base}/{part}"
    # `hand` has a topic too, which no finger may take.
    if len({*names.values(), f"{base}/hand"}) <= len(names):
        raise ValueError(f"fingers {', '.join(names)} would share topics: rename one")
    return names


def diagnostics_of(newest: tuple[HandEstimate, float] | None, now: float) -> list[DiagnosticStatus]:
    """Return the health of the hand and of each finger.

    Args:
        newest: estimate, and when it was published [s].
        now: current time on the same clock [s].
    """
    if newest is None:
        return [DiagnosticStatus("hand", WARN, "no estimate yet", ())]
    estimate, published = newest
    if now - published > MAX_ESTIMATE_AGE:
        silent = (("seconds_since_estimate", f"{now - published:.0f}"),)
        return [DiagnosticStatus("hand", ERROR, "no estimates any more", silent)]
    fingers = []
    for name, finger in estimate.fingers.items():
        faults = ", ".join(finger.faults)
        # A finger without an estimate is an error; a fault with which it goes on is a warning.
        is_lost = finger.state is ContactState.UNKNOWN and finger.reason in (
            Reason.FAULT,
            Reason.GAP,
        )
        level = ERROR if is_lost else WARN if faults else OK
        values = tuple(
            (field, ", ".join(map(str, value)) if isinstance(value, tuple) else str(value))
            for field, value in asdict(numbered(finger)).items()
            if field not in NOT_IN_DIAGNOSTICS
        )
        text = faults or (str(finger.reason) if is_lost else "well")
        fingers.append(DiagnosticStatus(name, level, text, values))
    worst = max((status.level for status in fingers), default=OK)
    faulty = [status.name for status in fingers if status.level == worst] if worst else []
    text = f"problem of {', '.join(faulty)}" if faulty else "no problems"
    hand = DiagnosticStatus("hand", worst, text, (("state", str(estimate.state)),))
    return [hand, *fingers]
