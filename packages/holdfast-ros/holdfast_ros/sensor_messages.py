"""Messages of tactile sensors in ROS: their definitions, and how to get readings from them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import prod
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.io.cdr import MessageDecoder
from holdfast.io.definitions import (
    ROS2_HEADER,
    SEPARATOR,
    Definition,
    field_paths,
    parse_definition,
    short_name,
)
from holdfast.sensors import Sensor, sensor
from holdfast.sensors.types import Array, Unit
from holdfast.sensors.xela_models import flat_grid, module_sensors

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
"""Definition of XELA's messages since 2021. In ROS 2 the package is xela_server_ros2."""

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

_SENSOR_STATE_OF_ROS2 = (
    "int64 tus\nPillarState[] pillars\n"
    "float32 gfx\nfloat32 gfy\nfloat32 gfz\nfloat32 gtx\nfloat32 gty\nfloat32 gtz\n"
    "float32 friction_est\nfloat32 target_grip_force\n"
    "bool is_sd_active\nbool is_ref_loaded\nbool is_contact\n"
    + SEPARATOR
    + "PACKAGE/PillarState\nint32 id\n"
    + "float32 dx\nfloat32 dy\nfloat32 dz\nfloat32 fx\nfloat32 fy\nfloat32 fz\n"
    + "bool in_contact\nint32 slip_state\n"
)

_GEOMETRY = (
    ROS2_HEADER
    + SEPARATOR
    + "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    + SEPARATOR
    + "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
)
"""Types that definitions of pads refer to."""
_PADS = {
    "paxini_hardware/TactileSensor": (
        "std_msgs/Header header\ngeometry_msgs/Vector3 resultant_force\nTactileTaxel[] taxels\n"
        + SEPARATOR
        + "paxini_hardware/TactileTaxel\nuint32 index\ngeometry_msgs/Point position\n"
        + "geometry_msgs/Vector3 normal\ngeometry_msgs/Vector3 force\n"
    ),
    "paxini_pkg/SensingData": "std_msgs/Header header\nint32[] shape\nfloat32[] data\n",
}
"""Definitions of two public drivers of PaXini's pads, github.com/adnan-saood/paxini_ros2 and
github.com/WQisaBG/paxini_ros2. Messages of other packages with these fields are read alike."""

_NO_FORCES = np.empty((0, 3))
_PILLARS = ("papillarray_ros_v2/SensorState", "sensor_interfaces/SensorState")


class DeviceSample(NamedTuple):
    """One sample of one device, from a message.

    Attributes:
        number: number of the device, from 1; None if it has none.
        model: model name of the device; empty if it has none.
        time: time on the clock of the device [s], or None.
        stamp: time in the header, when ROS received the sample [s], or None.
        sequence: number of the packet, or None.
        counts: (n_taxels, 3) [count]; None if the device sends newtons only.
        forces: (n_taxels, 3) [N]; (0, 3) if the device is not calibrated.
    """

    number: int | None
    model: str
    time: float | None
    stamp: float | None
    sequence: int | None
    counts: npt.NDArray[Any] | None
    forces: Array


MAX_MESSAGE_SIZE = 1 << 20
"""Maximum size of a message of a device; one of a whole hand with all fields has 20 kB [bytes]."""
PAPILLARRAY = "papillarray"
"""Name of Contactile's sensor, which sends no model name."""
PAD = "pad"
"""Model of pads whose messages say nothing about their maker."""
PAD_FORCES = "force of taxels[] is read [N]; index, position and normal are no readings"
PAD_DATA = "data is read in the shape of shape[], as counts"


def known_definition(name: str) -> Definition | None:
    """Return the definition in ROS 2 of a type of tactile messages, or None for any other type.

    Example:
        >>> known_definition("xela_server_ros2/msg/SensStream").fields[0].name
        'sensors'
    """
    short = short_name(name)
    package, _, kind = short.partition("/")
    if kind == "SensStream" and package in ("xela_server_ros", "xela_server_ros2"):
        return parse_definition(short, SENS_STREAM.replace("xela_server_ros/", f"{package}/"))
    if short in _PILLARS:
        text = _SENSOR_STATE.replace("PACKAGE", package)
        return parse_definition(short, text + ROS2_HEADER)
    return own_definition(short, _PADS[short]) if short in _PADS else None


def own_definition(name: str, text: str) -> Definition:
    """Return the definition in ROS 2 of a message type; headers and vectors may be left out.

    Raises:
        ValueError: a line is not a field, or a type is not defined.
    """
    return parse_definition(short_name(name), text + _GEOMETRY)


