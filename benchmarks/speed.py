"""Speed of the features and of the detector, beside other libraries and copying memory.

    python benchmarks/speed.py                          # half a minute
    python benchmarks/speed.py --samples 1000000 --json

Everything is measured in one run and given as ratios. The batch features are compared with a copy
of the same number of bytes, with PyWavelets, SciPy and tsflex; the update of a hand with PyWavelets
and scikit-learn. Libraries that are not installed are left out.
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

import numpy as np

from holdfast.detection import DEFAULT_WINDOW as WINDOW
from holdfast.detection import (
    DEPLOYED_FEATURES,
    Detector,
    FingerModel,
    Head,
    Linear,
    Model,
    haar_features,
    parse_features,
)
from holdfast.errors import DISTRIBUTION, is_installed
from holdfast.kernel.batch import fill_haar_features
from holdfast.sensors import sensor
from holdfast.sensors.types import Array

FINGERS = ("thumb", "index", "middle", "ring")
N_ROUNDS = 5
"""Number of rounds; each time is the median over them."""
N_PEER_SAMPLES = 2_000
"""Number of samples for libraries that need microseconds for each."""
N_PEER_UPDATES = 100

Task = Callable[[], object]


def benchmark(n_samples: int = 10_000_000, n_updates: int = 20_000) -> dict[str, Any]:
    """Measure everything that this program prints.

    Args:
        n_samples: samples of one finger for the batch features.
        n_updates: updates of a hand of four fingers with 30 taxels each.

    Returns:
        `machine`, `batch` and `hand_update`: seconds, and ratios of seconds.
    """
    return {"machine": machine(), "batch": batch(n_samples), "hand_update": hand_update(n_updates)}


def machine() -> dict[str, Any]:
    """Return the machine and the versions that the times depend on."""
    packages = (DISTRIBUTION, "numpy", "scikit-learn", "PyWavelets", "tsflex")
    return {
        "processor": platform.processor() or platform.machine(),
        "n_processors": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {name: _version(name) for name in packages},
    }


def batch(n_samples: int) -> dict[str, Any]:
    """Measure the features of many samples, a copy of the same bytes, and other libraries.

    The copy moves as many bytes as the features read and write (24 and 48 per sample) in one
    thread; it reads half of them and writes half.
    """
    force = np.random.default_rng(0).normal(size=(n_samples, 3))
    out = np.empty((n_samples, 6))
    source = np.ones(n_samples * 9 // 2)
    target = np.empty_like(source)
    seconds = _measure(
        {
            "features": lambda: fill_haar_features(force, WINDOW, out),
            "allocating": lambda: haar_features(force, WINDOW),
            "copy": lambda: np.copyto(target, source),
        }
    )
    per_sample = {name: value / n_samples for name, value in seconds.items()}
    peer_seconds = _measure(_peers(force[:N_PEER_SAMPLES]))
    peers = {name: value / N_PEER_SAMPLES for name, value in peer_seconds.items()}
    whole = _measure({"scipy": lambda: scipy_features(force)} if is_installed("scipy") else {})
    return {
        "n_samples": n_samples,
        "window": WINDOW,
        "seconds_per_sample": per_sample["features"],
        "seconds_per_sample_allocating": per_sample["allocating"],
        "seconds_per_sample_copy": per_sample["copy"],
        "ratio_to_copy": per_sample["features"] / per_sample["copy"],
        "speedup_over_scipy": whole["scipy"] / seconds["features"] if whole else None,
        **{
            f"speedup_over_{name}": peers[name] / per_sample["features"] if name in peers else None
            for name in ("pywt", "tsflex")
        },
    }


def hand_update(n_updates: int) -> dict[str, Any]:
    """Measure the time from a sample of a hand to its estimate [s]."""
    detector = Detector(_create_model())
    generator = np.random.default_rng(0)
    readings = generator.integers(32000, 34000, size=(1024, len(FINGERS), 30, 3)).astype(np.uint16)
    samples = [dict(zip(FINGERS, hand, strict=True)) for hand in readings]
    for k in range(200):
        detector.update(samples[k], k / 150)
    nanoseconds = np.empty(n_updates, dtype=np.int64)
    for k in range(n_updates):
        sample = samples[k % len(samples)]
        instant = (200 + k) / 150
        start = time.perf_counter_ns()
        detector.update(sample, instant)
        nanoseconds[k] = time.perf_counter_ns() - start
    p50, p99, p999 = (np.percentile(nanoseconds, [50, 99, 99.9]) * 1e-9).tolist()
    peer = _measure({"peer": lambda: _peer_updates(samples)})["peer"] / N_PEER_UPDATES
    return {
        "n_updates": n_updates,
        "n_fingers": len(FINGERS),
        "n_taxels": 30,
        "p50": p50,
        "p99": p99,
        "p999": p999,
        "mean": float(nanoseconds.mean()) * 1e-9,
        "seconds_pywt_sklearn": peer,
        "speedup_over_pywt_sklearn": peer / p50 if find_spec("pywt") else None,
    }


def _measure(tasks: Mapping[str, Task]) -> dict[str, float]:
    """Return the median time of each task [s]; the tasks run in turns."""
    seconds: dict[str, list[float]] = {name: [] for name in tasks}
    for task in tasks.values():
        task()
    for _ in range(N_ROUNDS):
        for name, task in tasks.items():
            start = time.perf_counter()
            task()
            seconds[name].append(time.perf_counter() - start)
    return {name: float(np.median(values)) for name, values in seconds.items()}


def _peers(force: Array) -> dict[str, Task]:
    peers: dict[str, Task] = {}
    if find_spec("pywt"):
        peers["pywt"] = lambda: pywt_loop(force)
    if find_spec("tsflex") and find_spec("pandas"):
        peers["tsflex"] = tsflex_task(force)
    return peers


def pywt_loop(force: Array) -> Array:
    """Compute the features as a script does: `pywt.dwt` on every window."""
    import pywt

    amplitude = np.linalg.norm(force, axis=1)
    out = np.full((len(force), 6), np.nan)
    for k in range(WINDOW - 1, len(force)):
        a, d = pywt.dwt(amplitude[k - WINDOW + 1 : k + 1], "haar")
        sigma = np.sqrt(((d - d.mean()) ** 2).sum() / WINDOW)
        out[k] = amplitude[k], *force[k], a.sum() / WINDOW, sigma
    return out


def tsflex_task(force: Array) -> Task:
    """Return a task that computes m and sigma with tsflex."""
    import pandas as pd
    from tsflex.features import FeatureCollection, FeatureDescriptor, FuncWrapper

    def moments(x: Array) -> tuple[float, float]:
        d = (x[::2] - x[1::2]) / np.sqrt(2)
        return x.sum() / np.sqrt(2) / WINDOW, np.sqrt(((d - d.mean()) ** 2).sum() / WINDOW)

    wrapped = FuncWrapper(moments, output_names=["m", "sigma"])
    collection = FeatureCollection(FeatureDescriptor(wrapped, "F_a", window=WINDOW, stride=1))

    def run() -> object:
        series = pd.Series(np.linalg.norm(force, axis=1), name="F_a")
        return collection.calculate(series, n_jobs=1, show_progress=False)

    return run


def scipy_features(force: Array) -> Array:
    """Compute the features with filters of scipy.ndimage over whole arrays."""
    from scipy.ndimage import correlate1d

    amplitude = np.linalg.norm(force, axis=1)
    details = np.empty_like(amplitude)
    details[0] = 0.0
    details[1:] = (amplitude[:-1] - amplitude[1:]) / np.sqrt(2)
    every_other = np.zeros(WINDOW - 1)
    every_other[::2] = 1.0
    half = WINDOW // 2
    back = {"mode": "constant", "origin": half - 1}
    sums = correlate1d(details, every_other, **back)
    squares = correlate1d(details**2, every_other, **back)
    sigma = np.sqrt(np.maximum(squares - sums**2 / half, 0.0) / WINDOW)
    m = correlate1d(amplitude, np.ones(WINDOW), **back) / (np.sqrt(2) * WINDOW)
    return np.column_stack([amplitude, force, m, sigma])


def _create_model() -> Model:
    """Return a model of the usual shape; its numbers have no effect on the speed."""
    features = parse_features(DEPLOYED_FEATURES, WINDOW)
    ones = np.ones(len(features))
    rule = Linear.of(ones, ones, 0.01 * ones, 0.1)
    head = Head(name="stable", link="logit", features=features, rule=rule)
    tip = sensor("uskin-curved")
    finger = FingerModel(heads=(head,), sensor=tip.name, contact_threshold=20.0)
    return Model(fingers=dict.fromkeys(FINGERS, finger), sensors={tip.name: tip}, rate=150.0)


def _peer_updates(samples: list[dict[str, Any]]) -> float:
    """Update a hand as a script does, with NumPy, `pywt.dwt` and `predict_proba`."""
    if not find_spec("pywt"):
        return 0.0
    import pywt

    pipeline = _create_pipeline()
    rotations = sensor("uskin-curved").rotations
    amplitudes = {finger: np.ones(WINDOW) for finger in FINGERS}
    total = 0.0
    for k in range(N_PEER_UPDATES):
        for finger, sample in samples[k].items():
            force = np.einsum("tij,tj->i", rotations, sample.astype(np.float64))
            window = amplitudes[finger]
            window[:-1] = window[1:]
            window[-1] = np.linalg.norm(force)
            _, d = pywt.dwt(window, "haar")
            sigma = np.sqrt(((d - d.mean()) ** 2).sum() / WINDOW)
            features = np.array([[window[-1], *force, sigma]])
            total += pipeline.predict_proba(features)[0, 1]
    return total


def _create_pipeline() -> Any:
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    generator = np.random.default_rng(0)
    features = generator.normal(size=(200, 5))
    return make_pipeline(StandardScaler(), LogisticRegression()).fit(features, features[:, 0] > 0)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def print_report(report: dict[str, Any]) -> None:
    """Print the figures as text."""
    batch = report["batch"]
    print(f"batch features of {batch['n_samples']:,} samples, window {batch['window']}")
    print(f"  {1e9 * batch['seconds_per_sample']:.1f} ns a sample")
    print(f"  {batch['ratio_to_copy']:.2f} times as long as copying the same bytes")
    for peer in ("pywt", "scipy", "tsflex"):
        print_speedup(peer, batch[f"speedup_over_{peer}"])
    update = report["hand_update"]
    print(f"\nupdate of a hand, {update['n_fingers']} fingers of {update['n_taxels']} taxels")
    print("  " + ", ".join(f"{p} {1e6 * update[p]:.1f} us" for p in ("p50", "p99", "p999")))
    print_speedup("pywt + scikit-learn", update["speedup_over_pywt_sklearn"])


def print_speedup(peer: str, ratio: float | None) -> None:
    """Print how many times faster than a library the kernel is; None if it is not installed."""
    print(f"  {ratio:,.0f} times faster than {peer}" if ratio else f"  {peer}: not installed")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=10_000_000, help="of the batch features")
    parser.add_argument("--updates", type=int, default=20_000, help="of a hand")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    if options.samples < 1000 or options.updates < 1000:
        parser.error("at least 1000 samples and updates expected")
    report = benchmark(options.samples, options.updates)
    if options.json:
        print(json.dumps(report))
    else:
        print_report(report)


if __name__ == "__main__":
    main()
