"""The detector of a model as one C99 header, generated from the kernel that Python runs."""

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
from holdfast.contact import Cause, ContactState, Fault, Reason
from holdfast.detector import arrays as rule_at
from holdfast.detector import decision_rule
from holdfast.detector.address_table import fields_of
from holdfast.detector.head_arrays import rule_of
from holdfast.errors import ModelError
from holdfast.exporters.c_functions import Program
from holdfast.exporters.c_values import (
    BOOL,
    C_TYPES,
    EXACT_TIME,
    INTEGER,
    REAL,
    CArray,
    CNumber,
    CRecord,
    CTuple,
    known,
    literal,
)
from holdfast.features import arrays as at
from holdfast.features.loaded_start import declared_baselines
from holdfast.features.stream import FeatureStream
from holdfast.model import Model
from holdfast.recordings import BASELINES
from holdfast.sensors import Sensor

AnyArray = npt.NDArray[Any]
KIND_OF_DTYPE = {"b": BOOL, "i": INTEGER, "f": REAL}
"""Kinds of elements by the kind of their NumPy type."""
FRAME_COLUMNS = ("REPORT_TIME", "REPORT_PROBABILITY", "REPORT_SIGMA", "REPORT_FORCE", "REPORT_SLIP",
           "REPORT_SPEED", "REPORT_DISTANCE", "REPORT_WIDTH")  # fmt: skip
"""Columns of the report that the frame of the header reads."""
WORDS_OF_LINE = 6
OFFSETS = "hf_layout_offsets"
"""Constant array that the frame of the header reads."""


class CHeader(NamedTuple):
    """A header and its sizes.

    Attributes:
        text: of the file.
        state_size: of a detector, at least [bytes].
        constants_size: of all constants [bytes].
        double_fields: arrays that keep double precision in a header of single precision.
    """

    text: str
    state_size: int
    constants_size: int
    double_fields: tuple[str, ...]


class HeaderArray(NamedTuple):
    """Array of a header.

    Attributes:
        name: in C.
        values: of a constant; the first values of a member of the state.
        taxel_axis: axis of the taxels, if it has one: the last in the memory of C, so that a loop
            over taxels reads numbers that are next to each other, several at a time.
    """

    name: str
    values: AnyArray
    taxel_axis: int | None = None

    @property
    def in_memory(self) -> AnyArray:
        """The values, with their axes in the order of C's memory."""
        if self.taxel_axis is None:
            return self.values
        return np.ascontiguousarray(np.moveaxis(self.values, self.taxel_axis, -1))

    @property
    def strides(self) -> tuple[int, ...]:
        """Distance in memory along each axis [elements]."""
        shape = self.in_memory.shape
        strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
        if self.taxel_axis is not None:
            strides.insert(self.taxel_axis, strides.pop())
        return tuple(strides)


def _taxel_axis(values: Any, name: str) -> int | None:  # noqa: ANN401 (any named tuple)
    """Return the axis of the taxels of a field of a named tuple; None without one."""
    kind = {field.name: field.kind for field in fields_of(type(values))}[name]
    return None if kind is None else kind.taxel_axis


