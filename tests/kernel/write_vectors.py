"""Write vectors.h: the tables of a small hand and its model, samples, and estimates of them.

    python tests/kernel/write_vectors.py > vectors.h

`check_vectors.c` holds a kernel of any compiler equal to them, without Python.
"""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))


from detection.detector.build import cause_head, finger_model, speed_head, squared_head
from holdfast.contact import Cause
from holdfast.detection import Debounce, Model
from holdfast.detection.c_header import Tables, kernel_text
from holdfast.detection.kernel_config import packed, stream_config
from holdfast.detection.specs import RELATIVE_KINDS, FeatureSpec
from holdfast.detection.traces import EstimateTypes
from holdfast.kernel.structs import struct_type
from holdfast.sensors import Sensor
from kernel.extension import extension

RATE, N_SAMPLES, EVERY = 30.0, 260, 10
"""Samples per second [Hz], their number, and the distance of those whose features are written."""
LINE = 100
CODES = ("state", "reason", "cause", "faults", "faulty_taxels")
NUMBERS = (
    "stable_probability", "slip_probability", "slip_speed", "slip_distance", "instability",
)  # fmt: skip


def model():
    """Return a model of two sensors with every kind of feature and of head."""
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
    fingers = {
        "thumb": finger_model((*force, *relative), 1, sensor="thumb", contact_load=3.0),
        "index": finger_model((*relative[:9], *force), 2, sensor="index", contact_noise=8.0),
    }
    for name, part in fingers.items():
        slip = squared_head(part.features, 3)
        causes = cause_head(part.features, 4, (Cause.CLOSING, Cause.DISTURBANCE, Cause.GLITCH))
        fingers[name] = part.with_heads(slip, speed_head(slip), causes)
    debounce = Debounce(min_duration=0.08, hold=0.1, hysteresis=0.05, switching=15.0)
    return Model(
        fingers=fingers, sensors=sensors, rate=RATE, window=6, tare="0.5", debounce=debounce
    )


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


def number(value):
    """Return a C constant of a number, to the last bit."""
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value)).removesuffix(".0")


def array(kind, name, rows):
    """Return an array of C, of texts."""
    lines, line = [], ""
    for row in rows:
        if len(line) + len(row) + 2 > LINE and line:
            lines.append(line.rstrip())
            line = ""
        line += row + ", "
    return f"static const {kind} {name}[] = {{\n" + "\n".join([*lines, line.rstrip(", ")]) + "};\n"


def estimates_of(used, plan, rows):
    """Return what the kernel computes: features, and estimates of the fingers."""
    readings, present, times = (np.array(column) for column in zip(*rows, strict=True))
    config = *packed(stream_config(plan)), plan.baseline.tobytes()
    features = np.empty((*present.shape, plan.width))
    extension.Stream(*config).advance(readings, present, times, features, np.empty(present.shape))
    indices = {name: index for index, name in enumerate(plan.fingers)}
    types = EstimateTypes(indices, lambda change: None)
    kernel = extension.Detector(*config, *packed(used.config(plan)), types)
    estimates = np.zeros(present.shape, struct_type("holdfast_finger_estimate"))
    hand = np.empty(len(times))
    kernel.run(readings, present, times, estimates.view(np.float64), hand)
    return features, estimates, hand


def main():
    """Write the vectors."""
    used = model()
    plan = replace(used.plan(used.sensors, RATE), ignore={"thumb": [3]})
    rows = list(samples())
    features, estimates, hand = estimates_of(used, plan, rows)
    made = Tables(kernel_text(), used, plan, single=False)
    given, codes, numbers = [], [], []
    for k, (readings, present, time) in enumerate(rows):
        given += [number(time), *map(str, present.astype(int)), *map(number, readings.ravel())]
        codes += [str(int(hand[k]))]
        for row in estimates[k]:
            codes += [str(int(np.ravel(row[name])[0])) for name in CODES]
            if k % EVERY == 0:
                numbers += [number(float(row[name])) for name in NUMBERS]
                numbers += map(number, row["force"].tolist())
        if k % EVERY == 0:
            numbers += map(number, features[k].ravel().tolist())
    parts = [
        "/* Written by write_vectors.py. */\n",
        "#ifdef HOLDFAST_VECTORS_FIXED\n",
        *(f"#define HOLDFAST_{name.upper()} {n}\n" for name, n in made.sizes.items()),
        '#endif\n#ifdef HOLDFAST_VECTORS_LINKED\n#include "holdfast.h"\n',
        '#else\n#include "holdfast.c"\n#endif\n\n',
        re.sub(r"-?\d+\.\d+(e[+-]?\d+)?", r"(hf_real)\g<0>", "\n".join(made.texts)),
        f"\n\nenum {{ N_SAMPLES = {N_SAMPLES}, EVERY = {EVERY} }};\n",
        "\n/* Of each sample: time, present fingers, readings (n_taxels, 3). */\n",
        array("double", "samples", given),
        "\n/* Of each sample: state of the hand; of each finger state, reason, cause, faults and\n",
        " * their taxels. */\n",
        array("long", "codes", codes),
        "\n/* Of each EVERY-th sample: of each finger probability, slip, speed, distance, sigma,\n",
        " * force; then all features. */\n",
        array("double", "numbers", numbers),
    ]
    sys.stdout.write("".join(parts))


if __name__ == "__main__":
    main()
