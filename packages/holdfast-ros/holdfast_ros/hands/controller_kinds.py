"""Hands behind the controllers of ros2_control: joints by name, and grippers by width."""

import math

import numpy as np

from holdfast_grip.hands.base import HandDevice
from holdfast_ros.hands.joint_hand import JointHand, JointOutput, JointSetup, check_home
from holdfast_ros.hands.joints import JointOrder
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.hands.scalar_hand import WidthHand, WidthSetup
from holdfast_ros.link import Link
from holdfast_ros.topic_messages import FLOAT64, FLOAT_ARRAY, GRIPPER_COMMAND, JOINT_TRAJECTORY

JOINT_TYPES = {"JointTrajectory": JOINT_TRAJECTORY, "Float64MultiArray": FLOAT_ARRAY}
"""Message types of controllers of several joints, by the parameter `type`, the default first."""
WIDTH_TYPES = {**JOINT_TYPES, "Float64": FLOAT64, "GripperCommand": GRIPPER_COMMAND}
"""Message types of controllers of one joint."""
JOINT_STATES = "/joint_states"
MAX_STROKE = 1.0
"""Longest stroke of a gripper [m]; a longer one is in millimetres."""


class ControllerKind:
    """Controller of several joints: set-points as trajectories or arrays, efforts as arrays."""

    parameters = ("topic", "type", "command", "joints", "states", "effort", "max_effort",
                  "stiffness", "lowest", "highest", "home")  # fmt: skip

    def make(self, name: str, link: Link, given: Parameters) -> HandDevice:
        """Return the hand of a URI.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        order = JointOrder(given.named_joints("joints"))
        n = len(order.names)
        positions = given.word("command", ("positions", "efforts")) == "positions"
        # Check that no parameter of set-points is given for efforts.
        for word in ("stiffness", "lowest", "highest", "home"):
            if not positions and given.has(word):
                raise ValueError(f"{given.text}: {word}= is a parameter of command=positions")
        torques = given.joints("effort", each=True, n=n) if given.has("effort") else None
        lowest, highest = np.full(n, -np.pi), np.full(n, np.pi)
        if positions:
            lowest, highest = (
                given.joints(side, default, n=n)
                for side, default in (("lowest", lowest), ("highest", highest))
            )
        if not (lowest < highest).all():
            raise ValueError(f"{given.text}: lowest below highest expected for each joint")
        types = tuple(JOINT_TYPES) if positions else ("Float64MultiArray",)
        setup = JointSetup(
            output=JointOutput.POSITIONS if positions else JointOutput.TORQUES,
            topic=given.topic("topic"),
            message=JOINT_TYPES[given.word("type", types)],
            order=order,
            max_torques=given.positive_joints("max_effort", n=n),
            torques=torques,
            states=given.topic("states", JOINT_STATES) if positions or torques is None else None,
            stiffness=given.positive_joints("stiffness", n=n) if positions else np.ones(n),
            lowest=lowest,
            highest=highest,
            home=given.joints("home", each=True, n=n) if positions else None,
            home_topic=None,
        )
        check_home(name, setup)
        return JointHand(name, link, setup, shared=given.shared)


class WidthKind:
    """Gripper whose controller takes a width, or the position of the joint that makes it."""

    parameters = ("topic", "type", "joint", "states", "effort", "max_effort", "stiffness", "gain",
                  "open", "closed", "stroke")  # fmt: skip

    def make(self, name: str, link: Link, given: Parameters) -> HandDevice:
        """Return the hand of a URI.

        Raises:
            ValueError: a parameter is missing or not valid.
        """
        opens_to, closes_to = given.number("open"), given.number("closed", 0.0)
        if opens_to == closes_to:
            raise ValueError(
                f"{given.text}: open= another position than closed= expected, {opens_to:g} given"
            )
        stroke = given.positive("stroke", abs(opens_to - closes_to))
        if stroke > MAX_STROKE:
            raise ValueError(
                f"{given.text}: a stroke of at most {MAX_STROKE:g} m expected, {stroke:g} given: "
                "give open= and closed= in metres, or stroke= [m] beside them"
            )
        stiffness = given.positive("stiffness")
        gain = given.positive("gain") if given.has("gain") else math.inf
        if gain < stiffness:
            raise ValueError(
                f"{given.text}: gain: at least the stiffness of {stiffness:g} N/m expected, of "
                f"which it is a part, {gain:g} given"
            )
        setup = WidthSetup(
            topic=given.topic("topic"),
            message=WIDTH_TYPES[given.word("type", tuple(WIDTH_TYPES))],
            joint=given.name("joint"),
            states=given.topic("states", JOINT_STATES),
            effort=given.positive("effort"),
            max_effort=given.positive("max_effort"),
            stiffness=stiffness,
            gain=gain,
            open_position=opens_to,
            closed_position=closes_to,
            stroke=stroke,
        )
        return WidthHand(name, link, setup, shared=given.shared)
