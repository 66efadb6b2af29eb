"""Print what models say about the real recordings: untouched, and calibrated on own handling.

    python benchmarks/real_sets.py DATA builtin:any [OTHER.json ...]

Three sets, on which nothing was trained:

- Boxes: five recordings of a robot that carries a box. Own handling of a recording: the others in
  which the box does not slip. Median over the recordings of the share of stable samples called
  STABLE; share of the slip samples not called STABLE; AUC of stable against slip.
- Tugs: 69 sequences in which a person tugs a held object, one label each. Own handling: the first
  half second of every other sequence. AUC by sequence of the largest score after that; share of
  the quiet 0.2 to 0.5 s called STABLE.
- Holds of a GTac gripper, after its servos have come to rest. Own handling: every other hold.
  Share called STABLE and share without an estimate, of the samples in contact; alarms a minute.

Scores: one minus the probability of stability, and the probability of a slip. The first column is
the trivial baseline, which calls every sample STABLE. The next two are the rules that a reader
tries first: the change of the force (of a box over 8 samples, of a tug since its start), and the
speed of the arm, which is not tactile. Their thresholds are those of `calibrate`: 95 % of the
stable samples of the other recordings without slip are below.
"""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, Cause
from holdfast.detection import FingerTrace, Model, detect, fingertip_force
from holdfast.errors import HoldfastError
from holdfast.io.importers import import_recordings
from holdfast.io.importers.table import SLIPPED
from holdfast.metrics.statistics import mann_whitney_u
from holdfast.recordings import Label, Recording, Tactile, label_states
from holdfast.training.calibration import calibrate

TUG_QUIET = (0.2, 0.5)
"""Interval in which every tug is quiet, after the first windows are full [s]."""
TUG_START = 0.5
"""Time after which a sequence is scored [s]; before it nobody tugs."""
QUIET_FROM = 0.4
"""Share of a hold of the GTac gripper after which its servos stand still."""
GOALS = {
    "boxes: stable called STABLE": (0.6, 0.9),
    "boxes: slip not called STABLE": (0.8, 0.7),
    "tugs: AUC, 1 - stable": (0.90, 0.95),
    "tugs: AUC, slip": (0.90, 0.95),
    "tugs: quiet called STABLE": (0.9, 0.97),
    "GTac: STABLE": (0.95, 0.95),
    "GTac: without an estimate": (0.02, 0.02),
    "GTac: alarms a minute": (3.0, 3.0),
}

ALWAYS_STABLE = {
    "boxes: stable called STABLE": 1.0,
    "tugs: quiet called STABLE": 1.0,
    "GTac: STABLE": 1.0,
    "boxes: slip not called STABLE": 0.0,
    "GTac: without an estimate": 0.0,
    "GTac: alarms a minute": 0.0,
}
"""Figures of the trivial baseline; its score is the same for all samples, so each AUC is 0.5."""

Score = Callable[[FingerTrace], np.ndarray]
SCORES: dict[str, Score] = {
    "1 - stable": lambda trace: 1.0 - trace.stable_probability,
    "slip": lambda trace: (
        np.full(len(trace), np.nan) if trace.slip_probability is None else trace.slip_probability
    ),
}

Calibrated = Callable[[Sequence[Recording]], Model]
"""Returns the model for recordings of own handling; the model itself if it is untouched."""


class Finger(NamedTuple):
    """Decisions about one finger of one recording, and what is known of it."""

    trace: FingerTrace
    labels: np.ndarray
    slips: np.ndarray


