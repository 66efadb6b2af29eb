"""A topic of ROS as a source, whichever ROS: the watch on it, and what is told of it."""

import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from holdfast.errors import SourceError
from holdfast.ros.sensor_messages import DeviceSample
from holdfast.sensors.types import Unit
from holdfast.sources.base import Arrival, Source, notice_arrival
from holdfast.sources.ros.translator import Translator
from holdfast.sources.uri import Address

PATIENCE = 5.0
"""How long entering waits for a message with samples [s]."""
GATHERING = 1.0
"""How long the devices of a topic are waited for, where a message is of one of them [s]."""
SILENCE = 1.0
"""Without a new sample for so long, a topic is silent [s]."""
BACKOFF, LONGEST_BACKOFF = 0.5, 2.0
"""Before the first and before later attempts to mend a link [s]; it doubles."""


class Stranger(ValueError):  # noqa: N818 (it names what came, not what broke)
    """A message is of a type that nobody knows; its text says so."""


class Packet(NamedTuple):
    """A message as it came.

    Attributes:
        data: its bytes.
        received: when it was in hand, by `time.monotonic` [s].
        unpack: takes readings out of it; raises a `ValueError` where there are none.
    """

    data: bytes
    received: float
    unpack: Callable[[bytes], list[DeviceSample]]


class Link(ABC):
    """A subscription to one topic."""

    @abstractmethod
    def open(self, deadline: float) -> None:
        """Subscribes.

        Raises:
            SourceError: ROS cannot be reached, or the topic has messages of another type.
        """

    @abstractmethod
    def take(self, timeout: float) -> Packet | None:
        """The next message, or None where none came within `timeout` [s]."""

    @abstractmethod
    def n_publishers(self) -> int:
        """How many publish on the topic now."""

    @abstractmethod
    def missing(self) -> str:
        """What to tell where no message comes: who publishes, which topics there are."""

    @abstractmethod
    def close(self) -> None:
        """Ends the subscription; again, it does nothing."""

    def mend(self) -> None:  # noqa: B027 (some links mend themselves)
        """Subscribes again where nobody publishes and that would help."""

    def n_dropped(self) -> int:
        """Messages that were not taken in time, since the last call."""
        return 0


