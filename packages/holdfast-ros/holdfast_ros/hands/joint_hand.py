"""Hands that take a command for each joint: torques, largest torques or set-points."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, Self

import numpy as np

from holdfast.sensors.types import Array
from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.limits import SLACK, Limits
from holdfast_ros.dds import Link
from holdfast_ros.hands.joints import JointOrder
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.hands.ros_hand import RosHand
from holdfast_ros.topic_messages import (
    JOINT_STATE,
    JOINT_TRAJECTORY,
    JointStates,
    array_message,
    joint_message,
    trajectory_message,
)

LIMIT_TOLERANCE = 0.1
"""Angle by which a reading may be beyond the limits of its joint [rad]: hands are calibrated by
eye, and their stops yield."""
WIDEST = float(np.pi)
"""Limit of joints whose limits are not known, to both sides of 0 [rad]: a reading that is wrong by
a whole turn is always beyond it."""
PARAMETERS = (
    "topic", "type", "command", "joints", "states", "effort", "max_effort", "lowest", "highest",
    "release",
)  # fmt: skip
"""Names of the parameters that a hand takes in any case."""


class JointOutput(StrEnum):
    """Quantity that a driver takes for each joint.

    EFFORTS: the torque. LARGEST: the largest torque of its position control. POSITIONS: the
    set-point of its position control.
    """

    EFFORTS = "efforts"
    LARGEST = "largest"
    POSITIONS = "positions"


@dataclass(frozen=True, eq=False)
class JointSetup:
    """Description of a hand that takes a command for each joint; arrays are (n_joints,).

    Attributes:
        output: what the driver takes.
        topic: topic of the commands.
        message: its message type.
        order: order and names of the joints in the messages.
        max_torques: ceiling of the torque of each joint [N m].
        torques: torques when the grip begins [N m]; None to take those of the joint states.
        states: topic of the joint states; None if they are not needed.
        stiffness: torque of the position control for each radian of error [N m/rad].
        lowest: lower limits of the joints, of readings and of set-points [rad].
        highest: upper limits of the joints [rad].
        home: pose of the open hand [rad]; None to open without torque.
        home_topic: topic for this pose.
    """

    output: JointOutput
    topic: str
    message: str
    order: JointOrder
    max_torques: Array
    torques: Array | None
    states: str | None
    stiffness: Array
    lowest: Array
    highest: Array
    home: Array | None
    home_topic: str

    @property
    def topics(self) -> dict[str, str]:
        """Message type of each topic that is published, that of the commands first."""
        return {self.topic: self.message, self.home_topic: self.message}

    @classmethod
    def of(cls, parameters: Parameters) -> Self:
        """Return the description that the URI of a hand gives.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        order, output = parameters.joint_order(), JointOutput(parameters.word("command"))
        positions = output is JointOutput.POSITIONS
        # Measured torques would take the ceiling away from joints that carry little now.
        largest = output is JointOutput.LARGEST
        # A trajectory has set-points only.
        types = [kind for kind in parameters.row["type"] if positions or kind != "JointTrajectory"]
        release = parameters.word("release", ("limp",) if output is JointOutput.EFFORTS else ())
        used = {"stiffness": positions, "home": release == "home", "home_topic": release == "home"}
        parameters.only(*PARAMETERS, *(name for name in used if used[name]))
        torques = None
        if parameters.has("effort") or largest:
            torques = parameters.joints("effort", order, per_joint=not largest)
        n = len(order.names)
        lowest = parameters.joints("lowest", order, np.full(n, -WIDEST))
        highest = parameters.joints("highest", order, np.full(n, WIDEST))
        if not (lowest < highest).all():
            raise ValueError(f"{parameters.text}: lowest below highest expected for each joint")
        topic = parameters.topic("topic")
        home, home_topic = None, topic
        if release == "home":
            home = parameters.joints("home", order, per_joint=True)
            home_topic = parameters.topic("home_topic", topic)
            beyond = np.maximum(lowest - home, home - highest)
            # Degrees, or angles in another order of the joints.
            if beyond[worst := int(np.argmax(beyond))] > 0.0:
                raise ValueError(
                    f"{parameters.text}: home: {order.describe(worst)}: {lowest[worst]:g} to "
                    f"{highest[worst]:g} rad expected, {home[worst]:g} given"
                )
        return cls(
            output=output,
            topic=topic,
            message=parameters.message(types),
            order=order,
            max_torques=parameters.positive_joints("max_effort", order),
            torques=torques,
            states=parameters.topic("states") if positions or torques is None else None,
            stiffness=parameters.positive_joints("stiffness", order) if positions else np.ones(n),
            lowest=lowest,
            highest=highest,
            home=home,
            home_topic=home_topic,
        )


class JointGrip(NamedTuple):
    """Pose and torques of a hand when the grip began, in the order of its messages.

    Attributes:
        positions: angles (n_joints,) [rad]; NaN if they are not measured.
        torques: torques (n_joints,) [N m].
    """

    positions: Array
    torques: Array