def main(folder: Path, names: Sequence[str]) -> None:
    sets = (
        list(import_recordings(folder / "uskin_pick_move")),
        [
            (tug, tug.metadata[SLIPPED])
            for tug in import_recordings(folder / "eflesh_slip", "eflesh")
        ],
        list(import_recordings(folder / "gtac_v2")),
    )
    columns: dict[str, dict[str, float]] = {
        "change of the force": rule_figures(force_change, sets[0]) | tug_change(sets[1]),
        "speed of the arm": rule_figures(arm_speed, sets[0]),
    }
    for name in names:
        model = Model.load(name)
        columns[f"{name}"] = figures(lambda _, model=model: model, *sets)
        if model.finger("*").normalised:
            columns[f"{name}, calibrated"] = figures(
                lambda handling, model=model: calibrate(model, handling), *sets
            )
    rows = list(columns[names[0]])
    columns = {"always stable": {row: ALWAYS_STABLE.get(row, 0.5) for row in rows}, **columns}
    print(f"| | {' | '.join(columns)} | goals |\n|---|{'--:|' * (len(columns) + 1)}")
    for row in rows:
        values = " | ".join(f"{column.get(row, math.nan):.3f}" for column in columns.values())
        goals = ", ".join(f"{goal:g}" for goal in GOALS.get(row, ()))
        print(f"| {row} | {values} | {goals} |")


def figures(
    model_for: Calibrated,
    carried: Sequence[Recording],
    tugged: Sequence[tuple[Recording, bool]],
    holds: Sequence[Recording],
) -> dict[str, float]:
    return (
        box_figures(model_for, carried)
        | tug_figures(model_for, tugged)
        | hold_figures(model_for, holds)
    )


def force_change(module: Tactile, truth: Mapping[str, np.ndarray], lag: int = 8) -> np.ndarray:
    force = fingertip_force(module.readings, module.sensor, tare="none")
    change = np.full(len(force), np.nan)
    change[lag:] = np.linalg.norm(force[lag:] - force[:-lag], axis=1)
    return change


def arm_speed(module: Tactile, truth: Mapping[str, np.ndarray]) -> np.ndarray:
    return np.linalg.norm(truth["robot_velocity"], axis=1)


def rule_figures(
    score: Callable[[Tactile, Mapping[str, np.ndarray]], np.ndarray],
    recordings: Sequence[Recording],
) -> dict[str, float]:
    """Return the figures of the boxes by a threshold on a score of each sample of a finger."""
    held, slipping = {}, {}
    for item in recordings:
        parts = [
            (score(module, item.truth.hand), label_states(module.labels, module.times), module)
            for module in item.modules.values()
        ]
        held[item.name] = np.concatenate([values[labels == STABLE] for values, labels, _ in parts])
        if slips_in(item):
            slipping[item.name] = np.concatenate(
                [values[is_slip(module.labels, module.times)] for values, _, module in parts]
            )
    stable, missed, values = [], [], {}
    for name, scores in held.items():
        calm = [held[other] for other in held if other != name and other not in slipping]
        threshold = np.nanquantile(np.concatenate(calm), 0.95)
        stable.append(float((scores[np.isfinite(scores)] <= threshold).mean()))
        if name in slipping:
            missed.append(slipping[name] > threshold)
            values[f"boxes: AUC, 1 - stable, {name[-8:]}"] = auc(slipping[name], scores)
    return {
        "boxes: stable called STABLE": float(np.median(stable)),
        "boxes: slip not called STABLE": float(np.concatenate(missed).mean()),
        **values,
    }


def tug_change(sequences: Sequence[tuple[Recording, bool]]) -> dict[str, float]:
    """Return the AUC of the largest change of the force since the start of a tug."""
    largest: tuple[list[float], list[float]] = ([], [])
    for recording, slipped in sequences:
        changes = []
        for module in recording.modules.values():
            force = fingertip_force(module.readings, module.sensor, tare="none")
            change = np.linalg.norm(force - force[0], axis=1)
            changes.append(change[module.times >= TUG_START].max())
        largest[int(slipped)].append(max(changes))
    return {"tugs: AUC, 1 - stable": auc(np.array(largest[1]), np.array(largest[0]))}


def is_slip(labels: Sequence[Label], times: np.ndarray) -> np.ndarray:
    slips = tuple(label for label in labels if label.cause is Cause.SLIP)
    return label_states(slips, times) != UNKNOWN


def auc(positive: np.ndarray, negative: np.ndarray) -> float:
    positive, negative = positive[~np.isnan(positive)], negative[~np.isnan(negative)]
    pairs = len(positive) * len(negative)
    return mann_whitney_u(positive, negative) / pairs if pairs else math.nan


