"""The detector of a model as one C99 header: files of the kernel, and tables of the model."""

import ctypes
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

from holdfast.classifiers import Linear
from holdfast.contact import Fault, Reason
from holdfast.detector.tables import model_table, rules_of
from holdfast.errors import ModelError
from holdfast.features.loaded_start import declared_baselines
from holdfast.features.stream import FeatureStream
from holdfast.features.tables import StreamPlan, Struct
from holdfast.model import Model
from holdfast.model.heads import HEAD_NAMES
from holdfast.recordings import BASELINES
from holdfast.sensors import Sensor

LINE = 100
HEADER_FIELDS = 16
"""Bytes of a detector beside the memory of the kernel."""
C_TYPES: dict[str, Any] = {
    "double": ctypes.c_double, "bool": ctypes.c_bool, "size_t": ctypes.c_size_t,
    "int32_t": ctypes.c_int32, "uint32_t": ctypes.c_uint32,
    "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64,
}  # fmt: skip
Rows = Sequence[Struct] | Sequence[float]


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


class Field(NamedTuple):
    """Field of a struct in C.

    Attributes:
        name: of the field.
        kind: its type, or that of its elements.
        length: expression of the number of elements, of an array.
        is_pointer: whether the field is a pointer.
    """

    name: str
    kind: str
    length: str | None
    is_pointer: bool


