"""The twin behind the topics of a hand, so that a loop closes through the wire."""

from holdfast.devices.sources import Arrival
from holdfast.devices.uri import parse
from holdfast.io.cdr import MessageDecoder
from holdfast_grip.command import FingerCommand, GripCommand, LoopState
from holdfast_grip.errors import HandError
from holdfast_grip.hands.live_twin import LiveTwin
from holdfast_ros import dds
from holdfast_ros.hands.joint_hand import JointHand, JointOutput
from holdfast_ros.hands.joints import JOINTS_PER_FINGER, N_JOINTS
from holdfast_ros.hands.kinds import ros_hand
from holdfast_ros.topic_messages import topic_definition


class DrivenTwin(LiveTwin):
    """Twin that takes its commands on the topic of a Plexus hand, as the driver of that does.

    The mean of a finger's largest torques, over that at the beginning of the grip, is its force
    scale. Zeros open the hand.

    Args:
        uri: as of `LiveTwin`.
        hand: URI of the hand, `ros2:plexus?effort=0.1&max_effort=0.3`; the program that commands
            it has the same `effort`.
        speed: as of `LiveTwin`.

    Attributes:
        topic: topic of the commands.
        n_commands: number of messages that were taken.
        n_refused: number of messages that were not valid.

    Raises:
        ValueError: one of the URIs is not valid, or the hand is another one.
    """

    def __init__(self, uri: str, hand: str, *, speed: float = 1.0) -> None:
        super().__init__(uri, speed=speed)
        driven = ros_hand(hand) if hand.startswith("ros2:") else None
        if not isinstance(driven, JointHand) or driven.setup.output is not JointOutput.LARGEST:
            raise ValueError(f"ros2:plexus?effort=0.1&max_effort=0.3 expected, {hand} given")
        self._setup = driven.setup
        self.topic = driven.setup.topic
        self._domain = dds.domain_number(parse(hand)[1].parameters.get("domain"))
        definition = topic_definition(driven.setup.message)
        self._definition, self._decode = definition, MessageDecoder(definition, ros2=True)
        self._reader: dds.TopicReader | None = None
        self.n_commands = self.n_refused = 0

    def open(self) -> None:
        """Begin the grasp, and subscribe.

        Raises:
            SourceError: DDS reports an error.
        """
        super().open()
        self._reader = dds.Node(self._domain).reader(self.topic, self._definition)

    def read(self, timeout: float) -> Arrival | None:
        """Simulate the next sample with the newest command, and return it when it is due."""
        found = [] if self._reader is None else self._reader.take(0.0)
        if found:  # the newest alone: a driver keeps its last command
            self.n_commands += 1
            try:
                values, torques = self._decode(found[-1])["data"], self._setup.torques
                if len(values) != N_JOINTS or torques is None:
                    raise ValueError(f"{N_JOINTS} values expected, {len(values)} given")
                # The mean of the largest torques of a finger, over that when the grip began.
                shape = (-1, JOINTS_PER_FINGER)
                scales = values.reshape(shape).mean(axis=1) / torques.reshape(shape).mean(axis=1)
                fingers = {
                    finger: FingerCommand(float(scale))
                    for finger, scale in zip(self._setup.order.fingers, scales, strict=True)
                }
                release = not values.any()  # zeros open the hand
                self.send(GripCommand(0.0, LoopState.HOLD, fingers, release=release))
            except (ValueError, HandError):
                self.n_refused += 1
        return super().read(timeout)

    def close(self) -> None:
        """End the grasp and the subscription."""
        self._reader = None
        super().close()