class JointHand(RosHand):
    """Hand that takes a command for each joint.

    Force and torque are proportional in a given pose, so the torque of each joint when the grip
    began is multiplied by the scale of its finger. Set-points follow from torques by the
    stiffness k of the position control: q = q_begin + scale * torque_begin / k. q_begin and
    torque_begin are medians over the joint states of the last 0.2 s.

    Args:
        link: connection to ROS.
        given: parameters of its URI.

    Attributes:
        setup: description of the hand.
    """

    def __init__(self, link: Link, parameters: Parameters) -> None:
        self.setup = setup = JointSetup.of(parameters)
        super().__init__(link, parameters, setup.topics, setup.states)
        self.fingers = setup.order.fingers
        self._max_scale = 1.0
        self._grip: JointGrip | None = None

    def check(self, limits: Limits, fingers: Iterable[str]) -> None:
        """Check the fingers, and the given torques at the highest scale.

        Raises:
            ValueError: the hand lacks a finger, or a torque exceeds its ceiling.
        """
        super().check(limits, fingers)
        self._max_scale = limits.max_scale
        torques = self.setup.torques
        if torques is None:
            return
        if problem := self._excess(limits.max_scale * torques):
            raise ValueError(f"{problem} at max_scale {limits.max_scale:g}: lower one of them")
        if problem := self._reach(limits.max_scale * torques):
            raise ValueError(problem)

    def _begin(self) -> None:
        setup_torques = self.setup.torques
        n = len(self.setup.order.names)
        states = [joint_state for _, joint_state in self._states]
        # NaN without joint states, and no torques where a state has none.
        positions, torques = (
            np.full(n, np.nan),
            np.zeros(n) if setup_torques is None else setup_torques,
        )
        if states:
            positions = np.median([state.positions for state in states], axis=0)
            efforts = [state.efforts for state in states if len(state.efforts)]
            # A median of some of the states would be of another time than the positions.
            if setup_torques is None and len(efforts) == len(states):
                torques = np.median(efforts, axis=0)
        if not torques.any():
            raise HandError(
                f"{self.name}: the joint states of {self.setup.states} have no efforts, so the "
                "torques at the beginning of the grip are not known: give effort="
            )
        if problem := self._excess(self._max_scale * torques):
            raise HandError(
                f"{problem} at max_scale {self._max_scale:g}: lower it, or grip more gently"
            )
        if problem := self._reach(self._max_scale * torques):
            raise HandError(problem)
        self._grip = JointGrip(positions, torques)

    def _checked(self, states: JointStates) -> JointStates:
        """Return joint states in the order of the hand.

        Raises:
            ValueError: a joint is missing, a value is not finite, or a joint is beyond its limits.
        """
        setup = self.setup
        ordered = setup.order.sort(states)
        below, above = setup.lowest - ordered.positions, ordered.positions - setup.highest
        beyond = np.maximum(below, above)
        worst = int(np.argmax(beyond))
        if beyond[worst] > LIMIT_TOLERANCE:
            raise ValueError(
                f"{setup.order.describe(worst)} at {ordered.positions[worst]:g} rad, "
                f"{setup.lowest[worst]:g} to {setup.highest[worst]:g} expected"
            )
        return ordered

    def _press(self, command: GripCommand) -> None:
        if self._grip is None:
            return
        torques = self.setup.order.scales(command) * self._grip.torques
        if problem := self._excess(torques):
            raise HandError(problem)
        setup, time = self.setup, command.time
        if setup.output is JointOutput.EFFORTS:
            message = self._values(time, efforts=torques)
        elif setup.output is JointOutput.LARGEST:
            # A limit has no sign; the position control of the driver gives it.
            message = self._values(time, efforts=np.abs(torques))
        else:
            targets = self._grip.positions + torques / setup.stiffness
            message = self._values(time, positions=np.clip(targets, setup.lowest, setup.highest))
        self._publish(setup.topic, message)

    def _release(self) -> None:
        setup = self.setup
        if setup.home is None:
            message = self._values(0.0, efforts=np.zeros(len(setup.order.names)))
            self._publish(setup.topic, message)
        else:
            message = self._values(0.0, positions=setup.home)
            self._publish(setup.home_topic, message)

    def _values(
        self, time: float, *, positions: Array | None = None, efforts: Array | None = None
    ) -> Mapping[str, Any]:
        names = self.setup.order.names
        if self.setup.message == JOINT_STATE:
            return joint_message(time, names, positions=positions, efforts=efforts)
        if self.setup.message == JOINT_TRAJECTORY and positions is not None:
            return trajectory_message(names, positions)
        values = positions if efforts is None else efforts
        return array_message(np.empty(0) if values is None else values)

    def _excess(self, torques: Array) -> str:
        """Return a message about the torque that exceeds its ceiling most; empty if none does."""
        setup = self.setup
        ratio = np.abs(torques) / setup.max_torques
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0 + SLACK:
            return ""
        return (
            f"{self.name}: {setup.order.describe(worst)}: at most {setup.max_torques[worst]:g} N m "
            f"expected, {abs(torques[worst]):g} N m given"
        )

    def _reach(self, torques: Array) -> str:
        """Return a message about a set-point further away than its joint moves; else empty.

        No joint can need it, so the stiffness has another unit, or is that of another hand.
        """
        setup = self.setup
        if setup.output is not JointOutput.POSITIONS:
            return ""
        distance, longest = np.abs(torques) / setup.stiffness, setup.highest - setup.lowest
        worst = int(np.argmax(distance / longest))
        if distance[worst] <= longest[worst]:
            return ""
        return (
            f"{self.name}: {setup.order.describe(worst)}: a set-point at most {longest[worst]:g} "
            f"rad from the joint expected, {distance[worst]:.3g} rad given at max_scale "
            f"{self._max_scale:g}: check stiffness= [N m/rad]"
        )
