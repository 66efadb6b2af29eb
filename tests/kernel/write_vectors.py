"""Write vectors.h: tables of a small hand, samples, and what the Python kernel computes from them.

    python tests/kernel/write_vectors.py > tests/kernel/vectors.h

`check_vectors.c` holds the C kernel equal to them, without Python. Write them again only if the
mathematics change.
"""

import ctypes
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from holdfast.features import Tare, kernel
from holdfast.features.specs import RELATIVE_KINDS, FeatureSpec
from holdfast.features.stream import FeatureStream
from holdfast.features.tables import StreamPlan
from holdfast.sensors import Sensor
from kernel.c_kernel import Tables

RATE, N_SAMPLES, EVERY = 20.0, 260, 10
"""Samples per second [Hz], their number, and the distance of those whose features are written."""
LINE = 100


def plan():
    """Return a plan for two sensors with every kind of feature."""
    rng = np.random.default_rng(0)
    sensors = {}
    for name, n in {"thumb": 5, "index": 4}.items():
        axes = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
        axes[:, :, 0] *= np.linalg.det(axes)[:, None]
        sensors[name] = Sensor(
            name=name, positions=0.01 * rng.normal(size=(n, 3)), rotations=axes,
            normal=np.array([0.0, 0.6, 0.8]) if n == 5 else np.array([1.0, 0.0, 0.0]),
            rate=RATE, unit="count", range=(0.0, 65535.0),
        )  # fmt: skip
    force = (
        FeatureSpec("F_a", 0, "log", "hand", 20.0), FeatureSpec("F_x"), FeatureSpec("m", 6),
        FeatureSpec("sigma", 14, "noise"), FeatureSpec("sigma_xyz", 4, "log", "finger", 3.0),
        FeatureSpec("change", 10, "none", "hand"),
    )  # fmt: skip
    relative = tuple(
        FeatureSpec(kind, transform="relative", seconds=0.1) for kind in RELATIVE_KINDS
    )
    features = {"thumb": (*force, *relative), "index": (*relative[:9], *force)}
    return StreamPlan(sensors, features, 6, Tare.parse("0.5"), RATE, ignore={"thumb": [3]})


def samples():
    """Yield readings, present fingers and time: a hand closes, holds, slips, and has faults."""
    rng, time = np.random.default_rng(1), 5.0
    for k in range(N_SAMPLES):
        load = 200.0 * (20 < k < 170) * (1.0 + 0.3 * np.sin(0.9 * k) * (100 < k < 130))
        readings = 30_000 + np.rint(load * np.linspace(0.2, 1, 9)[:, None] * [0.3, -0.2, 1.0])
        readings += rng.integers(-2, 3, (9, 3))
        if 60 <= k < 75:
            readings[1, 2] = np.nan
        if 80 <= k < 84:
            readings[6] = 65535.0
        if k > 110:
            readings[2] = 30_007.0  # stuck
        if 200 <= k < 230:
            readings[:, 0] = 30_000.0 + 7 * (k % 3)  # repeated
            readings[:, 1:] = 30_001.0 + np.arange(18).reshape(9, 2) * (k % 3)
        time += 0.5 if k == 150 else 1 / RATE
        yield readings, np.array([k != 140, True]), time


def initializer(value):
    """Return a C initializer of a value of ctypes."""
    if isinstance(value, ctypes.Structure):
        parts = [initializer(getattr(value, name)) for name, _ in value._fields_]
        return f"{{{', '.join(parts)}}}"
    if isinstance(value, ctypes.Array):
        return f"{{{', '.join(map(initializer, value))}}}"
    if isinstance(value, bool):
        return str(value).lower()
    return real(value)


def number(value):
    """Return a C constant of a number, to the last bit."""
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value)).removesuffix(".0")


def real(value):
    """Return a C constant of a number that may be of single precision."""
    text = number(value)
    return text if text.lstrip("-").isdigit() else f"(hf_real){text}"


def array(kind, name, rows):
    """Return an array of C, of texts."""
    lines, line = [], ""
    for row in rows:
        if len(line) + len(row) + 2 > LINE and line:
            lines.append(line.rstrip())
            line = ""
        line += row + ", "
    return f"static const {kind} {name}[] = {{\n" + "\n".join([*lines, line.rstrip(", ")]) + "};\n"


def tables_text(tables):
    """Return the tables of a hand in C: sizes as macros, and `hand`."""
    arrays, hand = tables.arrays, tables.hand
    sizes = ("fingers", "lanes", "features", "lags", "history", "channels", "levels", "track")
    parts = ["#ifdef HOLDFAST_VECTORS_FIXED\n"]
    parts += [f"#define HOLDFAST_N_{s.upper()} {getattr(hand, f'n_{s}')}\n" for s in sizes]
    parts.append('#endif\n#include "kernel.c"\n\n')
    for kind in ("finger", "feature", "lag"):
        parts.append(array(f"holdfast_{kind}", f"{kind}s", map(initializer, arrays[f"{kind}s"])))
    for name in ("used", "rotations", "places"):
        parts.append(array("hf_real", name, map(real, arrays[name])))
    fields = [name for name, _ in hand._fields_]
    values = [name if name in arrays else initializer(getattr(hand, name)) for name in fields]
    parts.append(f"static const holdfast_hand hand = {{{', '.join(values)}}};\n")
    return "".join(parts)


def main():
    """Write the vectors."""
    stream = FeatureStream(plan())
    output, rows, status, features = stream.output, [], [], []
    for k, (readings, present, time) in enumerate(samples()):
        rows += [number(time), *map(str, present.astype(int))]
        rows += map(number, readings.ravel())
        kernel.advance(stream.layout, stream.memory, output, readings, present, time)
        status += map(str, output.status.ravel().tolist())
        if k % EVERY == 0:
            features += [
                number(float(v)) for v in [*output.features.ravel(), *output.values.ravel()]
            ]
    parts = [
        "/* Written by write_vectors.py; do not edit. */\n",
        tables_text(Tables(stream.layout, stream.memory, 4)),
        f"\nenum {{ N_SAMPLES = {N_SAMPLES}, EVERY = {EVERY} }};\n",
        "\n/* Of each sample: time, present fingers, readings (n_taxels, 3). */\n",
        array("double", "samples", rows),
        "\n/* Of each sample and finger: reason, faults, their taxels. */\n",
        array("long", "statuses", status),
        "\n/* Of each EVERY-th sample: features; force, F_a, m and sigma of each finger. */\n",
        array("double", "numbers", features),
    ]
    sys.stdout.write("".join(parts))


if __name__ == "__main__":
    main()
