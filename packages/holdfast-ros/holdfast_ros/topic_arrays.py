"""Arrays of numbers in the messages of any topic of a bag, by path: `topic/field`."""

import re
from collections.abc import Collection, Iterator, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from holdfast.errors import RecordingError
from holdfast.io.cdr import MessageDecoder
from holdfast.io.importers.stored import StoredArray, arrays_of_records, joined_axes
from holdfast.io.importers.table import first_texts
from holdfast_ros.bags import Bag

IMAGE_KINDS = re.compile(r"sensor_msgs/(Compressed)?Image|.*Video.*|.*/Marker(Array)?")
"""Types of messages that are left out unless their topic is named."""
STAMPS = (("secs", "nsecs", 1e-9), ("sec", "nanosec", 1e-9))
"""Fields of a time in ROS 1 and 2."""

_POINT_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Number types of the fields of a PointCloud2."""


def arrays_of_topics(path: Path, bag: Bag, names: Collection[str]) -> dict[str, StoredArray]:
    """Return the arrays in the messages of topics, with their times [s] as `topic/time`.

    A time is that of the header, if all of a topic have one and increase, else that of the bag.

    Args:
        path: of the bag, for messages.
        bag: the bag.
        names: paths that begin with the names of topics; all topics if it is empty.

    Raises:
        RecordingError: no topic has one of these names.
    """
    prefixes = [f"{name.strip('/')}/" for name in names]
    topics = {
        topic.number: topic
        for topic in bag.topics
        if any(prefix.startswith(f"{topic.name.strip('/')}/") for prefix in prefixes)
        or (not names and IMAGE_KINDS.fullmatch(topic.kind) is None)
    }
    if not topics:
        shown = first_texts(list(dict.fromkeys(topic.name for topic in bag.topics)))
        raise RecordingError(f"{path} has no topic {', '.join(names)}; it has {shown}")
    decoders = {
        n: MessageDecoder(topic.definition, ros2=bag.ros2)
        for n, topic in topics.items()
        if topic.definition is not None
    }
    if not decoders:
        first = next(iter(topics.values()))
        raise RecordingError(
            f"{path} has no definition of {first.kind} ({first.name}): write the bag as mcap where "
            "its package is installed (ros2 bag convert)"
        )
    records: dict[str, list[dict[str, Any]]] = {}
    for topic, time, data in bag.messages(topics[n] for n in decoders):
        message = dict(shaped_fields(decoders[topic.number](data)))
        records.setdefault(topic.name, []).append({**message, "bag_time": time})
    arrays_by_path: dict[str, StoredArray] = {}
    for name, topic_records in records.items():
        arrays = arrays_of_records(topic_records)
        for key in [key for key in arrays if key.endswith("bag_time")]:
            start = key.removesuffix("bag_time")
            header = arrays.get(f"{start}stamp")
            times = arrays.pop(key)
            is_good = header is not None and bool((np.diff(header.read(), prepend=0) > 0).all())
            arrays[f"{start}time"] = header if header is not None and is_good else times
        arrays = {key: array for key, array in arrays.items() if not key.endswith("stamp")}
        arrays_by_path |= {f"{name}/{key}": array for key, array in arrays.items()}
    return arrays_by_path


def shaped_fields(message: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the fields of a message; points and arrays with a layout in their shape."""
    if {"point_step", "data", "fields"} <= message.keys():
        yield from point_fields(message).items()
        # The other fields of a PointCloud2 only describe its data.
        message = {"header": message.get("header", {})}
    for name, value in message.items():
        if name == "header" and isinstance(value, Mapping):
            yield from ((n, dimension) for n, dimension in shaped_fields(value) if n == "stamp")
        elif isinstance(value, Mapping) and (stamp := seconds_of(value)) is not None:
            yield name, stamp
        elif name == "data" and isinstance(value, np.ndarray) and "layout" in message:
            sizes = [int(dimension["size"]) for dimension in message["layout"].get("dim", ())]
            yield name, value.reshape(sizes) if prod(sizes) == value.size else value
        elif name != "layout":
            yield name, value


def seconds_of(value: Mapping[str, Any]) -> float | None:
    """Return the time [s] of a stamp of ROS 1 or ROS 2; None of anything else."""
    for seconds, nanoseconds, size in STAMPS:
        if value.keys() == {seconds, nanoseconds}:
            return float(value[seconds] + size * value[nanoseconds])
    return None


def point_fields(message: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a PointCloud2; positions are left out where there is another vector.

    Raises:
        ValueError: its fields contradict its data.
    """
    n, step = message["width"] * message["height"], message["point_step"]
    order = ">" if message["is_bigendian"] else "<"
    fields = [
        point_field for point_field in message["fields"] if point_field["datatype"] in _POINT_TYPES
    ]
    kind = np.dtype(
        {
            "names": [point_field["name"] for point_field in fields],
            "formats": [order + _POINT_TYPES[point_field["datatype"]] for point_field in fields],
            "offsets": [point_field["offset"] for point_field in fields],
            "itemsize": step,
        }
    )
    points = np.frombuffer(message["data"].tobytes(), kind, n)
    joined = joined_axes({name: points[name] for name in kind.names or ()})
    vectors = [name for name, values in joined.items() if values.ndim > 1]
    # The position of a point is no reading where it has another vector.
    if len(vectors) > 1:
        joined.pop("xyz", None)
    return joined
