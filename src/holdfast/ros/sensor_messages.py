"""Messages of tactile sensors in ROS: their definitions, and the readings in them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.ros.cdr import MessageDecoder
from holdfast.ros.definitions import (
    ROS1_HEADER,
    ROS2_HEADER,
    SEPARATOR,
    Definition,
    field_paths,
    parse_definition,
    short_name,
)
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array, Unit
from holdfast.sensors.xela_models import module_sensors

SENS_STREAM = (
    "SensorFull[] sensors\n"
    + SEPARATOR
    + "xela_server_ros/SensorFull\n"
    + "uint32 message\nfloat64 time\nstring model\nuint8 sensor_pos\n"
    + "Taxel[] taxels\nForces[] forces\n"
    + SEPARATOR
    + "xela_server_ros/Taxel\nuint16 x\nuint16 y\nuint16 z\n"
    + SEPARATOR
    + "xela_server_ros/Forces\nfloat32 x\nfloat32 y\nfloat32 z\n"
)
"""XELA's, since 2021; in ROS 2 the package is called xela_server_ros2."""

_SENSOR_STATE = (
    "std_msgs/Header header\nint64 tus\nPillarState[] pillars\n"
    "float32 gfX\nfloat32 gfY\nfloat32 gfZ\nfloat32 gtX\nfloat32 gtY\nfloat32 gtZ\n"
    "float32 friction_est\nfloat32 target_grip_force\n"
    "bool is_sd_active\nbool is_ref_loaded\nbool is_contact\n"
    + SEPARATOR
    + "PACKAGE/PillarState\nstd_msgs/Header header\nint32 id\n"
    + "float32 dX\nfloat32 dY\nfloat32 dZ\nfloat32 fX\nfloat32 fY\nfloat32 fZ\n"
    + "bool in_contact\nint32 slip_state\n"
)

_PILLARS = ("papillarray_ros_v2/SensorState", "sensor_interfaces/SensorState")


class DeviceSample(NamedTuple):
    """What one device says in a message.

    Attributes:
        number: the device numbers it so, from 1; None where it has no number.
        model: as it is called; empty where it has no name.
        time: on the clock of the device [s], or None.
        stamp: in the header, when ROS got it [s], or None.
        sequence: number of the packet, or None.
        counts: (n_taxels, 3) [count]; None where it sends newtons only.
        forces: (n_taxels, 3) [N]; of no taxels where it is not calibrated.
    """

    number: int | None
    model: str
    time: float | None
    stamp: float | None
    sequence: int | None
    counts: npt.NDArray[Any] | None
    forces: Array


_NO_FORCES = np.empty((0, 3))
PAPILLARRAY = "papillarray"
"""What we call Contactile's sensor, which sends no name."""


def known_definition(name: str, *, ros2: bool) -> Definition | None:
    """The definition of a message that is sent without one, if its type is known.

    Example:
        >>> known_definition("xela_server_ros2/msg/SensStream", ros2=True).fields[0].name
        'sensors'
    """
    short = short_name(name)
    package, _, kind = short.partition("/")
    if kind == "SensStream" and package in ("xela_server_ros", "xela_server_ros2"):
        return parse_definition(short, SENS_STREAM.replace("xela_server_ros/", f"{package}/"))
    if short in _PILLARS:
        text = _SENSOR_STATE.replace("PACKAGE", package)
        return parse_definition(short, text + (ROS2_HEADER if ros2 else ROS1_HEADER))
    return None


class SampleDecoder:
    """Takes what devices say out of messages of one type.

    Args:
        definition: of the messages.
        ros2: they are as ROS 2 sends them, not ROS 1.

    Raises:
        ValueError: nobody knows how to find readings in them.
    """

    def __init__(self, definition: Definition, *, ros2: bool) -> None:
        self._take = _taker(definition)
        self._decode = MessageDecoder(definition, ros2=ros2)
        self._name = definition.name

    def __call__(self, data: bytes) -> list[DeviceSample]:
        """What each device says in a message.

        Raises:
            ValueError: these bytes are no such message.
        """
        return self._take(self._decode(data))


SUPPORTED_MESSAGES = (
    "xela_server_ros/SensStream, xela_server_ros2/SensStream, XStream, xServerMsg, "
    "XelaServerMsg, SensorState"
)
"""Messages that readings can be taken from, for people."""


def _taker(definition: Definition) -> Callable[[Mapping[str, Any]], list[DeviceSample]]:
    """By the fields of the messages: packages change their names, and older ones differ."""
    paths = field_paths(definition)
    for needed, take in _TAKERS:
        if needed <= paths:
            return take
    raise ValueError(
        f"{definition.name} is of no kind that holdfast knows; there are {SUPPORTED_MESSAGES}"
    )