def box_figures(model_for: Calibrated, recordings: Sequence[Recording]) -> dict[str, float]:
    calm = [item for item in recordings if not slips_in(item)]
    stable, missed, values = [], [], {}
    for recording in recordings:
        model = model_for([item for item in calm if item.name != recording.name])
        parts = fingers_of(model, recording)
        held = np.concatenate([part.trace.state[part.labels == STABLE] for part in parts])
        stable.append(float((held == STABLE).mean()))
        if slips_in(recording):
            missed.append(np.concatenate([part.trace.state[part.slips] for part in parts]))
            for name, score in SCORES.items():
                slip, held_scores = (
                    np.concatenate([score(part.trace)[mask(part)] for part in parts])
                    for mask in (lambda part: part.slips, lambda part: part.labels == STABLE)
                )
                values[f"boxes: AUC, {name}, {recording.name[-8:]}"] = auc(slip, held_scores)
    return {
        "boxes: stable called STABLE": float(np.median(stable)),
        "boxes: slip not called STABLE": float((np.concatenate(missed) != STABLE).mean()),
        **values,
    }


def slips_in(recording: Recording) -> bool:
    return any(x.cause is Cause.SLIP for m in recording.modules.values() for x in m.labels)


def fingers_of(model: Model, recording: Recording) -> list[Finger]:
    parts = []
    for name, trace in detect(model, recording).fingers.items():
        labels = recording.modules[name].labels
        slips = is_slip(labels, trace.times)
        parts.append(Finger(trace, label_states(labels, trace.times), slips))
    return parts


def tug_figures(
    model_for: Calibrated, sequences: Sequence[tuple[Recording, bool]]
) -> dict[str, float]:
    quiet, scores = [], {name: ([], []) for name in SCORES}
    for half in (0, 1):
        model = model_for([start_of(item) for item, _ in sequences[half::2]])
        for recording, slipped in sequences[1 - half :: 2]:
            traces = list(detect(model, recording).fingers.values())
            for trace in traces:
                first, last = np.searchsorted(trace.times, TUG_QUIET)
                quiet.append(trace.state[first:last] == STABLE)
            for name, score in SCORES.items():
                late = [score(trace)[trace.times >= TUG_START] for trace in traces]
                largest = max(
                    (float(np.nanmax(part)) for part in late if np.isfinite(part).any()),
                    default=math.nan,
                )
                scores[name][int(slipped)].append(largest)
    return {
        **{
            f"tugs: AUC, {name}": auc(np.array(slipped), np.array(held))
            for name, (held, slipped) in scores.items()
        },
        "tugs: quiet called STABLE": float(np.concatenate(quiet).mean()),
    }


def start_of(recording: Recording) -> Recording:
    """Return the first half second of a sequence."""
    modules = {
        name: module.slice(0, int(np.searchsorted(module.times, TUG_START)))
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def hold_figures(model_for: Calibrated, recordings: Sequence[Recording]) -> dict[str, float]:
    n_stable = n_unknown = n_alarms = n = 0
    minutes = 0.0
    for half in (0, 1):
        try:
            model = model_for(recordings[half::2])
        except HoldfastError as error:
            raise SystemExit(f"GTac: {error}") from error
        for recording in recordings[1 - half :: 2]:
            for trace in detect(model, recording).fingers.values():
                states = trace.state[int(QUIET_FROM * len(trace)) :]
                used = states != NO_CONTACT
                n += int(used.sum())
                n_stable += int((states == STABLE).sum())
                n_unknown += int((states == UNKNOWN).sum())
                left = (states[:-1] == STABLE) & (states[1:] != STABLE)
                n_alarms += int((left & (states[1:] != UNKNOWN)).sum())
                minutes += len(states) / recording.rate / 60
    return {
        "GTac: STABLE": n_stable / n,
        "GTac: without an estimate": n_unknown / n,
        "GTac: alarms a minute": n_alarms / minutes,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("models", nargs="+")
    options = parser.parse_args()
    main(options.data, options.models)
