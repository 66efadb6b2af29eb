"""Hands on topics of ROS by name: `ros2:plexus`, `ros1:efforts`, ..."""

from dataclasses import dataclass

import numpy as np

from holdfast.devices.uri import parse
from holdfast.sensors.types import Array
from holdfast_grip.hands.base import HandDevice
from holdfast_ros.hands import joints
from holdfast_ros.hands.controller_kinds import ControllerKind, WidthKind
from holdfast_ros.hands.joint_hand import JointHand, JointOutput, JointSetup, check_home
from holdfast_ros.hands.joints import (
    N_JOINTS,
    THUMB_FIRST,
    THUMB_LAST,
    ByFinger,
    JointOrder,
    allegro_order,
)
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.hands.scalar_hand import ScalarHand, ScalarSetup
from holdfast_ros.link import Link
from holdfast_ros.topic_messages import FLOAT32, FLOAT64, FLOAT_ARRAY, GRIPPER_COMMAND, JOINT_STATE

COMMON = ("shared",)
"""Parameters of every kind, besides `domain` (ROS 2) or `master` (ROS 1)."""
NETWORKS = {"ros2": "domain", "ros1": "master"}
"""Schemes, and the parameter of each that says where the topics are."""
GRIPPER_TYPES = {"Float64": FLOAT64, "Float32": FLOAT32, "GripperCommand": GRIPPER_COMMAND}
"""Message types of grippers, by the parameter `type`, the default first."""
NO_ACTION = (
    "the grasp action of V4 in ROS 2 takes its envelop effort as a goal, by services, which plain "
    "DDS does not have; use ros2:v4, or call:MODULE:FUNCTION with a function on rclpy"
)


@dataclass(frozen=True)
class JointKind:
    """Driver that takes a command for each joint. None where its value is not known.

    Attributes:
        output: what it takes.
        namespace: of its topics, by default.
        topic: of the commands, in the namespace.
        message: its message type.
        states: topic of the joint states.
        order: fingers in the order of the messages.
        prefix: begin of the names of the joints.
        max_torque: ceiling of the torques [N m].
        stiffness: of its position control [N m/rad].
        home: pose of the open hand [rad].
        home_topic: topic for it, in the namespace; None if it is that of the commands.
        release: ways to open it, the default first.
    """

    output: JointOutput
    namespace: str
    topic: str
    message: str
    states: str
    order: tuple[str, ...]
    prefix: str
    max_torque: ByFinger | None = None
    stiffness: ByFinger | None = None
    home: ByFinger | None = None
    home_topic: str | None = None
    release: tuple[str, ...] = ("home",)

    def make(self, name: str, link: Link, given: Parameters) -> HandDevice:
        """Return the hand of a URI."""
        order = allegro_order(given.fingers(self.order), given.prefix(self.prefix))

        def table(values: ByFinger | None) -> np.ndarray | None:
            return None if values is None else order.values(values)

        namespace = given.topic("namespace", self.namespace)
        positions = self.output is JointOutput.POSITIONS
        # Measured torques would take the ceiling away from joints that carry little now.
        largest = self.output is JointOutput.LARGEST
        torques = None
        if given.has("effort") or largest:
            torques = given.joints("effort", each=not largest)
        # Only the kinds of V4 have known torques.
        is_v4 = self.max_torque is not None
        lowest, highest = joint_limits(given, order, is_v4=is_v4)
        release = given.word("release", self.release)
        setup = JointSetup(
            output=self.output,
            topic=f"{namespace}/{self.topic}",
            message=self.message,
            order=order,
            max_torques=given.positive_joints("max_effort", table(self.max_torque)),
            torques=torques,
            states=given.topic("states", self.states) if positions or torques is None else None,
            stiffness=given.positive_joints("stiffness", table(self.stiffness))
            if positions
            else np.ones(N_JOINTS),
            lowest=lowest,
            highest=highest,
            home=given.joints("home", table(self.home), each=True) if release == "home" else None,
            home_topic=self.home_topic and f"{namespace}/{self.home_topic}",
        )
        check_home(given.text, setup)
        return JointHand(name, link, setup, shared=given.shared)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        stiffness = ("stiffness",) if self.output is JointOutput.POSITIONS else ()
        return ("namespace", "states", "order", "prefix", "effort", "max_effort", *stiffness,
                "lowest", "highest", "release", "home")  # fmt: skip


