"""The detector of a model as one C99 header: files of the kernel, and tables of the model."""

import ctypes
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from importlib import resources
from importlib.metadata import version
from typing import NamedTuple

import numpy as np

from holdfast.classifiers import Linear
from holdfast.contact import Fault, Reason
from holdfast.errors import ModelError
from holdfast.exporters.c_tables import Tables, kernel_text
from holdfast.features.start import OPEN_HAND, Start
from holdfast.model import Model
from holdfast.sensors import Sensor

HEADER_FIELDS = 16
"""Bytes of a detector beside the memory of the kernel: the id of its header, and the last time."""


class CHeader(NamedTuple):
    """A header and its sizes.

    Attributes:
        text: of the file.
        state_size: of a detector, where pointers have 64 bits [bytes].
        constants_size: of all tables [bytes].
        double_fields: fields of the state that are double in a header of single precision.
    """

    text: str
    state_size: int
    constants_size: int
    double_fields: tuple[str, ...]


def header_of(
    model: Model,
    fingers: Mapping[str, Sensor],
    rate: float,
    *,
    single: bool = False,
    start: Start = OPEN_HAND,
    ignore: Mapping[str, Sequence[int]] | None = None,
) -> CHeader:
    """Return the header of a model for the fingers of a hand; it does what a `Detector` does.

    Args:
        model: features, classifiers and decision rule.
        fingers: sensor of each finger, in the order of the readings.
        rate: samples per second of the source [Hz], for a model of any rate.
        single: numbers are of single precision; times stay double.
        start: of the samples, with an open hand or in contact.
        ignore: indices by finger, from 0, of taxels that contribute nothing and cause no fault.

    Raises:
        ModelError: a part of the model has no form as C, or the fingers do not fit.
    """
    sensors = model.fingers_of(fingers)
    for name, sensor in sensors.items():
        if not isinstance(model.finger(name, sensor).stable.rule, Linear):
            raise ModelError(
                f"the classifier of {name} is an ONNX file, which has no form as C; a header "
                "holds linear classifiers (logistic regression, linear SVM) with all the rest"
            )
    plan = replace(model.plan(sensors, rate), start=start, ignore=ignore or {})
    if plan.tare.kind == "interval":
        raise ModelError(
            f"the model's tare is the interval {model.tare} s of a recording; a header holds a "
            "tare of seconds, 'first' or 'none', because samples come one by one"
        )
    kernel = kernel_text()
    tables = Tables(kernel, model, plan, single=single)
    state_size = ctypes.sizeof(tables.types["holdfast_detector_memory"]) + HEADER_FIELDS
    # Names in capitals stand between @ in the template.
    parts = {
        "VERSION": version("holdfast"),
        # A model may have any name; a C string and a comment may not.
        "MODEL": re.sub(r"[^\w.:-]", "_", model.name or "model"),
        "MODEL_DIGEST": model.digest,
        "FINGERS": ", ".join(
            f"{_plain(name)} ({_plain(sensor.name)}, {sensor.n_taxels} taxels)"
            for name, sensor in sensors.items()
        ),
        "RATE": f"{model.rate or rate:.6g}",
        "PRECISION": "single, times double" if single else "double",
        "SIZES": "\n".join(_sizes(tables.sizes, sensors, single=single)),
        "ENUMS": "\n\n".join(_enums(sensors)),
        "KERNEL": kernel,
        "TABLES": "\n\n".join(tables.texts),
        "BASELINE": "hf_baseline" if tables.has_baseline else "NULL",
        "STATE_SIZE": str(state_size),
        "CONSTANTS_SIZE": str(tables.n_bytes),
    }  # fmt: skip
    text = (resources.files("holdfast.exporters") / "header_template.h").read_text("utf-8")
    for name, part in parts.items():
        text = text.replace(f"@{name}@", part)
    # The id depends on all but itself: a state that another header has left is refused by it.
    header_id = f"0x{sha256(text.encode()).hexdigest()[:8]}u"
    text = text.replace("@HEADER_ID@", header_id)
    # Times stay double: seconds since a boot have no room for milliseconds in 24 bits.
    times = tuple(
        f"{name}.{field.name}"
        for name in ("mask", "track", "motion", "finger_memory", "decision")
        for field in tables.structs[f"holdfast_{name}"]
        if field.kind == "double"
    )
    return CHeader(text, state_size, tables.n_bytes, times if single else ())


def _sizes(
    sizes: Mapping[str, int], sensors: Mapping[str, Sensor], *, single: bool
) -> Iterator[str]:
    """Yield the macros by which the kernel is compiled for one hand."""
    for name, value in sizes.items():
        yield f"#define HOLDFAST_{name.upper()} {value}"
    normals = {tuple(sensor.normal.tolist()) for sensor in sensors.values()}
    # Where all normals are one axis, the compiler drops the products with the others.
    for axis, unit in enumerate(np.eye(3).tolist()):
        if normals == {tuple(unit)}:
            yield f"#define HOLDFAST_NORMAL_AXIS {axis}"
    if single:
        yield "#define HOLDFAST_SINGLE"


def _plain(name: str) -> str:
    """Return a name without what would end a comment or a line."""
    return re.sub(r"[^\w ./:-]", "_", name, flags=re.ASCII).replace("*/", "__")


def _enums(sensors: Mapping[str, Sensor]) -> Iterator[str]:
    """Yield the names of fingers, reasons, faults and no cause as enumerations.

    The kernel has those of states and causes.
    """
    first = np.cumsum([0, *(sensor.n_taxels for sensor in sensors.values())]).tolist()
    # Names that are the same in capitals, or without signs, give way to numbers.
    names = [re.sub(r"\W", "_", name, flags=re.ASCII).upper() for name in sensors]
    if len(set(names)) < len(names):
        names = [f"{place}" for place in range(len(names))]
    # Reasons are codes, faults are bits of a mask, as `Detector` has them.
    for prefix, members in (
        ("FINGER", [(name, place) for place, name in enumerate(names)]),
        ("FIRST_TAXEL", list(zip(names, first, strict=False))),
        ("REASON", [(reason.name, place) for place, reason in enumerate(Reason)]),
        ("FAULT", [(fault.name, 1 << place) for place, fault in enumerate(Fault)]),
        ("CAUSE", [("NONE", 0)]),
    ):
        lines = (f"    HOLDFAST_{prefix}_{name} = {value}" for name, value in members)
        yield "enum {\n" + ",\n".join(lines) + "\n};"