class SampleDecoder:
    """Decoder of messages of one type into the samples in them.

    Args:
        definition: definition of the messages.
        ros2: whether messages are encoded as in ROS 2; otherwise as in ROS 1.

    Attributes:
        note: which fields are read, where a message has several that may be readings.

    Raises:
        ValueError: the messages are not of a supported type.
    """

    def __init__(self, definition: Definition, *, ros2: bool) -> None:
        layouts, short = [definition], short_name(definition.name)
        # Packages of one name differ: the maker's messages have no headers, and bags and topics of
        # ROS 2 may have no definition that says so.
        if ros2 and short in _PILLARS:
            text = _SENSOR_STATE_OF_ROS2.replace("PACKAGE", short.partition("/")[0])
            layouts.append(parse_definition(short, text))
        self._layouts = []
        self.note = ""
        for layout in layouts:
            # By the fields of the messages: packages differ in the names of types.
            paths = field_paths(layout)
            convert = next((convert for needed, convert in _CONVERTERS if needed <= paths), None)
            if convert is None:
                raise ValueError(
                    f"{layout.name} is not supported; supported are {SUPPORTED_MESSAGES}"
                )
            self.note = _NOTES.get(convert, "")
            self._layouts.append((convert, MessageDecoder(layout, ros2=ros2)))

    def __call__(self, data: bytes) -> list[DeviceSample]:
        """Return the sample of each device in a message.

        Raises:
            ValueError: the bytes are not a message of this type, or too many.
        """
        if len(data) > MAX_MESSAGE_SIZE:
            raise ValueError(
                f"a message of at most {MAX_MESSAGE_SIZE} bytes expected, {len(data)} given"
            )
        problems: list[ValueError] = []
        for layout in self._layouts:
            convert, decode = layout
            try:
                samples = convert(decode(data))
            except ValueError as problem:
                problems.append(problem)
            else:
                if layout is not self._layouts[0]:  # the first from now on
                    self._layouts.reverse()
                return samples
        raise problems[0]


SUPPORTED_MESSAGES = (
    "xela_server_ros/SensStream, xela_server_ros2/SensStream, XStream, xServerMsg, "
    "XelaServerMsg, SensorState, taxels[] with index and force, and shape[] with data[]"
)
"""Supported message types, for error messages."""


def axis_paths(prefix: str, kind: str, axes: str = "xyz") -> set[str]:
    """Return the paths of the fields of a vector, with their type."""
    return {f"{prefix}{axis} {kind}" for axis in axes}


def from_sens_stream(message: Mapping[str, Any]) -> list[DeviceSample]:
    """Return the samples of a SensStream: all sensors of a XELA server."""
    return [
        DeviceSample(
            record["sensor_pos"],
            record["model"],
            record["time"] if np.isfinite(record["time"]) and record["time"] > 0 else None,
            None,
            record["message"],
            whole_counts(record["taxels"]),
            point_rows(record["forces"]).astype(np.float64),
        )
        for record in message["sensors"]
    ]


def from_x_stream(message: Mapping[str, Any]) -> list[DeviceSample]:
    """Return the samples of an XStream, which has neither models nor times."""
    return [
        DeviceSample(
            record["sensor"], "", None, None, None, whole_counts(record["xyz"]), _NO_FORCES
        )
        for record in message["data"]
    ]


def from_x_server(message: Mapping[str, Any]) -> list[DeviceSample]:
    """Return the sample of an xServerMsg, of one sensor."""
    counts = whole_counts([record["point"] for record in message["points"]])
    number, model = message["sensor"], message["model"]
    stamp = stamp_seconds(message["header"]["stamp"])
    return [DeviceSample(number, model, None, stamp, None, counts, _NO_FORCES)]


def from_sensor_state(message: Mapping[str, Any], names: Sequence[str]) -> list[DeviceSample]:
    """Return the sample of a PapillArray; ROS 2 allows small letters only in names of fields."""
    forces = point_rows(message["pillars"], names)
    time = message["tus"] * 1e-6 if message["tus"] > 0 else None
    header = message.get("header")  # the maker's messages of ROS 2 have none
    stamp = stamp_seconds(header["stamp"]) if header else None
    return [DeviceSample(None, PAPILLARRAY, time, stamp, None, None, forces)]


def from_pad(message: Mapping[str, Any]) -> list[DeviceSample]:
    """Return the sample of a pad whose taxels have an index, a force [N], and more."""
    taxels = sorted(message["taxels"], key=itemgetter("index"))
    forces = point_rows([taxel["force"] for taxel in taxels])
    stamp = stamp_seconds(message["header"]["stamp"])
    return [DeviceSample(None, PAD, None, stamp, None, None, forces)]


def from_shaped(message: Mapping[str, Any]) -> list[DeviceSample]:
    """Return the samples of the pads in an array of (n_pads, n_taxels, 3) or (n_taxels, 3) counts.

    Raises:
        ValueError: the shape is another.
    """
    shape, data = tuple(message["shape"].tolist()), message["data"]
    if len(shape) not in (2, 3) or shape[-1] != 3 or prod(shape) != data.size:
        raise ValueError(f"shape (pads, taxels, 3) of {data.size} values expected, {shape} given")
    stamp = stamp_seconds(message["header"]["stamp"])
    pads = data.reshape(-1, *shape[-2:])
    return [
        DeviceSample(number, PAD, None, stamp, None, pad, _NO_FORCES)
        for number, pad in enumerate(pads, 1)
    ]


