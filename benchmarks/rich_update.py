"""Updates of a hand by builtin:twin (15 features) and by the paper's deployed model, in turns.

python benchmarks/rich_update.py [UPDATES]
"""

import sys
import time

import numpy as np

from holdfast.classifiers import LinearClassifier
from holdfast.detector import Detector
from holdfast.features import DEPLOYED_FEATURES, parse_features
from holdfast.model import FingerModel, Model
from holdfast.sensors import sensor

FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
ROUNDS = 20
N_WARM = 200


def deployed() -> Model:
    """A model of the paper's shape for any finger; its numbers do not matter here."""
    features = parse_features(DEPLOYED_FEATURES, 14)
    ones = (1.0,) * len(features)
    rule = LinearClassifier(mean=ones, scale=ones, coefficients=(0.01,) * len(ones), intercept=0.1)
    finger = FingerModel(features=features, classifier=rule, contact_threshold=20.0)
    return Model(fingers={"*": finger}, rate=RATE)


def main(n_updates: int) -> None:
    tip = sensor("uskin-curved")
    rng = np.random.default_rng(0)
    readings = rng.integers(32000, 34000, size=(1024, len(FINGERS), 30, 3)).astype(np.uint16)
    samples = [dict(zip(FINGERS, hand, strict=True)) for hand in readings]
    models = {"the paper's": deployed(), "builtin:twin": Model.load("builtin:twin")}
    detectors = {
        name: Detector(model, dict.fromkeys(FINGERS, tip)) for name, model in models.items()
    }
    took: dict[str, list[int]] = {name: [] for name in models}
    done = 0
    for part in [N_WARM, *[n_updates // ROUNDS] * ROUNDS]:
        for name, detector in detectors.items():
            for k in range(done, done + part):
                start = time.perf_counter_ns()
                detector.update(samples[k % len(samples)], k / RATE)
                took[name].append(time.perf_counter_ns() - start)
        done += part
    for name, nanoseconds in took.items():
        p50, p99 = np.percentile(nanoseconds[N_WARM:], [50, 99]) / 1e3
        print(f"{name}: p50 {p50:.1f} us, p99 {p99:.1f} us of {n_updates} updates")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000)
