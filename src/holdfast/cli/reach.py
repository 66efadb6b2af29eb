"""What of the live sources can be reached from this machine, without disturbing anything."""

import os
import socket
from contextlib import suppress
from importlib.util import find_spec

KNOCK = 0.3
"""How long a server has to answer [s]."""


def reachable() -> dict[str, str]:
    """How each kind of live source stands, in a few words."""
    return {"xela": _xela(), "ros1": _ros1(), "ros2": _ros2(), "serial": _serial()}


def _xela() -> str:
    from holdfast.sources.uri import parse
    from holdfast.sources.xela.places import places

    tried = places(parse("xela://auto")[1])
    for place in tried:
        with suppress(OSError), socket.create_connection(place, KNOCK):
            return f"something listens at {place}"
    return f"nothing listens at {' or '.join(map(str, tried))}"


def _ros1() -> str:
    from holdfast.errors import HoldfastError
    from holdfast.ros.rospy_node import check_master, master_uri, rospy_module

    try:
        rospy_module()
        check_master(master := master_uri(None))
    except (HoldfastError, ValueError) as missing:  # a ValueError: ROS_MASTER_URI is none
        return str(missing)
    return f"rospy, and a master at {master}"


def _ros2() -> str:
    if find_spec("cyclonedds") is None:
        return 'not installed: pip install "holdfast[ros2]"'
    return f"cyclonedds, domain {os.environ.get('ROS_DOMAIN_ID', '0')}"


def _serial() -> str:
    if find_spec("serial") is None:
        return 'not installed: pip install "holdfast[serial]"'
    from serial.tools.list_ports import comports

    return ", ".join(port.device for port in comports()) or "no port"