class TopicSource(Source):
    """The sensors of one topic.

    Args:
        address: `ros2:///TOPIC`, with `values`, `fingers` and `sensor` as of XELA's server.
        link: to the topic.
    """

    def __init__(self, address: Address, link: Link) -> None:
        self.name = address.text
        self._link = link
        unit: Unit = "N" if address.calibrated() else "count"
        self._options = (address.names(), unit, address.sensor())
        self._translator = Translator(*self._options)
        self._forget()

    def open(self) -> None:
        """Subscribes, and waits until the modules are known.

        Raises:
            SourceError: ROS cannot be reached, nobody publishes, or not what is expected.
        """
        self.close()
        self._translator = Translator(*self._options)
        deadline = time.monotonic() + PATIENCE
        self._link.open(deadline)
        packets, messages = self._first(deadline)
        self._translator.learn(messages)
        self.sensors = self._translator.sensors
        self.metadata = {"source": self.name, **self._translator.metadata}
        notices = [notice for skin in self._translator.skins.values() for notice in skin.notices]
        if notices:
            self._pending.append(notice_arrival(time.monotonic(), *notices))
        self._heard_at = self._seen_at = time.monotonic()
        for packet in packets:
            self._take(packet)

    def read(self, timeout: float) -> Arrival | None:
        """What arrived next, or None where nothing did within `timeout` [s]."""
        deadline = time.monotonic() + timeout
        while not self._pending:
            left = deadline - time.monotonic()
            packet = self._link.take(max(min(left, self._until_word()), 0.0))
            if packet is not None:
                self._end_loneliness()
                self._take(packet)
            self._watch(idle=packet is None)
            if left <= 0:
                break
        return self._pending.popleft() if self._pending else None

    def close(self) -> None:
        """Ends the subscription; again, it does nothing."""
        self._link.close()
        self._forget()

    def _forget(self) -> None:
        self._pending: deque[Arrival] = deque()
        self._heard_at = self._seen_at = time.monotonic()
        self._silent = self._alone = False
        self._backoff, self._mend_at = BACKOFF, 0.0

    def _first(self, deadline: float) -> tuple[list[Packet], list[DeviceSample]]:
        """The first packets, until one tells of a device anew."""
        packets: list[Packet] = []
        found: dict[int | None, DeviceSample] = {}
        refusal: ValueError | None = None
        while (left := deadline - time.monotonic()) > 0:
            packet = self._link.take(left)
            if packet is None:
                continue
            try:
                messages = [m for m in packet.unpack(packet.data) if _has_taxels(m)]
            except Stranger as why:
                raise SourceError(str(why)) from why
            except ValueError as why:
                refusal = why
                continue
            packets.append(packet)
            if any(m.number in found for m in messages):
                break
            if messages and not found:
                deadline = min(deadline, time.monotonic() + GATHERING)
            found.update((m.number, m) for m in messages)
        if found:
            return packets, list(found.values())
        if refusal is not None:
            raise SourceError(f"what {self.name} sends makes no sense: {refusal}") from refusal
        raise SourceError(self._link.missing())

    def _take(self, packet: Packet) -> None:
        try:
            messages = packet.unpack(packet.data)
            arrivals = self._translator.take(messages, packet.received)
        except ValueError as why:
            arrivals = self._translator.refuse(str(why), packet.received)
        if any(arrival.samples for arrival in arrivals):
            if self._silent:
                silence = packet.received - self._heard_at
                self._tell(f"samples again after {silence:.1f} s")
            self._silent = False
            self._heard_at = packet.received
        self._pending.extend(arrivals)

    def _until_word(self) -> float:
        """How long nothing has to be told or done, where no message comes [s]."""
        if self._alone:
            return max(self._mend_at - time.monotonic(), 0.01)
        return BACKOFF if self._silent else max(self._heard_at + SILENCE - time.monotonic(), 0.01)

    def _watch(self, *, idle: bool) -> None:
        """Looks after silence, publishers and the link."""
        now = time.monotonic()
        if n_dropped := self._link.n_dropped():
            self._tell(f"{n_dropped} messages dropped: they were taken too slowly")
        if idle and not self._silent and now - self._heard_at >= SILENCE:
            self._silent = True
            self._tell(f"no new sample for {SILENCE:g} s")
        if idle and (self._alone or now - self._seen_at >= BACKOFF):
            self._seen_at = now
            self._look_for_publishers(now)

    def _look_for_publishers(self, now: float) -> None:
        if self._link.n_publishers() > 0:
            self._end_loneliness()
            return
        if not self._alone:
            self._alone = True
            self._backoff, self._mend_at = BACKOFF, now + BACKOFF
            self._tell("nobody publishes any more")
        if now >= self._mend_at:
            self._backoff = min(2 * self._backoff, LONGEST_BACKOFF)
            self._link.mend()
            self._mend_at = time.monotonic() + self._backoff

    def _end_loneliness(self) -> None:
        if self._alone:
            self._alone = False
            self._translator.reconnected()
            self._tell("somebody publishes again")

    def _tell(self, notice: str) -> None:
        self._pending.append(notice_arrival(time.monotonic(), notice))


def topic_of(address: Address) -> str:
    """The topic that a URI names: `/xServTopic` for `ros2:///xServTopic`.

    Raises:
        ValueError: it names none.
    """
    topic = address.path.rstrip("/")
    if address.host or not topic.startswith("/") or len(topic) < 2:
        scheme = address.text.split(":", maxsplit=1)[0]
        raise ValueError(
            f"{address.text}: {scheme}:///TOPIC expected, as in {scheme}:///xServTopic"
        )
    return topic


def _has_taxels(message: DeviceSample) -> bool:
    return len(message.forces if message.counts is None else message.counts) > 0