def header_of(
    model: Model,
    fingers: Mapping[str, Sensor],
    rate: float,
    *,
    single: bool = False,
    in_contact: bool = False,
    baselines: Mapping[str, npt.ArrayLike] | None = None,
    ignore: Mapping[str, Sequence[int]] | None = None,
) -> CHeader:
    """Return the header of a model for the fingers of a hand; it does what a `Detector` does.

    Args:
        model: features, classifiers and decision rule.
        fingers: sensor of each finger, in the order of the readings.
        rate: samples per second of the source [Hz], for a model of any rate.
        single: numbers are of single precision; times stay double.
        in_contact: the first samples are load, and not an open hand.
        baselines: (n_taxels, 3) readings without contact by finger, if `in_contact`.
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
    declared = declared_baselines({BASELINES: baselines}, sensors)
    plan = replace(model.plan(sensors, rate), in_contact=in_contact, baselines=declared)
    plan = replace(plan, ignore=ignore or {})
    if plan.tare.kind == "interval":
        raise ModelError(
            f"the model's tare is the interval {model.tare} s of a recording; a header holds a "
            "tare of seconds, 'first' or 'none', because samples come one by one"
        )
    return _assembled(model, plan, rate, single=single)


def _assembled(model: Model, plan: StreamPlan, rate: float, *, single: bool) -> CHeader:
    kernel = kernel_text()
    tables = _Tables(kernel, model, plan, single=single)
    state_size = ctypes.sizeof(tables.types["holdfast_detector_memory"]) + HEADER_FIELDS
    sensors = plan.sensors
    parts = {
        "VERSION": version("holdfast"),
        "MODEL": re.sub(r"[^\w.:-]", "_", model.name or "model"),
        "MODEL_DIGEST": model.digest,
        "FINGERS": ", ".join(
            f"{_plain(name)} ({_plain(sensor.name)}, {sensor.n_taxels} taxels)"
            for name, sensor in sensors.items()
        ),
        "RATE": f"{model.rate or rate:.6g}",
        "PRECISION": "single, times double" if single else "double",
        "SIZES": "\n".join(
            [*(f"#define HOLDFAST_{name.upper()} {n}" for name, n in tables.sizes.items()),
             *["#define HOLDFAST_SINGLE"] * single]
        ),
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
    header_id = f"0x{sha256(text.encode()).hexdigest()[:8]}u"
    text = text.replace("@HEADER_ID@", header_id)
    return CHeader(text, state_size, tables.n_bytes, _times(tables.structs) if single else ())


def kernel_text() -> str:
    """Return the files of the kernel that holdfast.c includes, joined in its order."""
    folder, joined = resources.files("holdfast.kernel"), set[str]()

    def text_of(name: str) -> str:
        if name in joined:
            return ""
        joined.add(name)
        text = (folder / name).read_text("utf-8")
        return re.sub(r'#include "(\S+)"\n', lambda found: text_of(found[1]), text)

    return text_of("holdfast.c").strip()


def structs_of(text: str) -> dict[str, list[Field]]:
    """Return the fields of each struct in the text of the kernel, their only definition.

    Example:
        >>> structs_of("typedef struct { double time; hf_real m[3]; } holdfast_x;")["holdfast_x"]
        [Field(name='time', kind='double', length=None, is_pointer=False),
         Field(name='m', kind='hf_real', length='3', is_pointer=False)]
    """
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = {}
    for body, name in re.findall(r"typedef struct \{([^}]*)\} (holdfast_\w+);", text):
        fields: list[Field] = []
        for line in filter(None, (" ".join(part.split()) for part in body.split(";"))):
            array = re.fullmatch(r"HF_ARRAY\((\w+), (\w+), (.+)\)", line)
            plain = re.fullmatch(r"(?:const )?(\w+) (\*?)(\w+)(?:\[(.+)\])?", line)
            if array:
                fields.append(Field(array[2], array[1], array[3], is_pointer=False))
            elif plain:
                fields.append(Field(plain[3], plain[1], plain[4], is_pointer=bool(plain[2])))
            else:
                raise ValueError(f"struct {name}: a field, or HF_ARRAY, expected; {line!r} given")
        found[name] = fields
    return found


class _Tables:
    """The tables of a model as texts in C.

    Attributes:
        structs: fields of the structs of the kernel.
        types: these structs with the sizes of the hand, for ctypes.
        sizes: of the hand, by the names of their macros.
        texts: definitions.
        n_bytes: of all of them.
        has_baseline: whether the readings without contact of a finger are known.
    """

    def __init__(self, kernel: str, model: Model, plan: StreamPlan, *, single: bool) -> None:
        self.structs, self.texts, self.n_bytes = structs_of(kernel), list[str](), 0
        self._single = single
        tables = FeatureStream(plan).tables()
        hand, fingers, features, lags, used, rotations, places, baseline = tables
        rules, heads, weights = rules_of(model, plan)
        n_heads = len(HEAD_NAMES)
        own_heads = [{"heads": heads[k : k + n_heads]} for k in range(0, len(heads), n_heads)]
        self.sizes: dict[str, Any] = {k: n for k, n in hand.items() if k.startswith("n_")}
        self.sizes["n_taxels"] = len(baseline)
        names = {name: int(value) for name, value in re.findall(r"(\w+_N_\w+) = (\d+)", kernel)}
        names |= {f"HOLDFAST_{name.upper()}": n for name, n in self.sizes.items()}
        self.types = ctypes_of(self.structs, names, single=single)
        self.has_baseline = bool(np.any(baseline))
        self._add("holdfast_finger", "fingers", fingers)
        self._add("holdfast_feature", "features", features)
        no_lag: Struct = {field.name: 0 for field in self.structs["holdfast_lag"]}
        self._add("holdfast_lag", "lags", lags or [no_lag])  # C has no empty arrays
        for name, values in (
            ("used", used), ("rotations", rotations), ("places", places), ("weights", weights),
            *[("baseline", baseline)] * self.has_baseline,
        ):  # fmt: skip
            self._add("hf_real", name, values.ravel().tolist())
        self._add("holdfast_hand", "hand", [hand], is_array=False)
        self._add("holdfast_rule", "rules", [a | b for a, b in zip(rules, own_heads, strict=True)])
        table = model_table(model, plan) | {"n_weights": len(weights)}
        self._add("holdfast_model", "model", [table], is_array=False)

    def _add(self, kind: str, name: str, rows: Rows, *, is_array: bool = True) -> None:
        self.n_bytes += len(rows) * ctypes.sizeof(self.types[kind])
        lines = [""]
        for row in [self._text(kind, row) for row in rows]:
            if len(lines[-1]) + len(row) + 2 > LINE:
                lines.append("")
            lines[-1] += f"{row}, "
        body = "\n".join(line.rstrip() for line in lines).rstrip(",")
        length = f"[{len(rows)}] = {{\n{body}}};" if is_array else f" =\n{body};"
        self.texts.append(f"static const {kind} hf_{name}{length}")

    def _text(self, kind: str, value: Any) -> str:  # noqa: ANN401 (a row, or a number)
        """Return the initializer of a struct or of a number."""
        if kind in self.structs:
            return f"{{{', '.join(self._field(field, value) for field in self.structs[kind])}}}"
        if kind == "bool":
            return "true" if value else "false"
        if kind not in ("hf_real", "double"):
            return str(int(value))
        if math.isnan(value):
            return "HF_NAN"
        if math.isinf(value):
            return "HF_INFINITY" if value > 0 else "-HF_INFINITY"
        is_single = self._single and kind == "hf_real"
        return f"{np.float32(value)!s}f" if is_single else repr(float(value))

    def _field(self, field: Field, row: Struct) -> str:
        if field.is_pointer:
            return f"&hf_{field.name}" if field.name == "hand" else f"hf_{field.name}"
        if field.length is None:
            return self._text(field.kind, row[field.name])
        values = row.get(field.name)
        if not isinstance(values, list):
            values = [row[f"{field.name}[{k}]"] for k in range(int(field.length))]
        return f"{{{', '.join(self._text(field.kind, value) for value in values)}}}"


def ctypes_of(
    structs: Mapping[str, Sequence[Field]], names: Mapping[str, int], *, single: bool
) -> dict[str, Any]:
    """Return types of ctypes for the structs of an exported header, for their sizes.

    Args:
        structs: fields of each struct.
        names: numbers in the lengths of arrays.
        single: numbers are of single precision.
    """
    found = C_TYPES | {"hf_real": ctypes.c_float if single else ctypes.c_double}
    for name, fields in structs.items():
        members = [(field.name, _ctype(field, found, names)) for field in fields]
        found[name] = type(name, (ctypes.Structure,), {"_fields_": members})
    return found


def _ctype(field: Field, found: Mapping[str, Any], names: Mapping[str, int]) -> Any:  # noqa: ANN401
    if field.is_pointer:
        return ctypes.c_void_p
    if field.length is None:
        return found[field.kind]
    return found[field.kind] * eval(field.length, {}, dict(names))


def _times(structs: Mapping[str, Sequence[Field]]) -> tuple[str, ...]:
    """Return the fields of the state that are double in single precision too."""
    return tuple(
        f"{name.removeprefix('holdfast_')}.{field.name}"
        for name in ("holdfast_mask", "holdfast_track", "holdfast_motion", "holdfast_finger_memory",
                     "holdfast_decision")
        for field in structs[name]
        if field.kind == "double"
    )  # fmt: skip


def _plain(name: str) -> str:
    """Return a name without what would end a comment or a line."""
    return re.sub(r"[^\w ./:-]", "_", name, flags=re.ASCII).replace("*/", "__")


def _enums(sensors: Mapping[str, Sensor]) -> Iterator[str]:
    """Yield the names of fingers, reasons, faults and no cause as enumerations.

    The kernel has those of states and causes.
    """
    first = np.cumsum([0, *(sensor.n_taxels for sensor in sensors.values())]).tolist()
    names = [re.sub(r"\W", "_", name, flags=re.ASCII).upper() for name in sensors]
    if len(set(names)) < len(names):
        names = [f"{place}" for place in range(len(names))]
    yield _enum("HOLDFAST_FINGER_", [(name, place) for place, name in enumerate(names)])
    yield _enum("HOLDFAST_FIRST_TAXEL_", list(zip(names, first, strict=False)))
    yield _enum("HOLDFAST_REASON_", [(x.name, place) for place, x in enumerate(Reason)])
    faults = [(fault.name, 1 << place) for place, fault in enumerate(Fault)]
    yield _enum("HOLDFAST_FAULT_", faults)
    yield _enum("HOLDFAST_CAUSE_", [("NONE", 0)])


def _enum(prefix: str, members: Sequence[tuple[str, int]]) -> str:
    lines = ",\n".join(f"    {prefix}{name} = {value}" for name, value in members)
    return f"enum {{\n{lines}\n}};"
