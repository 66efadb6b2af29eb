"""Time of an update of a hand with the models that ship and with the model of the paper.

The models run in turns. The time is that from four arrays of counts to the estimates of the hand
and of its fingers.

    python benchmarks/rich_update.py [UPDATES] [--model FILE ...]
"""

import argparse
import time
from collections.abc import Sequence

import numpy as np

from holdfast.classifiers import Linear
from holdfast.detector import Detector
from holdfast.features import DEPLOYED_FEATURES, parse_features
from holdfast.model import FingerModel, Head, Model
from holdfast.sensors import sensor

FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
N_ROUNDS = 20
N_WARM_UP = 200


def paper_model() -> Model:
    """Return a model with the features of the paper; its numbers have no effect on the speed."""
    features = parse_features(DEPLOYED_FEATURES, 14)
    ones = np.ones(len(features))
    rule = Linear.of(ones, ones, 0.01 * ones, 0.1)
    stable = Head(name="stable", link="logit", features=features, rule=rule)
    finger = FingerModel(heads=(stable,), contact_threshold=20.0)
    return Model(fingers={"*": finger}, rate=RATE)


def main(n_updates: int, files: Sequence[str]) -> None:
    tip = sensor("uskin-curved")
    rng = np.random.default_rng(0)
    readings = rng.integers(32000, 34000, size=(1024, len(FINGERS), 30, 3)).astype(np.uint16)
    samples = [dict(zip(FINGERS, hand, strict=True)) for hand in readings]
    shipped = ("builtin:twin", "builtin:any", *files)
    models = {"model of the paper": paper_model(), **{name: Model.load(name) for name in shipped}}
    detectors = {
        name: Detector(model, dict.fromkeys(FINGERS, tip)) for name, model in models.items()
    }
    times: dict[str, list[int]] = {name: [] for name in models}
    n_done = 0
    for n in [N_WARM_UP, *[n_updates // N_ROUNDS] * N_ROUNDS]:
        for name, detector in detectors.items():
            for k in range(n_done, n_done + n):
                start = time.perf_counter_ns()
                detector.update(samples[k % len(samples)], k / RATE)
                times[name].append(time.perf_counter_ns() - start)
        n_done += n
    for name, nanoseconds in times.items():
        p50, p99, p999 = np.percentile(nanoseconds[N_WARM_UP:], [50, 99, 99.9]) / 1e3
        print(f"{name}: p50 {p50:.1f}, p99 {p99:.1f}, p99.9 {p999:.1f} us of {n_updates} updates")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("updates", type=int, nargs="?", default=20_000)
    parser.add_argument("--model", nargs="*", default=[], metavar="FILE", help="other models")
    given = parser.parse_args()
    main(given.updates, given.model)
