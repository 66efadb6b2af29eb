"""Base class of hands on topics: their opening, and the checks at each command."""

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from holdfast.errors import SourceError
from holdfast.sensors.types import Array
from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands.base import MAX_JOINT_REPORTS, HandDevice
from holdfast_ros.dds import Link, Publisher, TakeStates
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.topic_messages import JointStates

HAND_OPEN_TIMEOUT = 5.0
"""Longest wait until the hand listens and sends its joint states [s]."""
DISCOVERY_TIME = 0.5
"""Time in which other publishers are found [s]."""
STATE_TIMEOUT = 0.5
"""Time without valid joint states after which a hand does not answer any more [s]."""
SILENCE_TIME, SILENCE_PERIODS = 0.1, 3.0
"""A hand is silent without joint states for this time [s], or this number of their periods if that
is longer."""
STATE_MEMORY = 0.2
"""Time of the joint states whose median counts at the beginning of a grip; the hand has been STABLE
for as long [s]."""
MIN_STATES = 5
"""Least number of these joint states, so that two wrong ones cannot define their median."""
HAND_POLL_INTERVAL = 0.01
"""Time between two checks while the hand is opened [s]."""


class RosHand(HandDevice):
    """Hand that takes commands on topics.

    It commands nothing before the grip begins (state IDLE), because another program closes the
    hand. What is in force then is the base that the scales multiply. Joint states that cannot be
    right are ignored and counted in `n_refused`. On standby it can release only, not hold, because
    it has no grip of its own: the drivers of these hands keep their last command anyway.

    Args:
        link: connection to ROS.
        given: parameters of its URI.
        topics: message type of each topic that it publishes; the first one has the commands.
        states: topic of the joint states; None if they are not needed.
    """

    def __init__(
        self, link: Link, parameters: Parameters, topics: Mapping[str, str], states: str | None
    ) -> None:
        self.name = parameters.text
        self._link, self._topics = link, dict(topics)
        self._states_topic, self._shared = states, parameters.shared
        self._publishers: dict[str, Publisher] = {}
        self._take_states: TakeStates | None = None
        # Valid joint states and when they were read, newest last; `_poll` adds and drops them.
        self._states: deque[tuple[float, JointStates]] = deque()
        # Angles since the last call of `joint_reports`, which empties it.
        self._reports: deque[Array] = deque(maxlen=MAX_JOINT_REPORTS)
        self._refusal = ""

    @property
    def resource(self) -> str:
        """Name of the claim: the topic of the commands."""
        return f"{next(iter(self._topics))} {self._link.where}"

    @property
    def silent(self) -> bool:
        """Whether there have been no joint states for 0.1 s, or for three of their periods."""
        self._poll()
        if self._take_states is None or not self._states:
            return False
        times = [at for at, _ in self._states]
        if len(times) < 2:  # their period is not known
            return time.monotonic() - times[-1] > STATE_TIMEOUT
        period = (times[-1] - times[0]) / (len(times) - 1)
        return time.monotonic() - times[-1] > max(SILENCE_TIME, SILENCE_PERIODS * period)

    def joint_reports(self) -> Sequence[Array]:
        """Return the angles of the valid joint states since the last call, oldest first [rad]."""
        self._poll()
        reports = list(self._reports)
        self._reports.clear()
        return reports

    def open(self) -> None:
        """Wait until the hand listens and sends valid joint states.

        Raises:
            HandError: it does not within 5 s, or another program publishes commands.
        """
        self.close()
        try:
            with hand_errors():
                self._connect()
        except BaseException:
            self.close()  # else the next attempt finds the publishers of this one
            raise

    def _connect(self) -> None:
        self._link.open()
        begun_at = time.monotonic()
        self._publishers = {
            topic: self._link.publisher(topic, kind) for topic, kind in self._topics.items()
        }
        if self._states_topic is not None and not self.standby:
            self._take_states = self._link.joint_states(self._states_topic)
        for topic, publisher in self._publishers.items():
            while not publisher.n_listeners():
                if time.monotonic() - begun_at > HAND_OPEN_TIMEOUT:
                    others = ", ".join(self._link.subscribed_topics()) or "none"
                    raise HandError(
                        f"{self.name}: nothing listens on {topic} {self._link.where} after "
                        f"{HAND_OPEN_TIMEOUT:g} s; topics with a subscriber: {others}"
                    )
                time.sleep(HAND_POLL_INTERVAL)
        while self._take_states is not None and not self._poll():
            if time.monotonic() - begun_at > HAND_OPEN_TIMEOUT:
                where = f"{self._states_topic} {self._link.where} in {HAND_OPEN_TIMEOUT:g} s"
                if self._states or self._refusal:
                    raise HandError(
                        f"{self.name}: {len(self._states)} valid joint states on {where}, at least "
                        f"{MIN_STATES} expected{self._refused()}"
                    )
                others = ", ".join(self._link.published_topics()) or "none"
                raise HandError(
                    f"{self.name}: no joint states on {where}; published topics: {others}"
                )
            time.sleep(HAND_POLL_INTERVAL)
        if self._shared or self.standby:  # a watchdog stands beside the loop that publishes
            return
        # Discovery of other publishers takes time, of which the waits above were a part.
        time.sleep(max(begun_at + DISCOVERY_TIME - time.monotonic(), 0.0))
        for topic in self._topics:
            if self._link.n_other_publishers(topic):
                raise HandError(
                    f"{self.name}: another program publishes {topic} {self._link.where}: stop it, "
                    "or give shared=true if it is silent while the loop runs"
                )

    def close(self) -> None:
        """Disconnect. It has no effect on a hand that is closed."""
        self.forget()
        self._publishers.clear()
        self._take_states = None
        self._states.clear()
        self._reports.clear()
        self._refusal = ""
        self._link.close()

    def _watch(self) -> None:
        if not self._publishers:
            raise HandError(f"{self.name} is not open")
        self._poll()
        if self.standby:  # it sends a release in any case, even if the hand seems dead
            return
        for topic, publisher in self._publishers.items():
            if not publisher.n_listeners():
                raise HandError(
                    f"{self.name}: nothing listens on {topic} any more; the hand keeps its last "
                    "command"
                )
        if self._take_states is None:
            return
        silence = time.monotonic() - self._states[-1][0]
        if silence > STATE_TIMEOUT:
            valid = "valid " if self._refusal else ""
            raise HandError(
                f"{self.name}: no {valid}joint states on {self._states_topic} for {silence:.1f} s"
                f"{self._refused()}; the hand keeps its last command"
            )

    def _send(self, command: GripCommand) -> None:
        if command.release:
            self._release()
        elif not self.standby:
            self._press(command)

    def _checked(self, states: JointStates) -> JointStates:
        """Return joint states in the order of the hand.

        Raises:
            ValueError: they cannot be right.
        """
        return states

    @abstractmethod
    def _press(self, command: GripCommand) -> None:
        """Send the forces of a command."""

    @abstractmethod
    def _release(self) -> None:
        """Open the hand."""

    def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        with hand_errors():
            self._publishers[topic].publish(message)

    def _poll(self) -> bool:
        """Read the new joint states; return whether there are enough for a grip to begin."""
        now = time.monotonic()
        with hand_errors():
            new = () if self._take_states is None else self._take_states()
        for states in new:
            try:
                checked = self._checked(states)
            except ValueError as cause:
                self.n_refused += 1
                self._refusal = str(cause)
            else:
                self._states.append((now, checked))
                self._reports.append(checked.positions)
        # Of a slow publisher the last ones stay, however old they are.
        while len(self._states) > MIN_STATES and now - self._states[0][0] > STATE_MEMORY:
            self._states.popleft()
        return len(self._states) >= MIN_STATES

    def _refused(self) -> str:
        """Return how many joint states were refused, and why the last one was."""
        return f" ({self.n_refused} refused: {self._refusal})" if self._refusal else ""


@contextmanager
def hand_errors() -> Iterator[None]:
    """Turn an error of ROS into one of the hand.

    Raises:
        HandError: the block raised a `SourceError`.
    """
    try:
        yield
    except SourceError as cause:
        raise HandError(str(cause)) from cause
