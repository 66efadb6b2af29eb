"""Hands on topics of ROS 2 by name: `ros2:plexus`, `ros2:gripper`, ..., the rows of hands.toml."""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

from holdfast.devices.uri import parse
from holdfast_ros.dds import Link
from holdfast_ros.hands.joint_hand import JointHand
from holdfast_ros.hands.parameters import Parameters
from holdfast_ros.hands.ros_hand import RosHand
from holdfast_ros.hands.scalar_hand import ScalarHand

DRIVERS = {"joints": JointHand, "scalar": ScalarHand}
"""Drivers by the word in a row."""


@cache
def hand_rows() -> Mapping[str, Mapping[str, Any]]:
    """Return the rows of the table by the name of the hand; the head of the table explains them."""
    table = resources.files("holdfast_ros.hands").joinpath("hands.toml")
    return tomllib.loads(table.read_text("utf-8"))


def ros_hand(uri: str) -> RosHand:
    """Return the hand of a URI, `ros2:NAME?name=value`.

    Raises:
        ValueError: there is no such hand, or a parameter is missing or not valid.
    """
    _, address = parse(uri)
    rows = hand_rows()
    row = None if address.host else rows.get(address.path)
    if row is None:
        names = ", ".join(f"ros2:{name}" for name in rows)
        raise ValueError(f"{uri}: there are the hands {names}")
    link = Link(address.parameters.get("domain"))
    return DRIVERS[row["driver"]](link, Parameters(address, row))
