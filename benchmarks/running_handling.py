"""Print what a running estimate of own handling would do: figures of decision record 24.

    python benchmarks/running_handling.py DATA [--hands HANDS]

While a finger is STABLE without a slip or fault, from 0.2 s after it became so, location and scale
of each feature follow its samples with a time constant of a minute of holding. They stay within
the bounds: so many default scales from the location at the start, and so many times its scale.
After a number of minutes of holding, in which the own handling of `real_sets.py` is played again
and again, the model is tested as there.

DATA is the folder with the real recordings; HANDS one that `holdfast simulate HANDS --randomize
--grasps 3 --repeats 150` made: two grasps of a hand are its handling, with all their slips and
pushes, and the third is tested.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from itertools import groupby, islice
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from real_sets import box_figures, boxes

from holdfast.contact import STABLE, ContactState
from holdfast.detector import Detector, detect
from holdfast.features.stream import extract
from holdfast.io import load_recording
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.model import Handling, Model
from holdfast.recordings import Recording
from holdfast.training import calibrate
from holdfast.training.own_handling import CLIP_DEVIATIONS, MIN_SCALE

TIME_CONSTANT = 60.0
"""Held time after which the estimate has followed by 63 % [s]."""
SETTLED = 0.2
"""Time after which a finger that has become STABLE is learned from [s]."""
MAX_STEP = 0.1
"""A longer step between two samples teaches nothing [s]."""
UPDATE_INTERVAL = 20
"""Number of samples after which the detector has the new values."""
BOUNDS = ((1.0, 2.0), (0.5, 1.5))
"""Largest move of a location, in scales, and largest factor of a scale."""
MINUTES = (0, 1, 3)


class Moments(NamedTuple):
    """Location and scale of all features of a sensor."""

    location: np.ndarray
    scale: np.ndarray


class RunningHandling:
    """A model whose own handling follows what it holds."""

    def __init__(self, model: Model, bounds: tuple[float, float]) -> None:
        self.model, self.part = model, model.fingers["*"]
        self.max_move, self.max_factor = bounds
        self.start: dict[str, Moments] = {}
        self.now: dict[str, Moments] = {}
        self.seconds, self.n_fingers = 0.0, 1
        # E min(z^2, c^2) of a normal z, as in `own_handling.location_and_scale`.
        c = CLIP_DEVIATIONS
        tails, density = math.erfc(c / math.sqrt(2)), math.exp(-c * c / 2) / math.sqrt(2 * math.pi)
        self.shrinkage = 1 - tails * (1 - c * c) - 2 * c * density

    def current(self) -> Model:
        """Return the model with the handling of now."""
        known = dict(self.part.handling)
        for sensor, moments in self.now.items():
            before = known.get(sensor)
            values = {
                "location": tuple(moments.location.tolist()),
                "scale": tuple(moments.scale.tolist()),
            }
            known[sensor] = (
                Handling(seconds=max(self.seconds, 1e-3), **values)
                if before is None
                else msgspec.structs.replace(before, **values)
            )
        part = msgspec.structs.replace(self.part, handling=known)
        return msgspec.structs.replace(self.model, fingers={"*": part})

    def play(self, recording: Recording) -> None:
        """Detect a recording, and learn from it."""
        sensors = {name: module.sensor for name, module in recording.modules.items()}
        for sensor in sensors.values():
            if sensor.name not in self.now:
                self.start[sensor.name] = self.now[sensor.name] = self._moments(sensor.name)
        self.n_fingers = len(sensors)
        detector = Detector.for_recording(self.current(), recording)
        rows = extract(self.model.plan(sensors, recording.rate), recording)
        times = np.unique(np.concatenate([m.times for m in recording.modules.values()]))
        places = dict.fromkeys(sensors, 0)
        last, stable_since = dict.fromkeys(sensors, math.nan), dict.fromkeys(sensors, math.nan)
        for k, time in enumerate(times.tolist()):
            samples = {}
            for name, module in recording.modules.items():
                place = places[name]
                if place < len(module.times) and module.times[place] == time:
                    samples[name] = module.readings[place]
            estimate = detector.update(samples, time)
            for name in samples:
                features = rows[name].features[places[name]]
                places[name] += 1
                step, last[name] = time - last[name], time
                finger = estimate.fingers[name]
                if finger.state is not ContactState.STABLE or finger.cause or finger.faults:
                    stable_since[name] = math.nan
                    continue
                if math.isnan(stable_since[name]):
                    stable_since[name] = time
                settled = time - stable_since[name] >= SETTLED
                if settled and step <= MAX_STEP and np.isfinite(features).all():
                    self._learn(sensors[name].name, features, step)
            if k % UPDATE_INTERVAL == UPDATE_INTERVAL - 1:
                detector.set_model(self.current())

    def _moments(self, sensor: str) -> Moments:
        handling = self.part.handling.get(sensor)
        if handling is None:
            return Moments(*self.part.default_handling)
        return Moments(np.array(handling.location), np.array(handling.scale))

    def _learn(self, sensor: str, features: np.ndarray, step: float) -> None:
        (location, scale), start = self.now[sensor], self.start[sensor]
        gain = step / (TIME_CONSTANT * self.n_fingers)
        away = np.clip(features - location, -CLIP_DEVIATIONS * scale, CLIP_DEVIATIONS * scale)
        variance = scale**2 + gain * (away**2 / self.shrinkage - scale**2)
        move = self.max_move * start.scale
        self.now[sensor] = Moments(
            np.clip(location + gain * away, start.location - move, start.location + move),
            np.clip(
                np.sqrt(variance),
                np.maximum(start.scale / self.max_factor, MIN_SCALE),
                start.scale * self.max_factor,
            ),
        )
        self.seconds += step


def followed(
    model: Model, recordings: Sequence[Recording], bounds: tuple[float, float]
) -> Iterator[Model]:
    """Yield the model after each of `MINUTES` of holding, of each finger, in recordings."""
    running = RunningHandling(model, bounds)
    n_fingers = max(len(recording.modules) for recording in recordings)
    for minutes in MINUTES:
        learned = math.inf
        while running.seconds < 60 * minutes * n_fingers and learned >= 1.0:
            before = running.seconds
            for recording in recordings:
                running.play(recording)
            learned = running.seconds - before
        yield running.current()


def print_boxes(folder: Path, model: Model) -> None:
    recordings = boxes(folder / "uskin_pick_move")
    print("| start | bounds | minutes held | stable called STABLE | slip not called STABLE |")
    print("|---|---|--:|--:|--:|")
    for start in ("default", "calibrated"):
        for bounds in BOUNDS:
            models: dict[tuple[str, ...], list[Model]] = {}
            for k, minutes in enumerate(MINUTES):

                def model_for(handling, start=start, bounds=bounds, models=models, k=k):
                    key = tuple(item.name for item in handling)
                    if key not in models:
                        first = model if start == "default" else calibrate(model, handling)
                        models[key] = list(followed(first, handling, bounds))
                    return models[key][k]

                found = box_figures(model_for, recordings)
                stable = found["boxes: stable called STABLE"]
                slip = found["boxes: slip not called STABLE"]
                print(f"| {start} | {bounds} | {minutes} | {stable:.3f} | {slip:.3f} |", flush=True)


def print_hands(folder: Path, model: Model, n: int) -> None:
    by_hand = groupby(sorted(folder.glob("*.parquet")), lambda path: path.stem.split("-")[0])
    hands = [[load_recording(path) for path in paths] for _, paths in islice(by_hand, n)]
    print(f"\n{len(hands)} hands, bounds {BOUNDS[0]}\n")
    print("| minutes held | still called STABLE | sliding not called STABLE | slips not found |")
    print("|--:|--:|--:|--:|")
    rows = [
        [hand_figures(followed_model, tested) for followed_model in followed(model, own, BOUNDS[0])]
        for *own, tested in hands
    ]
    for minutes, parts in zip(MINUTES, zip(*rows, strict=True), strict=True):
        values = [np.concatenate(part).mean() for part in zip(*parts, strict=True)]
        print(f"| {minutes} | {' | '.join(f'{value:.3f}' for value in values)} |")


def hand_figures(model: Model, tested: Recording) -> list[np.ndarray]:
    """Return whether still samples are STABLE, sliding ones are not, and slips are not found."""
    still, sliding, missed = [], [], []
    for name, trace in detect(model, tested).fingers.items():
        truth = slip_truth(tested, name, trace.times)
        if truth is None:
            continue
        still.append(trace.state[truth.codes == STILL] == STABLE)
        sliding.append(trace.state[truth.codes == SLIDING] != STABLE)
        for slip in truth.slips:
            during = (trace.times >= slip.onset) & (trace.times <= slip.end + 0.1)
            missed.append(bool((trace.state[during] == STABLE).all()))
    return [*(np.concatenate([*part, np.empty(0)]) for part in (still, sliding)), np.array(missed)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("--hands", type=Path)
    parser.add_argument("--n-hands", type=int, default=20)
    arguments = parser.parse_args()
    shipped = Model.load("builtin:any")
    if arguments.hands is None:
        print_boxes(arguments.data, shipped)
    else:
        print_hands(arguments.hands, shipped, arguments.n_hands)
