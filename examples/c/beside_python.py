"""Run a header beside `Detector`, by ctypes, and print the largest difference.

python examples/c/beside_python.py
"""

import ctypes
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import holdfast
from holdfast.exporters import header_of
from holdfast.synthetic import synthetic_recording


def compiled(text: str, folder: Path) -> ctypes.CDLL:
    """Return a header as a library: -DHOLDFAST_API=extern gives its functions names outside."""
    (folder / "model.h").write_text(text)
    words = ["cc", "-std=c99", "-O2", "-shared", "-fPIC", "-DHOLDFAST_API=extern"]
    files = ["-x", "c", folder / "model.h", "-o", folder / "model.so", "-lm"]
    subprocess.run([*words, *files], check=True)
    return ctypes.CDLL(str(folder / "model.so"))


def main() -> None:
    """Compare both over a synthetic grasp."""
    recording = synthetic_recording("grasp", seed=1)
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    model = holdfast.Model.load("builtin:twin")
    detector = holdfast.Detector(model, sensors, recording.rate)
    finger = np.dtype(
        [
            ("time", "f8"), ("state", "i4"), ("reason", "i4"), ("cause", "i4"), ("faults", "u4"),
            ("faulty_taxels", "u8", (1,)), ("stable_probability", "f8"), ("slip_probability", "f8"),
            ("slip_speed", "f8"), ("slip_distance", "f8"), ("instability", "f8"),
            ("force", "f8", 3),
        ],
        align=True,
    )  # fmt: skip
    hand = np.dtype([("time", "f8"), ("state", "i4"), ("finger", finger, len(sensors))], align=True)
    estimate = np.zeros((), dtype=hand)
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(header_of(model, sensors, recording.rate).text, Path(folder))
        library.holdfast_size.restype = ctypes.c_size_t
        memory = ctypes.create_string_buffer(library.holdfast_size())
        library.holdfast_init(memory)
        largest, n_other = 0.0, 0
        for k, time in enumerate(recording.modules["index"].times.tolist()):
            samples = {name: module.readings[k] for name, module in recording.modules.items()}
            readings = np.concatenate([*samples.values()]).astype(np.float64)
            library.holdfast_update(
                memory, ctypes.c_double(time), readings.ctypes.data_as(ctypes.c_void_p),
                estimate.ctypes.data_as(ctypes.c_void_p),
            )  # fmt: skip
            for own, other in zip(
                detector.update(samples, time).fingers.values(), estimate["finger"], strict=True
            ):
                n_other += own.state.code != other["state"]
                apart = abs(own.stable_probability - other["stable_probability"])
                largest = max(largest, 0.0 if np.isnan(apart) else float(apart))
    print(f"{k + 1} samples: {n_other} states differ, probabilities by at most {largest:.1g}")


if __name__ == "__main__":
    main()