def _each(before: str, kind: str, names: str = "xyz") -> set[str]:
    return {f"{before}{name} {kind}" for name in names}


def _of_sens_stream(message: Mapping[str, Any]) -> list[DeviceSample]:
    return [
        DeviceSample(
            one["sensor_pos"],
            one["model"],
            one["time"] if np.isfinite(one["time"]) and one["time"] > 0 else None,
            None,
            one["message"],
            _counts(_points(one["taxels"])),
            _points(one["forces"]).astype(np.float64),
        )
        for one in message["sensors"]
    ]


def _of_x_stream(message: Mapping[str, Any]) -> list[DeviceSample]:
    return [
        DeviceSample(one["sensor"], "", None, None, None, _counts(_points(one["xyz"])), _NO_FORCES)
        for one in message["data"]
    ]


def _of_x_server(message: Mapping[str, Any]) -> list[DeviceSample]:
    counts = _counts(_points([one["point"] for one in message["points"]]))
    number, model = message["sensor"], message["model"]
    stamp = _seconds(message["header"]["stamp"])
    return [DeviceSample(number, model, None, stamp, None, counts, _NO_FORCES)]


def _of_pillars(message: Mapping[str, Any]) -> list[DeviceSample]:
    forces = _points(message["pillars"], ("fX", "fY", "fZ"))
    time = message["tus"] * 1e-6 if message["tus"] > 0 else None
    stamp = _seconds(message["header"]["stamp"])
    return [DeviceSample(None, PAPILLARRAY, time, stamp, None, None, forces)]


_TAKERS: tuple[tuple[set[str], Callable[[Mapping[str, Any]], list[DeviceSample]]], ...] = (
    (
        {
            "sensors[].message uint32",
            "sensors[].time float64",
            "sensors[].model string",
            "sensors[].sensor_pos uint8",
        }
        | _each("sensors[].taxels[].", "uint16")
        | _each("sensors[].forces[].", "float32"),
        _of_sens_stream,
    ),
    ({"data[].sensor int16"} | _each("data[].xyz[].", "uint32"), _of_x_stream),
    (
        {"sensor int16", "model string", "header.frame_id string"}
        | _each("points[].point.", "float64"),
        _of_x_server,
    ),
    (
        {"tus int64", "header.frame_id string"} | _each("pillars[].f", "float32", "XYZ"),
        _of_pillars,
    ),
)


def _points(
    given: npt.NDArray[Any] | list[dict[str, Any]], names: Sequence[str] = "xyz"
) -> npt.NDArray[Any]:
    """(n, 3) of points that came as an array, or one by one."""
    if isinstance(given, np.ndarray):
        return given
    rows = [[one[name] for name in names] for one in given]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _counts(values: npt.NDArray[Any]) -> npt.NDArray[np.uint16]:
    """Counts that came as wider numbers.

    Raises:
        ValueError: one is no count of 16 bits.
    """
    if values.dtype == np.uint16:
        return values
    with np.errstate(invalid="ignore"):
        counts = values.astype(np.uint16)
    if (counts != values).any():
        raise ValueError("a reading is no whole number from 0 to 65535")
    return counts


def _seconds(stamp: Mapping[str, int]) -> float | None:
    """A stamp of ROS 1 or ROS 2 [s]; None where nobody set it."""
    whole, nanoseconds = stamp.values()
    return whole + nanoseconds * 1e-9 if whole or nanoseconds else None


def sensors_of(message: DeviceSample, unit: Unit) -> dict[str, Sensor]:
    """Sensors of a device by module, as `module_sensors`.

    Raises:
        ValueError: it has another number of taxels than its model.
    """
    readings = readings_of(message, unit)
    if message.counts is None:
        pillars = sensor(PAPILLARRAY)
        if len(readings) != pillars.n_taxels:
            raise ValueError(
                f"{len(readings)} taxels given, {pillars.n_taxels} expected ({PAPILLARRAY})"
            )
        return {"": pillars}
    sensors = module_sensors(message.model, len(readings))
    if unit == "count":
        return sensors
    return {name: replace(one, unit=unit, limits=None) for name, one in sensors.items()}


def readings_of(message: DeviceSample, unit: Unit) -> npt.NDArray[Any]:
    """(n_taxels, 3) of a message: counts, or newtons where they are wanted or all there is."""
    return message.forces if unit == "N" or message.counts is None else message.counts


def module_name(finger: str, part: str, *, named: bool) -> str:
    """What a module is called: of a hand by its part, else as the finger.

    Args:
        finger: of the device.
        part: of a hand, or empty.
        named: somebody called the device so: its name comes before the part.

    Example:
        >>> [module_name("left", "thumb", named=True), module_name("finger1", "", named=False)]
        ['left/thumb', 'finger1']
    """
    if not part:
        return finger
    return f"{finger}/{part}" if named else part
