"""The C kernel as a library of its own, and its tables from those of the Python kernel."""

import ctypes
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from holdfast.features import arrays as at
from holdfast.features import kernel
from holdfast.features.specs import VALUE_KINDS

SOURCES = Path(kernel.__file__).parents[1] / "kernel"
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
TYPES = {
    "size_t": ctypes.c_size_t, "hf_real": ctypes.c_double, "double": ctypes.c_double,
    "bool": ctypes.c_bool, "uint8_t": ctypes.c_uint8, "int32_t": ctypes.c_int32,
    "uint32_t": ctypes.c_uint32, "int64_t": ctypes.c_int64, "uint64_t": ctypes.c_uint64,
}  # fmt: skip


def _structures():
    """Return the structs of kernel.h as classes for ctypes: the header is the only definition."""
    text = re.sub(r"/\*.*?\*/", "", (SOURCES / "kernel.h").read_text(), flags=re.DOTALL)
    made = dict(TYPES)
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", text, flags=re.DOTALL):
        fields = []
        for line in filter(None, (" ".join(part.split()) for part in body.split(";"))):
            if array := re.match(r"HF_ARRAY\( ?\w+, (\w+),", line):
                fields.append((array[1], ctypes.c_void_p))
            elif pointer := re.match(r"const \w+ \*(\w+)$", line):
                fields.append((pointer[1], ctypes.c_void_p))
            else:
                kind, field, _, length = re.match(r"(\w+) (\w+)(\[(\d+)\])?$", line).groups()
                fields.append((field, made[kind] * int(length) if length else made[kind]))
        made[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return made


STRUCTURES = _structures()


def compiled(folder, *options, lanes=4, compiler="cc"):
    """Compile the kernel to a library in a folder, and load it.

    Args:
        folder: that is written to.
        options: of the compiler.
        lanes: in which the taxels are added up; with 1 in the order of the Python kernel.
        compiler: the command.
    """
    path = Path(folder) / "kernel.so"
    words = ["-std=c99", "-O2", "-ffp-contract=off", *WARNINGS, *options, "-shared", "-fPIC"]
    command = [shutil.which(compiler), *words, "-DHF_API=extern", f"-DHF_LANES={lanes}"]
    subprocess.run([*command, SOURCES / "kernel.c", "-o", path, "-lm"], check=True)
    library = ctypes.CDLL(str(path))
    library.lanes = lanes
    library.holdfast_check.restype = ctypes.c_char_p
    library.holdfast_memory_size.restype = ctypes.c_size_t
    return library


class Tables:
    """`holdfast_hand` with the numbers of a `Layout`, and what it points to."""

    def __init__(self, layout, memory, lanes):
        self.layout, self.arrays, n_fingers = layout, {}, len(layout.windows)
        self._n_lanes = -(-layout.n_taxels // lanes) * lanes  # of each finger
        lanes = np.cumsum([0, *self._n_lanes])
        hand = self.hand = STRUCTURES["holdfast_hand"]()
        hand.n_fingers, hand.n_lanes = n_fingers, lanes[-1]
        hand.n_features, hand.n_lags = layout.specs.shape[1], len(layout.lags)
        hand.n_history = memory.blocks.shape[1]
        hand.n_channels = memory.blocks.shape[2] // (3 * layout.n_levels)
        hand.n_levels, hand.n_track = layout.n_levels, len(memory.taxel_forces)
        for name in (
            "period", "tare_kind", "tare_seconds", "noise_seconds", "average_gain", "alike",
            "has_centres", "has_ratios",
        ):  # fmt: skip
            setattr(hand, name, getattr(layout, name))
        hand.fingers = self._place("fingers", (STRUCTURES["holdfast_finger"] * n_fingers)())
        for f, finger in enumerate(self.arrays["fingers"]):
            self._fill_finger(finger, f, lanes)
        n_rows = n_fingers * hand.n_features
        hand.features = self._place("features", (STRUCTURES["holdfast_feature"] * n_rows)())
        for index, feature in enumerate(self.arrays["features"]):
            self._fill_feature(feature, *divmod(index, hand.n_features))
        hand.lags = self._place("lags", (STRUCTURES["holdfast_lag"] * max(1, hand.n_lags))())
        for lag, samples, seconds, families in zip(
            self.arrays["lags"], layout.lags, layout.lag_seconds, layout.families, strict=False
        ):
            lag.samples, lag.seconds = samples, seconds
            lag.has_changes, lag.has_seconds, lag.has_means, lag.has_ratios = map(bool, families)
        for name, values in (
            ("used", ~layout.ignored), ("rotations", layout.rotations), ("places", layout.places)
        ):  # fmt: skip
            setattr(hand, name, self._place(name, self._in_lanes(values)))

    def _in_lanes(self, values):
        """Return values of all taxels (n_taxels, ...) as those of lanes: by finger (..., lanes)."""
        parts = []
        for first, n, lanes in zip(
            self.layout.offsets, self.layout.n_taxels, self._n_lanes, strict=False
        ):
            own = values[first : first + n].reshape(n, -1).T
            parts.append(np.pad(own, ((0, 0), (0, lanes - n))).ravel())
        return np.concatenate(parts).astype(np.float64)

    def _place(self, name, array):
        self.arrays[name] = array
        return array.ctypes.data if isinstance(array, np.ndarray) else ctypes.addressof(array)

    def _fill_finger(self, finger, f, lanes):
        layout = self.layout
        finger.first_taxel, finger.n_taxels = layout.offsets[f], layout.n_taxels[f]
        finger.first = lanes[f]
        for column, name in (
            (at.LOW_LIMIT, "low"), (at.HIGH_LIMIT, "high"), (at.LOW_END, "low_end"),
            (at.HIGH_END, "high_end"), (at.MAX_OFFSET, "max_offset"), (at.MIN_NOISE, "min_noise"),
            (at.ROUNDING_NOISE, "rounding_noise"), (at.N_USED, "n_used"), (at.MAX_STEP, "max_step"),
        ):  # fmt: skip
            setattr(finger, name, layout.constants[f, column])
        finger.normal[:] = layout.normals[f]
        finger.bridges = layout.windows[f, at.BRIDGES]
        finger.sigma_window = layout.windows[f, at.SIGMA_WINDOW]
        finger.ready_window = layout.windows[f, at.READY_WINDOW]

    def _fill_feature(self, feature, f, place):
        kind, window, transform, scope, same_as = self.layout.specs[f, place].tolist()
        feature.kind, feature.floor = kind, self.layout.floors[f, place]
        if kind >= 0:
            is_relative = kind >= len(VALUE_KINDS)
            feature.window, feature.lag = (0, window) if is_relative else (window, 0)
            feature.transform = 0 if is_relative else transform
            feature.of_hand, feature.same_as = scope == 1, same_as


class CStream:
    """Stream of the C kernel, with the tables and the baseline of a Python stream."""

    def __init__(self, library, stream):
        self._library, layout = library, stream.layout
        self.tables = Tables(layout, stream.memory, library.lanes)
        self.address = ctypes.byref(self.tables.hand)
        wrong = library.holdfast_check(self.address)
        if wrong:
            raise ValueError(wrong.decode())
        size = library.holdfast_memory_size(self.address)
        self._block = ctypes.create_string_buffer(size + 64)
        self.memory = STRUCTURES["holdfast_memory"]()
        start = ctypes.addressof(self._block)
        aligned = ctypes.c_void_p(start + -start % 64)
        library.holdfast_place(self.address, ctypes.byref(self.memory), aligned)
        baseline = np.ascontiguousarray(stream.memory.baseline)
        library.holdfast_begin(self.address, ctypes.byref(self.memory), _pointer(baseline))
        n_fingers, width = len(layout.windows), layout.specs.shape[1]
        values = STRUCTURES["holdfast_values"] * n_fingers
        self.values = values.from_address(self.memory.values)
        features = (ctypes.c_double * (n_fingers * width)).from_address(self.memory.features)
        self.features = np.frombuffer(features).reshape(n_fingers, width)

    def advance(self, readings, present, time):
        """Process a sample, as `kernel.advance` does."""
        self._library.holdfast_advance(
            self.address, ctypes.byref(self.memory), _pointer(readings), _pointer(present),
            ctypes.c_double(time),
        )  # fmt: skip

    def results(self):
        """Return features, values and status, as the arrays of an `Output`."""
        values = [[*v.force, v.amplitude, v.m, v.sigma] for v in self.values]
        status = [[v.reason, v.faults, v.taxels] for v in self.values]
        return self.features.copy(), np.array(values), np.array(status, dtype=np.int64)


def _pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def close(got, expected, tolerance):
    """Return which numbers are equal, within a share of those above 1; NaN is equal to NaN."""
    with np.errstate(invalid="ignore"):
        near = np.abs(got - expected) <= tolerance * np.maximum(1.0, np.abs(expected))
    return near | (got == expected) | (np.isnan(got) & np.isnan(expected))


def difference(library, stream, samples, tolerance=0.0):
    """Return the first sample at which both kernels differ, as text; and the samples compared.

    Args:
        library: the C kernel.
        stream: before its first sample.
        samples: of readings (n_taxels, 3), present (n_fingers) and time.
        tolerance: of numbers. Reasons, faults and their taxels must be equal.
    """
    c, output, n = CStream(library, stream), stream.output, 0
    for n, (readings, present, time) in enumerate(samples, 1):
        c.advance(np.ascontiguousarray(readings), present, time)
        kernel.advance(stream.layout, stream.memory, output, readings.copy(), present, time)
        features, values, status = c.results()
        for name, got, expected in (
            ("status", status, output.status), ("values", values, output.values),
            ("features", features, output.features),
        ):  # fmt: skip
            fits = close(got, expected, 0.0 if name == "status" else tolerance)
            if not fits.all():
                first = tuple(np.argwhere(~fits)[0])
                where = f"{name}{[int(i) for i in first]} of sample {n - 1} at {time:.17g} s"
                return f"{where}: {got[first]!r} in C, {expected[first]!r} expected", n
    return None, n
