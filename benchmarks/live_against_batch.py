"""Compare the estimates of a live stream with those of the same samples as a recording.

    python benchmarks/live_against_batch.py [SEEDS]

The samples are those of synthetic grasps at 150 Hz, unchanged or with one disturbance of their
times. A live detector measures the rate over the first half second, and a recording gives the rate
of the whole. The table gives the largest difference of a stable probability, and the samples whose
state differs, over samples that both have at the same time; and the samples that one has alone.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.detector import detect
from holdfast.devices.sources import Arrival, Source
from holdfast.live.stream_detector import StreamDetector
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.synthetic import synthetic_recording

MODELS = ("builtin:any", "builtin:twin", "builtin:noise-floor")
FINGERS = ("thumb", "index", "middle")
BURST = 5
"""Number of samples of a burst."""
Times = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Estimates = dict[tuple[str, int], tuple[float, int]]
"""Stable probability and state by finger and time [us]."""


def constant(times: Times, rng: np.random.Generator) -> tuple[Times, Flags]:
    """Return the times unchanged."""
    return times, np.ones(len(times), dtype=bool)


def slower(times: Times, rng: np.random.Generator) -> tuple[Times, Flags]:
    """Return times whose rate falls to half in the middle."""
    middle = times[len(times) // 2]
    return np.where(times < middle, times, 2 * times - middle), np.ones(len(times), dtype=bool)


def bursts(times: Times, rng: np.random.Generator) -> tuple[Times, Flags]:
    """Return times that come in bursts of five, at twice the rate, from the first second on."""
    period = times[1] - times[0]
    place = np.where(times < times[0] + 1.0, 0, np.arange(len(times)) % BURST)
    return times - 0.5 * period * place, np.ones(len(times), dtype=bool)


def dropped(times: Times, rng: np.random.Generator) -> tuple[Times, Flags]:
    """Return the times with one of ten samples missing, at random."""
    return times, rng.random(len(times)) >= 0.1


CONDITIONS: dict[str, Callable[[Times, np.random.Generator], tuple[Times, Flags]]] = {
    "constant rate": constant,
    "the rate falls to half": slower,
    "bursts of five": bursts,
    "one of ten dropped": dropped,
}


def disturbed(seed: int, condition: str) -> Recording:
    """Return a grasp whose samples come at other times."""
    made = synthetic_recording("grasp", seed, FINGERS)
    modules, rng = {}, np.random.default_rng([seed, 1])
    for name, module in made.modules.items():
        times, kept = CONDITIONS[condition](module.times, rng)
        modules[name] = replace(
            module, times=times[kept], readings=module.readings[kept], labels=()
        )
    return Recording(made.name, modules)


class Passed(Source):
    """Source whose samples are passed to the detector by hand."""

    def __init__(self, recording: Recording) -> None:
        self.sensors = {name: module.sensor for name, module in recording.modules.items()}

    def open(self) -> None:
        """Open nothing."""

    def read(self, timeout: float) -> None:
        """Read nothing."""

    def close(self) -> None:
        """Close nothing."""


def live(model: Model, recording: Recording) -> Estimates:
    """Return the estimates of a live stream."""
    detector = StreamDetector(model, Passed(recording))
    samples: dict[float, dict[str, npt.NDArray[Any]]] = {}
    for name, module in recording.modules.items():
        for when, readings in zip(module.times.tolist(), module.readings, strict=True):
            samples.setdefault(when, {})[name] = readings
    found = []
    for when in sorted(samples):
        found += detector.update(Arrival(when, samples[when], time.monotonic())).estimates
    found += detector.finish().estimates
    return {
        (name, round(1e6 * each.estimate.time)): (finger.stable_probability, finger.state.code)
        for each in found
        for name, finger in each.estimate.fingers.items()
        if name in each.updated_fingers
    }


def batch(model: Model, recording: Recording) -> Estimates:
    """Return the estimates of a recording."""
    return {
        (name, round(1e6 * when)): (probability, state)
        for name, trace in detect(model, recording).fingers.items()
        for when, probability, state in zip(
            trace.times.tolist(), trace.stable_probability.tolist(), trace.state.tolist(),
            strict=True,
        )
    }  # fmt: skip


def rows(n_seeds: int) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| model | times | largest difference | other state % | in one only % |"
    yield "|---" * 5 + "|"
    for name in MODELS:
        model = Model.load(name)
        for condition in CONDITIONS:
            largest, n_other, n_both, n_alone = 0.0, 0, 0, 0
            for seed in range(n_seeds):
                recording = disturbed(seed, condition)
                one, two = live(model, recording), batch(model, recording)
                both = one.keys() & two.keys()
                pairs = np.array([(*one[key], *two[key]) for key in both]).reshape(-1, 4)
                same = (pairs[:, 0] == pairs[:, 2]) | np.isnan(pairs[:, [0, 2]]).all(axis=1)
                apart = np.where(same, 0.0, np.abs(pairs[:, 0] - pairs[:, 2]))
                largest = max(largest, float(np.nanmax(apart)))
                n_other += int((pairs[:, 1] != pairs[:, 3]).sum())
                n_both += len(both)
                n_alone += len(one.keys() ^ two.keys())
            yield (
                f"| `{name}` | {condition} | {largest:.2g} | {100 * n_other / n_both:.2f} "
                f"| {100 * n_alone / (n_alone + n_both):.2f} |"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("seeds", type=int, nargs="?", default=5)
    for line in rows(parser.parse_args().seeds):
        print(line, flush=True)