@dataclass(frozen=True)
class EnvelopKind:
    """Driver of an Allegro hand that takes the torque of its envelop grasp.

    Attributes:
        namespace: of its topics, by default.
        words: namespace of its topic `lib_cmd`; empty if it is that of the others.
    """

    namespace: str
    words: str = ""

    def make(self, name: str, link: Link, given: Parameters) -> HandDevice:
        """Return the hand of a URI."""
        namespace = given.topic("namespace", self.namespace)
        words = given.topic("words", f"{self.words or namespace}/lib_cmd")
        home = given.word("release", ("home", "limp")) == "home"
        setup = ScalarSetup(
            topic=f"{namespace}/envelop_torque",
            message=FLOAT32,
            effort=given.positive("effort"),
            max_effort=given.positive("max_effort"),
            open_value=0.0,
            word_topic=words if home else None,
            fingers=THUMB_FIRST,
        )
        return ScalarHand(name, link, setup, shared=given.shared)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its parameters."""
        return ("namespace", "words", "effort", "max_effort", "release")


class GripperKind:
    """Gripper that takes one number on a topic, or a position and a force (`GripperCommand`)."""

    parameters = ("topic", "type", "effort", "max_effort", "open", "closed")

    def make(self, name: str, link: Link, given: Parameters) -> HandDevice:
        """Return the hand of a URI.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        kind = given.word("type", tuple(GRIPPER_TYPES))
        if kind != "GripperCommand" and given.has("closed"):
            raise ValueError(f"{given.text}: closed= is a position of type=GripperCommand")
        opens_to = given.number("open", None if kind == "GripperCommand" else 0.0)
        closes_to = given.number("closed", 0.0)
        if kind == "GripperCommand" and opens_to == closes_to:
            raise ValueError(
                f"{given.text}: open= another position than closed= expected, {opens_to:g} given"
            )
        setup = ScalarSetup(
            topic=given.topic("topic"),
            message=GRIPPER_TYPES[kind],
            effort=given.positive("effort"),
            max_effort=given.positive("max_effort"),
            open_value=opens_to,
            word_topic=None,
            fingers=None,
            closed=closes_to,
        )
        return ScalarHand(name, link, setup, shared=given.shared)


HandKind = JointKind | EnvelopKind | GripperKind | ControllerKind | WidthKind

HAND_KINDS: dict[str, dict[str, HandKind]] = {
    "ros2": {
        "plexus": JointKind(
            JointOutput.LARGEST, "/allegro_hand_position_effort_controller", "efforts", FLOAT_ARRAY,
            "/joint_states", THUMB_FIRST, "ah_joint", home_topic="commands",
            release=("limp", "home"),
        ),
        "v4": JointKind(
            JointOutput.POSITIONS, "/allegro_hand_position_controller", "commands", FLOAT_ARRAY,
            "/joint_states", THUMB_FIRST, "ah_joint",
            max_torque=joints.V4_MAX_TORQUE, stiffness=joints.ROS2_STIFFNESS, home=joints.V4_HOME,
        ),
        "v5": JointKind(
            JointOutput.POSITIONS, "/allegroHand", "joint_cmd", JOINT_STATE,
            "/allegroHand/joint_states", THUMB_LAST, "joint_",
        ),
        "v5-envelop": EnvelopKind("/allegroHand", "/allegroHand_0"),
        "gripper": GripperKind(),
        "width-gripper": WidthKind(),
        "controller": ControllerKind(),
    },
    "ros1": {
        "positions": JointKind(
            JointOutput.POSITIONS, "/allegroHand", "joint_cmd", JOINT_STATE,
            "/allegroHand/joint_states", THUMB_LAST, "joint_",
            max_torque=joints.V4_MAX_TORQUE, stiffness=joints.ROS1_STIFFNESS, home=joints.V4_HOME,
        ),
        "efforts": JointKind(
            JointOutput.TORQUES, "/allegroHand", "torque_cmd", JOINT_STATE,
            "/allegroHand/joint_states", THUMB_LAST, "joint_",
            max_torque=joints.V4_MAX_TORQUE, release=("limp",),
        ),
        "envelop": EnvelopKind("/allegroHand"),
        "gripper": GripperKind(),
        "width-gripper": WidthKind(),
    },
}  # fmt: skip
"""Hands by scheme and name."""


def ros_hand(uri: str) -> HandDevice:
    """Return the hand of a URI, `ros2:KIND?name=value` or `ros1:KIND?name=value`.

    Raises:
        ValueError: there is no such kind, or a parameter is missing or not valid.
        MissingExtra: DDS is not installed.
    """
    scheme, address = parse(uri)
    kinds = HAND_KINDS[scheme]
    # ROS 1 has this grasp, so its name is answered with the reason and another way.
    if (scheme, address.path) == ("ros2", "v4-envelop"):
        raise ValueError(f"{uri}: {NO_ACTION}")
    kind = None if address.host else kinds.get(address.path)
    if kind is None:
        names = ", ".join(f"{scheme}:{name}" for name in kinds)
        raise ValueError(f"{uri}: there are the hands {names}")
    address.only(NETWORKS[scheme], *COMMON, *kind.parameters)
    where = address.parameters.get(NETWORKS[scheme])
    # Late: of the two, a machine often has the packages of one only.
    if scheme == "ros2":
        from holdfast_ros.dds import Ros2Link

        return kind.make(uri, Ros2Link(where), Parameters(address))
    from holdfast_ros.rospy_node import Ros1Link

    return kind.make(uri, Ros1Link(where), Parameters(address))


def joint_limits(given: Parameters, order: JointOrder, *, is_v4: bool) -> tuple[Array, Array]:
    """Return the lower and upper limits of the joints (16,) [rad].

    Raises:
        ValueError: a lower limit is not below the upper one.
    """
    highest = order.values(joints.V4_HIGHEST if is_v4 else joints.WIDEST)
    lowest = order.values(joints.V4_LOWEST) if is_v4 else -highest
    lowest, highest = given.joints("lowest", lowest), given.joints("highest", highest)
    if not (lowest < highest).all():
        raise ValueError(f"{given.text}: lowest below highest expected for each joint")
    return lowest, highest