class DetectorArrays(NamedTuple):
    """What the kernel receives: named tuples of constants and of memory, by their names.

    Attributes:
        constants: layout and rule.
        state: memory, output and decision, before the first sample.
    """

    constants: Mapping[str, Any]
    state: Mapping[str, Any]

    def arrays(self) -> Iterator[HeaderArray]:
        """Yield all arrays of the state, with their first values."""
        layout = self.constants["layout"]
        n_fingers, n_taxels = len(layout.windows), len(layout.rotations)
        yield HeaderArray("readings", np.zeros((n_taxels, 3)), taxel_axis=0)
        yield HeaderArray("present", np.zeros(n_fingers, dtype=np.bool_))
        yield HeaderArray("report", np.zeros((n_fingers, rule_at.REPORT_WIDTH)))
        for record, values in self.state.items():
            for name, array in values._asdict().items():
                yield HeaderArray(f"{record}_{name}", array, _taxel_axis(values, name))

    def constant_arrays(self) -> Iterator[HeaderArray]:
        """Yield all arrays of the constants."""
        for record, values in self.constants.items():
            for name, array in values._asdict().items():
                if isinstance(array, np.ndarray):
                    yield HeaderArray(f"hf_{record}_{name}", array, _taxel_axis(values, name))


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
        ModelError: a part of the model has no translation, or the fingers do not fit.
    """
    arrays = detector_arrays(
        model, fingers, rate, in_contact=in_contact, baselines=baselines, ignore=ignore
    )
    time_fields: frozenset[str] = frozenset()
    while True:
        program = Program(single=single, time_fields=time_fields)
        calls = _translate(program, arrays)
        if not program.new_time_fields:
            break
        time_fields |= program.new_time_fields
    return _assembled(model, fingers, rate, arrays, program, calls)


def detector_arrays(
    model: Model,
    fingers: Mapping[str, Sensor],
    rate: float,
    *,
    in_contact: bool = False,
    baselines: Mapping[str, npt.ArrayLike] | None = None,
    ignore: Mapping[str, Sequence[int]] | None = None,
) -> DetectorArrays:
    """Return the arrays of a new detector, if a header can hold all of it."""
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
    stream, rule = FeatureStream(plan), rule_of(model, plan)
    decision = decision_rule.new_decision_memory(
        len(sensors), rule.causes.shape[1], rule.slip_limits
    )
    return DetectorArrays(
        {"layout": stream.layout, "rule": rule},
        {"memory": stream.memory, "output": stream.output, "decision": decision},
    )


def _translate(program: Program, arrays: DetectorArrays) -> dict[str, str]:
    """Translate all that a header needs. Return the texts of its calls."""
    state = {array.name: _state_array(program, array) for array in arrays.arrays()}
    constants = {array.name: _constant_array(array) for array in arrays.constant_arrays()}
    records = {
        name: CRecord(name, {f: state[f"{name}_{f}"] for f in values._fields}, is_constant=False)
        for name, values in arrays.state.items()
    } | {
        name: _constant_record(name, values, constants) for name, values in arrays.constants.items()
    }
    layout, memory, output, rule, decision = (
        records[name] for name in ("layout", "memory", "output", "rule", "decision")
    )
    time = CNumber(_time_kind(program), "time")
    finger = CNumber(INTEGER, "f")
    step = program.call(
        _python(decision_rule.step),
        [layout, memory, output, rule, decision, state["readings"], state["present"], time],
    )
    fill = program.call_text(
        _python(decision_rule.fill_report), [memory, output, decision, state["report"], finger]
    )
    code = CNumber(INTEGER, "(int64_t)row[HF_REPORT_CODE]")
    split = program.call(_plain_function(decision_rule.split_code), [code])
    if not (isinstance(step, CNumber) and isinstance(split, CTuple)):
        raise TypeError("the kernel returns something else")
    return {
        "STEP": step.text,
        "FILL_REPORT": f"{fill};",
        "SPLIT_CODE": split.text,
        "REPORT_REAL": C_TYPES[state["report"].kind],
    }


def _python(compiled: Any) -> Any:  # noqa: ANN401 (a function that numba compiles)
    """Return the function of Python that a compiled function was made from."""
    return compiled.py_func


def _plain_function(function: Any) -> Any:  # noqa: ANN401
    """Return a function of Python that is not compiled by itself."""
    return function


def _time_kind(program: Program) -> str:
    return EXACT_TIME if program.single else REAL


def _state_array(program: Program, array: HeaderArray) -> CArray:
    kind = KIND_OF_DTYPE[array.values.dtype.kind]
    if array.name in program.time_fields:
        kind = EXACT_TIME
    return _array(kind, f"d->{array.name}", array)


def _constant_array(array: HeaderArray) -> CArray:
    kind = KIND_OF_DTYPE[array.values.dtype.kind]
    return _array(kind, array.name, array, array.values[np.newaxis])


def _array(kind: str, base: str, array: HeaderArray, choices: Any = None) -> CArray:  # noqa: ANN401
    shape = tuple(known(int(length)) for length in array.values.shape)
    return CArray(kind, base, shape, array.strides, array.name, choices=choices)


def _constant_record(
    record: str,
    values: Any,  # noqa: ANN401 (any named tuple)
    arrays: Mapping[str, CArray],
) -> CRecord:
    fields: dict[str, CNumber | CArray] = {
        name: arrays[f"hf_{record}_{name}"] if isinstance(value, np.ndarray) else known(value)
        for name, value in values._asdict().items()
    }
    return CRecord(record, fields, is_constant=True)


def _assembled(
    model: Model,
    fingers: Mapping[str, Sensor],
    rate: float,
    arrays: DetectorArrays,
    program: Program,
    calls: Mapping[str, str],
) -> CHeader:
    single = program.single
    functions = _reachable(program.definitions, [*calls.values()])
    used = "\n".join(functions)
    constants = [
        array
        for array in arrays.constant_arrays()
        if re.search(rf"\b{array.name}\b", used) or array.name == OFFSETS
    ]
    state = list(arrays.arrays())
    kinds = {array.name: _state_array(program, array).kind for array in state}
    sizes = {BOOL: 1, INTEGER: 8, REAL: 4 if single else 8, EXACT_TIME: 8}
    state_size = sum(max(x.values.size, 1) * sizes[kinds[x.name]] for x in state) + 16
    constants_size = sum(
        x.values.size * sizes[KIND_OF_DTYPE[x.values.dtype.kind]] for x in constants
    )
    sensors = model.fingers_of(fingers)
    parts = {
        "VERSION": version("holdfast"),
        "MODEL": re.sub(r"[^\w.:-]", "_", model.name or "model"),
        "MODEL_DIGEST": model.digest,
        "FINGERS": _named(sensors),
        "RATE": f"{model.rate or rate:.6g}",
        "PRECISION": "single, times double" if single else "double",
        "REAL": "float" if single else "double",
        "MATH": "name##f" if single else "name",
        "N_FINGERS": str(len(sensors)),
        "N_TAXELS": str(sum(sensor.n_taxels for sensor in sensors.values())),
        "ENUMS": "\n\n".join(_enums(sensors)),
        "STATE": "\n".join(
            f"    {C_TYPES[kinds[array.name]]} {array.name}[{max(array.values.size, 1)}];"
            for array in state
        ),
        "STATE_SIZE": str(state_size),
        "CONSTANTS": "\n\n".join(_constant(array, single=single) for array in constants),
        "CONSTANTS_SIZE": str(constants_size),
        "FUNCTIONS": "\n\n".join([*map(_struct, sorted(program.tuples)), *functions]),
        "INIT": "\n".join(
            line
            for array in state
            for line in _first_values(array, kinds[array.name], single=single)
        ),
        **calls,
    }
    text = (resources.files("holdfast.exporters") / "header_template.h").read_text("utf-8")
    for name, part in parts.items():
        text = text.replace(f"@{name}@", part)
    header_id = f"0x{sha256(text.encode()).hexdigest()[:8]}u"
    text = text.replace("@HEADER_ID@", header_id)
    return CHeader(text, state_size, constants_size, tuple(sorted(program.time_fields)))


def _plain(name: str) -> str:
    """Return a name without what would end a comment or a line."""
    return re.sub(r"[^\w ./:-]", "_", name, flags=re.ASCII).replace("*/", "__")


def _named(sensors: Mapping[str, Sensor]) -> str:
    parts = (
        f"{_plain(name)} ({_plain(sensor.name)}, {sensor.n_taxels} taxels)"
        for name, sensor in sensors.items()
    )
    return ", ".join(parts)


def _reachable(definitions: Sequence[str], roots: Sequence[str]) -> list[str]:
    """Return the functions that are called, in the same order."""
    kept: list[str] = []
    texts = list(roots)
    for definition in reversed(definitions):
        match = re.search(r"(hf_\w+)\(.*\)\n\{", definition)
        name = match[1] if match else ""
        if any(re.search(rf"\b{name}\(", text) for text in texts):
            kept.insert(0, definition)
            texts.append(definition)
    return kept


def _struct(kinds: str) -> str:
    members = " ".join(f"{C_TYPES[kind]} v{place};" for place, kind in enumerate(kinds))
    return f"typedef struct {{ {members} }} hf_tuple_{kinds};"


def _enums(sensors: Mapping[str, Sensor]) -> Iterator[str]:
    """Yield the names of fingers, states, reasons, faults, causes and columns, as enumerations."""
    first = np.cumsum([0, *(sensor.n_taxels for sensor in sensors.values())]).tolist()
    names = [re.sub(r"\W", "_", name, flags=re.ASCII).upper() for name in sensors]
    if len(set(names)) < len(names):
        names = [f"{place}" for place in range(len(names))]
    yield _enum("HOLDFAST_FINGER_", [(name, place) for place, name in enumerate(names)])
    yield _enum("HOLDFAST_FIRST_TAXEL_", list(zip(names, first, strict=False)))
    yield _enum("HOLDFAST_", [(state.name, state.code) for state in ContactState])
    yield _enum("HOLDFAST_REASON_", [(x.name, place) for place, x in enumerate(Reason)])
    faults = [(fault.name, 1 << place) for place, fault in enumerate(Fault)]
    yield _enum("HOLDFAST_FAULT_", faults)
    causes = [("NONE", 0), *((cause.name, place + 1) for place, cause in enumerate(Cause))]
    yield _enum("HOLDFAST_CAUSE_", causes)
    columns = [(name, getattr(rule_at, name)) for name in (*FRAME_COLUMNS, "REPORT_CODE")]
    own = [("STATUS_WIDTH", at.STATUS_WIDTH), ("TAXELS", at.TAXELS)]
    yield _enum("HF_", [*columns, *own])


def _enum(prefix: str, members: Sequence[tuple[str, int]]) -> str:
    lines = ",\n".join(f"    {prefix}{name} = {value}" for name, value in members)
    return f"enum {{\n{lines}\n}};"


def _constant(array: HeaderArray, *, single: bool) -> str:
    """Return the definition of a constant array."""
    values = array.in_memory.ravel()
    words = [literal(value, single=single) for value in values.tolist()] or ["0"]
    rows = [
        "    " + ", ".join(words[start : start + WORDS_OF_LINE])
        for start in range(0, len(words), WORDS_OF_LINE)
    ]
    kind = C_TYPES[KIND_OF_DTYPE[values.dtype.kind]]
    body = ",\n".join(rows)
    return f"static const {kind} {array.name}[{len(words)}] = {{\n{body}\n}};"


def _first_values(array: HeaderArray, kind: str, *, single: bool) -> Iterator[str]:
    """Yield the statements that set an array of the state to its first values."""
    name, flat = array.name, array.in_memory.ravel()
    n = max(flat.size, 1)
    common = flat[0].item() if flat.size else 0.0
    if kind == BOOL:
        yield f"    for (int f = 0; f < {n}; ++f) {{"
        yield f"        d->{name}[f] = {literal(bool(common), single=single)};"
        yield "    }"
        return
    yield f"    hf_fill_{kind}(d->{name}, {n}, {literal(common, single=single)});"
    for place, value in enumerate(flat):
        if value.tobytes() != flat[0].tobytes():
            yield f"    d->{name}[{place}] = {literal(value.item(), single=single)};"
