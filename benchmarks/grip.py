"""Time of an update of a hand: of the detector alone, and with the grip controller after it.

The ratio does not depend on the machine. All laws run in turns on the same estimates.

    python benchmarks/grip.py [UPDATES]
"""

import argparse
import time

import numpy as np

from holdfast.detector import Detector
from holdfast.model import Model
from holdfast.sensors import sensor
from holdfast_grip import LAWS, GripController, Limits

FINGERS = ("thumb", "index", "middle", "ring")
RATE = 150.0
PRESSED = 300.0
"""Readings of the taxels of a grip above those of the tare [count]."""


def main(n_updates: int) -> None:
    tip = sensor("uskin-curved")
    sensors = dict.fromkeys(FINGERS, tip)
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 1.0, size=(1024, len(FINGERS), 30, 3))
    rest = [dict(zip(FINGERS, 32000 + hand, strict=True)) for hand in noise]
    press = np.array([0.3, 0.0, 1.0]) * PRESSED
    held = [dict(zip(FINGERS, 32000 + press + hand, strict=True)) for hand in noise]
    detector = Detector(Model.load("builtin:twin"), sensors)
    controllers = {
        law: GripController(Limits(), law, sensors=sensors, newtons_per_unit=7e-4) for law in LAWS
    }
    spent: dict[str, list[int]] = {name: [] for name in ("detector", *LAWS)}
    for k in range(n_updates):
        now = k / RATE
        samples = (rest if k < 100 else held)[k % 1024]
        start = time.perf_counter_ns()
        estimate = detector.update(samples, now)
        spent["detector"].append(time.perf_counter_ns() - start)
        for law, controller in controllers.items():
            start = time.perf_counter_ns()
            controller.update(estimate, now)
            spent[law].append(time.perf_counter_ns() - start)
    alone = np.percentile(spent["detector"][500:], 50)
    print(f"detector alone: p50 {alone / 1e3:.1f} us")
    for law, controller in controllers.items():
        p50 = np.percentile(spent[law][500:], 50)
        print(
            f"{law}: p50 {p50 / 1e3:.1f} us, together {(p50 + alone) / 1e3:.1f} us, "
            f"{(p50 + alone) / alone:.2f} times the detector alone ({controller.state})"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("updates", type=int, nargs="?", default=20_000)
    main(parser.parse_args().updates)