_NOTES: Mapping[object, str] = {from_pad: PAD_FORCES, from_shaped: PAD_DATA}
_CONVERTERS: tuple[tuple[set[str], Callable[[Mapping[str, Any]], list[DeviceSample]]], ...] = (
    (
        {
            "sensors[].message uint32",
            "sensors[].time float64",
            "sensors[].model string",
            "sensors[].sensor_pos uint8",
        }
        | axis_paths("sensors[].taxels[].", "uint16")
        | axis_paths("sensors[].forces[].", "float32"),
        from_sens_stream,
    ),
    (
        {"header.frame_id string", "taxels[].index uint32"}
        | axis_paths("taxels[].force.", "float64"),
        from_pad,
    ),
    ({"header.frame_id string", "shape[] int32", "data[] float32"}, from_shaped),
    ({"data[].sensor int16"} | axis_paths("data[].xyz[].", "uint32"), from_x_stream),
    (
        {"sensor int16", "model string", "header.frame_id string"}
        | axis_paths("points[].point.", "float64"),
        from_x_server,
    ),
    (
        {"tus int64"} | axis_paths("pillars[].f", "float32", "XYZ"),
        partial(from_sensor_state, names=("fX", "fY", "fZ")),
    ),
    (
        {"tus int64"} | axis_paths("pillars[].f", "float32"),
        partial(from_sensor_state, names=("fx", "fy", "fz")),
    ),
)


def point_rows(
    points: npt.NDArray[Any] | list[dict[str, Any]], names: Sequence[str] = "xyz"
) -> npt.NDArray[Any]:
    """Return (n, 3) of points that are an array or dictionaries."""
    if isinstance(points, np.ndarray):
        return points
    rows = [[point[name] for name in names] for point in points]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def whole_counts(points: npt.NDArray[Any] | list[dict[str, Any]]) -> npt.NDArray[np.uint16]:
    """Return (n, 3) of points whose counts may have a wider number type.

    Raises:
        ValueError: one is not a whole number of 16 bits.
    """
    values = point_rows(points)
    if values.dtype == np.uint16:
        return values
    with np.errstate(invalid="ignore"):
        counts = values.astype(np.uint16)
    # A cast wraps around, so the result is compared with its input.
    if (counts != values).any():
        raise ValueError("a reading is not a whole number from 0 to 65535")
    return counts


def stamp_seconds(stamp: Mapping[str, int]) -> float | None:
    """Return a stamp of ROS 1 or ROS 2 [s]; None if it was not set."""
    # ROS 1 and ROS 2 give the two fields other names, in the same order.
    seconds, nanoseconds = stamp.values()
    return seconds + nanoseconds * 1e-9 if seconds or nanoseconds else None


def sensors_of(sample: DeviceSample, unit: Unit) -> dict[str, Sensor]:
    """Return the sensors of a device by module, as `module_sensors` does.

    Args:
        sample: any sample of the device.
        unit: unit of the readings.

    Raises:
        ValueError: the device has another number of taxels than its model.
    """
    readings = readings_of(sample, unit)
    if sample.model == PAD:
        return {"": pad_sensor(len(readings), "N" if sample.counts is None else "count")}
    if sample.counts is None:
        pillars = sensor(PAPILLARRAY)
        if len(readings) != pillars.n_taxels:
            raise ValueError(
                f"{len(readings)} taxels given, {pillars.n_taxels} expected ({PAPILLARRAY})"
            )
        return {"": pillars}
    sensors = module_sensors(sample.model, len(readings))
    if unit == "count":
        return sensors
    return {name: replace(skin, unit=unit, range=None) for name, skin in sensors.items()}


def pad_sensor(n_taxels: int, unit: Unit) -> Sensor:
    """Return the sensor of a pad: PaXini's by its number of taxels and unit, else a flat grid.

    Example:
        >>> pad_sensor(120, "count").name, pad_sensor(24, "N").name
        ('paxini-120', 'pad-24')
    """
    paxini = sensor("paxini-120")
    if (n_taxels, unit) == (paxini.n_taxels, paxini.unit):
        return paxini
    return replace(flat_grid(f"{PAD}-{n_taxels}", n_taxels), unit=unit, range=None)


def readings_of(sample: DeviceSample, unit: Unit) -> npt.NDArray[Any]:
    """Return (n_taxels, 3) in a unit; newtons if the device sends nothing else."""
    return sample.forces if unit == "N" or sample.counts is None else sample.counts


def module_name(finger: str, part: str, *, named: bool) -> str:
    """Return the name of a module: the part of a hand, otherwise the finger.

    Args:
        finger: finger that the device is on.
        part: part of the hand; empty if the device is not a hand.
        named: whether a user gave the name of the finger; it then precedes the part.

    Example:
        >>> [module_name("left", "thumb", named=True), module_name("finger1", "", named=False)]
        ['left/thumb', 'finger1']
    """
    if not part:
        return finger
    return f"{finger}/{part}" if named else part
