"""Speed, sizes and parity of the exported header.

    python benchmarks/c_header.py [--samples 1000000] [--updates 200000]

Speed: the median over blocks of 100 updates of a hand of 4 x 30 taxels, whose readings are random,
at -O2, the models in turns; and `Detector.update` in the same run. Symbols: what `nm` lists of a
compiled header, functions from outside and data that can change. Parity: random samples with
gaps, NaN, faults, clock jumps and lost fingers, by the header and by `Detector`; all bits must be
equal.
"""

import argparse
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from detection.c_detector import both, compare, random_samples  # noqa: E402
from holdfast.detection import (  # noqa: E402
    DEPLOYED_FEATURES,
    Detector,
    FingerModel,
    Head,
    Linear,
    Model,
    parse_features,
)
from holdfast.detection.c_header import header_of  # noqa: E402
from holdfast.sensors import sensor  # noqa: E402

FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
BARS = {"paper": 0.5, "builtin:twin": 3.0, "builtin:any": 4.0}
"""Goals of an update in C [us]."""
N_ROUNDS, BLOCK = 5, 100
MAIN = """
#define _POSIX_C_SOURCE 199309L
#include "model.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
static holdfast_detector d;
static holdfast_real r[1024][HOLDFAST_N_TAXELS][3];
static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
int main(int n, char **words) {
    holdfast_estimate e;
    holdfast_init(&d);
    for (int k = 0; k < 1024; ++k)
        for (int i = 0; i < HOLDFAST_N_TAXELS; ++i)
            for (int a = 0; a < 3; ++a) r[k][i][a] = 32000 + rand() % 2000;
    const long n_blocks = n > 1 ? atol(words[1]) : 1;
    for (long b = 0, k = 0; b < n_blocks; ++b) {
        const double start = seconds();
        for (int j = 0; j < BLOCK; ++j, ++k)
            if (holdfast_update(&d, (double)k / 150.0, r[k % 1024], &e) != 0) return 1;
        printf("%.17g\\n", (seconds() - start) / BLOCK);
    }
    return 0;
}
"""


def paper_model() -> Model:
    """Return a model with the features of the paper; its numbers have no effect on the speed."""
    features = parse_features(DEPLOYED_FEATURES, 14)
    ones = np.ones(len(features))
    rule = Linear.of(ones, ones, 0.01 * ones, 0.1)
    stable = Head(name="stable", link="logit", features=features, rule=rule)
    finger = FingerModel(heads=(stable,), contact_threshold=20.0)
    return Model(fingers={"*": finger}, rate=RATE)


def models() -> dict[str, Model]:
    """Return the models by name."""
    return {"paper": paper_model(), **{name: Model.load(name) for name in list(BARS)[1:]}}


def symbols(text: str) -> str:
    """Return what a compiled header calls from outside, and the data in it that can change."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "model.h").write_text(text)
        words = ["-std=c99", "-O2", "-fno-pic", "-DHOLDFAST_API=extern", "-x", "c", "-c", "model.h"]
        subprocess.run(["cc", *words, "-o", "model.o"], check=True, cwd=folder)
        done = subprocess.run(["nm", "model.o"], check=True, capture_output=True, cwd=folder)
        size = subprocess.run(
            ["size", "-A", "model.o"], check=True, capture_output=True, cwd=folder
        )
    listed = [line.split()[-2:] for line in done.stdout.decode().splitlines()]
    outside = [name for kind, name in listed if kind == "U" and not name.startswith("_")]
    changing = [name for kind, name in listed if kind in "BbDdC"]
    sections = [line.split() for line in size.stdout.decode().splitlines()]
    code = sum(int(words[1]) for words in sections if words and words[0].startswith(".text"))
    data = ", ".join(changing) or "none"
    return f"code {code} bytes; calls {', '.join(outside)}; data that can change: {data}"


def programs(folder: Path, hand) -> dict[tuple[str, str], Path]:
    """Compile the loop for each model and compiler, and print the sizes."""
    made = {}
    for name, model in models().items():
        for single in (False, True):
            header = header_of(model, hand, RATE, single=single)
            kind = "float" if single else "double"
            print(f"{name}, {kind}: state {header.state_size}, constants {header.constants_size}, "
                  f"{symbols(header.text)}")  # fmt: skip
            for compiler in filter(shutil.which, ("gcc", "clang")):
                build = folder / f"{name.split(':')[-1]}-{kind}-{compiler}"
                build.mkdir()
                (build / "model.h").write_text(header.text)
                (build / "main.c").write_text(MAIN)
                words = ["-std=c99", "-O2", "-ffp-contract=off", f"-DBLOCK={BLOCK}"]
                files = [build / "main.c", "-o", build / "run", "-lm"]
                subprocess.run([compiler, *words, *files], check=True)
                made[name, f"{compiler} -O2 {kind}"] = build / "run"
    return made


def measure(n_updates: int, hand) -> None:
    """Print the time of an update, of C and of Python in turns."""
    rng = np.random.default_rng(0)
    counts = rng.integers(32000, 34000, size=(256, len(hand), 30, 3)).astype(np.uint16)
    samples = [dict(zip(hand, sample, strict=True)) for sample in counts]
    with TemporaryDirectory() as folder:
        made = programs(Path(folder), hand)
        detectors = {name: Detector(model, hand) for name, model in models().items()}
        costs: dict[tuple[str, str], list[float]] = {key: [] for key in made}
        costs |= {(name, "Detector.update"): [] for name in detectors}
        n_blocks = n_updates // BLOCK // N_ROUNDS
        for part in range(N_ROUNDS):
            for key, program in made.items():
                out = subprocess.run([program, str(n_blocks)], check=True, capture_output=True)
                costs[key] += map(float, out.stdout.split())
            for name, detector in detectors.items():
                for k in range(part * n_blocks * 10, (part + 1) * n_blocks * 10):
                    start = time.perf_counter()
                    detector.update(samples[k % 256], k / RATE)
                    costs[name, "Detector.update"].append(time.perf_counter() - start)
    print(f"load of the machine {os.getloadavg()[0]:.1f}, {os.cpu_count()} processors")
    for (name, kind), values in sorted(costs.items()):
        low, middle, high = 1e6 * np.percentile(values, [5, 50, 99])
        print(f"{name:13} {kind:18} p5 {low:6.2f}  p50 {middle:6.2f}  p99 {high:8.2f} us"
              f"  (goal in C {BARS[name]})")  # fmt: skip


def fuzz(n_samples: int, hand) -> None:
    """Compare header and `Detector` over random samples, a third of them for each model."""
    for name, model in models().items():
        python, c = both(model, hand, RATE)
        n = n_samples // len(BARS)
        for readings, when in random_samples(np.random.default_rng(0), hand, RATE, n):
            compare(python, c, readings, when)
        print(f"{name}: {n} random samples are equal")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--updates", type=int, default=200_000)
    options = parser.parse_args()
    hand = dict.fromkeys(FINGERS, sensor("uskin-curved"))
    measure(options.updates, hand)
    fuzz(options.samples, hand)


if __name__ == "__main__":
    main()
