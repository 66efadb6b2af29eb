"""The detector of a model as one C99 header: files of the kernel, and constants of the model."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from importlib import resources
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import Fault, Reason
from holdfast.detection.kernel_config import stream_config
from holdfast.detection.model import Model
from holdfast.detection.plan import OPEN_HAND, Start, StreamPlan
from holdfast.errors import DISTRIBUTION, ModelError
from holdfast.kernel.structs import fields_of, n_mask_words, types_of
from holdfast.sensors import Sensor

LINE = 100


def kernel_text() -> str:
    """Return the files of the kernel that holdfast.c includes, joined in its order."""
    folder, joined = resources.files("holdfast.kernel"), set[str]()

    def text_of(name: str) -> str:
        if name in joined:
            return ""
        joined.add(name)
        text = (folder / name).read_text("utf-8")
        return re.sub(r'#include "(\S+)"\n', lambda include: text_of(include[1]), text)

    return text_of("holdfast.c").strip()


class Tables:
    """The constants of a model as texts in C.

    Attributes:
        fields: of the structs of the kernel.
        types: layouts of these structs with the sizes of the hand.
        sizes: of the hand, by the names of their macros.
        texts: definitions.
        n_bytes: of all of them.
        has_baseline: whether the readings without contact of a finger are known.
    """

    def __init__(self, kernel: str, model: Model, plan: StreamPlan, *, single: bool) -> None:
        self.fields, self.texts, self.n_bytes = fields_of(kernel), list[str](), 0
        self._single = single
        stream, detector, baseline = stream_config(plan), model.config(plan), plan.baseline
        names = stream.hand.dtype.names or ()
        self.sizes = {name: int(stream.hand[name][0]) for name in names if name.startswith("n_")}
        self.sizes["n_taxels"] = len(baseline)
        self.sizes["mask_words"] = max(n_mask_words(s.n_taxels) for s in plan.sensors.values())
        macros = {f"HOLDFAST_{name.upper()}": n for name, n in self.sizes.items()}
        self.types = types_of(kernel, macros, single=single)
        self.has_baseline = bool(np.any(baseline))
        self._add("holdfast_finger", "fingers", stream.fingers)
        self._add("holdfast_feature", "features", stream.features)
        no_lag = np.zeros(1, stream.lags.dtype)  # C has no empty arrays
        self._add("holdfast_lag", "lags", stream.lags if len(stream.lags) else no_lag)
        for name, values in (
            ("used", stream.used), ("rotations", stream.rotations), ("positions", stream.positions),
            ("weights", detector.weights), *[("baseline", baseline)] * self.has_baseline,
        ):  # fmt: skip
            self._add("hf_real", name, values.ravel())
        self._add("holdfast_hand", "hand", stream.hand, is_array=False)
        self._add("holdfast_rule", "rules", detector.rules)
        self._add("holdfast_model", "model", detector.model, is_array=False)

    def _add(self, kind: str, name: str, rows: npt.NDArray[Any], *, is_array: bool = True) -> None:
        self.n_bytes += len(rows) * self.types[kind].itemsize
        # Lines of about 100 characters: C99 guarantees no more than 4095 in one.
        lines = [""]
        for row in [self._text(kind, row) for row in rows]:
            if len(lines[-1]) + len(row) + 2 > LINE:
                lines.append("")
            lines[-1] += f"{row}, "
        body = "\n".join(line.rstrip() for line in lines).rstrip(",")
        length = f"[{len(rows)}] = {{\n{body}}};" if is_array else f" =\n{body};"
        self.texts.append(f"static const {kind} hf_{name}{length}")

    def _text(self, kind: str, value: Any) -> str:  # noqa: ANN401 (a struct, or a number)
        """Return the initializer of a struct or of a number."""
        if kind in self.fields:
            parts = []
            for field in self.fields[kind]:
                if field.is_pointer:  # to the table of that name; of the hand there is one
                    part = f"&hf_{field.name}" if field.name == "hand" else f"hf_{field.name}"
                elif field.length is None:
                    part = self._text(field.kind, value[field.name])
                else:
                    items = (self._text(field.kind, item) for item in value[field.name])
                    part = f"{{{', '.join(items)}}}"
                parts.append(part)
            return f"{{{', '.join(parts)}}}"
        if kind == "bool":
            return "true" if value else "false"
        if kind not in ("hf_real", "double"):
            return str(int(value))
        if math.isnan(value):
            return "HF_NAN"
        if math.isinf(value):
            return "HF_INFINITY" if value > 0 else "-HF_INFINITY"
        # The shortest text that is read back as the same number, in either precision.
        is_single = self._single and kind == "hf_real"
        return f"{np.float32(value)!s}f" if is_single else repr(float(value))


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
    plan = replace(model.plan(sensors, rate), start=start, ignore=ignore or {})
    if plan.tare.kind == "interval":
        raise ModelError(
            f"the model's tare is the interval {model.tare} s of a recording; a header holds a "
            "tare of seconds, 'first' or 'none', because samples come one by one"
        )
    kernel = kernel_text()
    tables = Tables(kernel, model, plan, single=single)
    state_size = tables.types["holdfast_detector_memory"].itemsize + HEADER_FIELDS
    # Names in capitals stand between @ in the template.
    parts = {
        "VERSION": version(DISTRIBUTION),
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
    text = (resources.files("holdfast.detection") / "header_template.h").read_text("utf-8")
    for name, part in parts.items():
        text = text.replace(f"@{name}@", part)
    # The id depends on all but itself: a state that another header has left is refused by it.
    header_id = f"0x{sha256(text.encode()).hexdigest()[:8]}u"
    text = text.replace("@HEADER_ID@", header_id)
    # Times stay double: seconds since a boot have no room for milliseconds in 24 bits.
    times = tuple(
        f"{name}.{field.name}"
        for name in ("mask", "track", "motion", "finger_memory", "decision")
        for field in tables.fields[f"holdfast_{name}"]
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

    The kernel's header has the codes of states and causes.
    """
    first = np.cumsum([0, *(sensor.n_taxels for sensor in sensors.values())]).tolist()
    # Names that are the same in capitals, or without signs, give way to numbers.
    names = [re.sub(r"\W", "_", name, flags=re.ASCII).upper() for name in sensors]
    if len(set(names)) < len(names):
        names = [f"{index}" for index in range(len(names))]
    # Reasons are codes, faults are bits of a mask, as `Detector` has them.
    for prefix, members in (
        ("FINGER", [(name, index) for index, name in enumerate(names)]),
        ("FIRST_TAXEL", list(zip(names, first, strict=False))),
        ("REASON", [(reason.name, index) for index, reason in enumerate(Reason)]),
        ("FAULT", [(fault.name, 1 << index) for index, fault in enumerate(Fault)]),
        ("CAUSE", [("NONE", 0)]),
    ):
        lines = (f"    HOLDFAST_{prefix}_{name} = {value}" for name, value in members)
        yield "enum {\n" + ",\n".join(lines) + "\n};"
