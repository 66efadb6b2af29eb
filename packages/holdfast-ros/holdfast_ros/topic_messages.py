"""ROS messages that holdfast publishes, of hands and of estimates: their definitions in ROS 2."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from holdfast.io.definitions import ROS2_HEADER, SEPARATOR, Definition, parse_definition
from holdfast.sensors.types import Array

FLOAT32, FLOAT64, STRING = "std_msgs/Float32", "std_msgs/Float64", "std_msgs/String"
FLOAT_ARRAY, JOINT_STATE = "std_msgs/Float64MultiArray", "sensor_msgs/JointState"
GRIPPER_COMMAND = "control_msgs/GripperCommand"
JOINT_TRAJECTORY = "trajectory_msgs/JointTrajectory"
"""Message types of the topics of hands."""
VECTOR, WRENCH = "geometry_msgs/Vector3Stamped", "geometry_msgs/WrenchStamped"
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
"""Message types of the topics of estimates, besides `STRING` and `FLOAT64`."""

TRAJECTORY_TIME = 0.02
"""Time in which a trajectory reaches its only point: two periods of a controller at 100 Hz [s]."""

_VECTOR3 = SEPARATOR + "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
_DEFINITIONS = {
    FLOAT32: "float32 data",
    FLOAT64: "float64 data",
    STRING: "string data",
    GRIPPER_COMMAND: "float64 position\nfloat64 max_effort",
    FLOAT_ARRAY: (
        "MultiArrayLayout layout\nfloat64[] data"
        + SEPARATOR
        + "std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset"
        + SEPARATOR
        + "std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride"
    ),
    JOINT_STATE: (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort" + ROS2_HEADER
    ),
    JOINT_TRAJECTORY: (
        "std_msgs/Header header\nstring[] joint_names\nJointTrajectoryPoint[] points"
        + ROS2_HEADER
        + SEPARATOR
        + "trajectory_msgs/JointTrajectoryPoint\nfloat64[] positions\nfloat64[] velocities\n"
        + "float64[] accelerations\nfloat64[] effort\n"
        + "builtin_interfaces/Duration time_from_start"
        + SEPARATOR
        + "builtin_interfaces/Duration\nint32 sec\nuint32 nanosec"
    ),
    VECTOR: "std_msgs/Header header\nVector3 vector" + ROS2_HEADER + _VECTOR3,
    WRENCH: (
        "std_msgs/Header header\nWrench wrench"
        + ROS2_HEADER
        + SEPARATOR
        + "geometry_msgs/Wrench\nVector3 force\nVector3 torque"
        + _VECTOR3
    ),
    DIAGNOSTICS: (
        "std_msgs/Header header\nDiagnosticStatus[] status"
        + ROS2_HEADER
        + SEPARATOR
        + "diagnostic_msgs/DiagnosticStatus\nbyte level\nstring name\nstring message\n"
        + "string hardware_id\nKeyValue[] values"
        + SEPARATOR
        + "diagnostic_msgs/KeyValue\nstring key\nstring value"
    ),
}
MESSAGE_TYPES = tuple(_DEFINITIONS)
"""Message types whose definition in ROS 2 is known here."""


def topic_definition(kind: str) -> Definition:
    """Return the definition in ROS 2 of one of `MESSAGE_TYPES`."""
    return parse_definition(kind, _DEFINITIONS[kind])


class JointStates(NamedTuple):
    """State of the joints of a robot at one instant.

    Attributes:
        names: names of the joints; empty if the publisher gives none.
        positions: angles [rad].
        efforts: torques [N m]; empty if the publisher gives none.
    """

    names: tuple[str, ...]
    positions: Array
    efforts: Array

    @classmethod
    def of_message(cls, names: Sequence[str], position: Any, effort: Any) -> "JointStates":  # noqa: ANN401
        """Return the state of the fields of a message."""
        return cls(tuple(names), np.asarray(position, float), np.asarray(effort, float))


def number_message(value: float) -> dict[str, Any]:
    """Return a message of one number."""
    return {"data": float(value)}


def gripper_message(position: float, max_effort: float) -> dict[str, Any]:
    """Return a `control_msgs/GripperCommand`: where to close to [m], and with which force [N]."""
    return {"position": float(position), "max_effort": float(max_effort)}


def array_message(values: Array) -> dict[str, Any]:
    """Return a `std_msgs/Float64MultiArray` without a layout, as controllers expect it."""
    return {"layout": {"dim": [], "data_offset": 0}, "data": values}


def joint_message(
    time: float,
    names: Sequence[str],
    *,
    positions: Array | None = None,
    efforts: Array | None = None,
) -> dict[str, Any]:
    """Return a `sensor_msgs/JointState`.

    Args:
        time: time of the sample on which the command rests [s]; negative and NaN are not set.
        names: names of the joints.
        positions: set-points [rad], if there are any.
        efforts: torques [N m], if there are any.
    """
    empty = np.empty(0)
    return {
        "header": header(time),
        "name": list(names),
        "position": empty if positions is None else positions,
        "velocity": empty,
        "effort": empty if efforts is None else efforts,
    }


def trajectory_message(names: Sequence[str], positions: Array) -> dict[str, Any]:
    """Return a `trajectory_msgs/JointTrajectory` of one point, which begins at once.

    A controller refuses a trajectory whose stamp is over, so none is set.

    Args:
        names: names of the joints.
        positions: set-points [rad or m].
    """
    empty = np.empty(0)
    point = {
        "positions": positions,
        "velocities": empty,
        "accelerations": empty,
        "effort": empty,
        "time_from_start": {"sec": 0, "nanosec": round(TRAJECTORY_TIME * 1e9)},
    }
    return {"header": header(math.nan), "joint_names": list(names), "points": [point]}


def header(time: float, frame: str = "") -> dict[str, Any]:
    """Return a header with a time [s], which is not set if it is negative or NaN."""
    # The field has 31 bits; NaN is in no order with a number.
    seconds = int(time) if 0.0 <= time < 2.0**31 else 0
    nanoseconds = int((time - seconds) * 1e9) if 0.0 <= time < 2.0**31 else 0
    return {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": frame}
