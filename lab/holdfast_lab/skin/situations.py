"""Recordings of the twin and of real hands, cut into situations: quiet, moving, pushed, slip."""

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import HELD_PHASES
from holdfast.features import Tare, parse_features
from holdfast.features.stream import extract
from holdfast.features.tables import StreamPlan
from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.io.importers.table import SLIPPED
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors.types import Array, Flags
from holdfast_interop.importers.gtac import SERVO_POSITIONS
from holdfast_lab.skin.families import family_features, finger_of

SITUATIONS = ("quiet", "moving", "pushed", "slip")
"""The object is held and nothing moves; the arm moves it; a person acts on it but the finger
does not slide; the finger slides."""
MAX_SAMPLES_SHOWN = 150
"""Samples of one finger and situation that are kept, evenly over time."""
MIN_HOLD_SAMPLES = 60
"""A shorter hold is left out."""
ARM_STILL, ARM_MOVES = 0.005, 0.02
"""Speed of a real arm below which it is still, and above which it moves [m/s]."""
GRAVITY_LAG, GRAVITY_STILL = 0.2, 0.1
"""The arm of the twin moves where the apparent gravity, smoothed over this time [s], changes by
more than this within it [m/s^2]."""
SETTLED = 0.3
"""Samples of a situation are used from this time after it begins [s], except those of a slip."""
TUG_QUIET, TUG_MOVES = (0.2, 0.5), (1.43, 2.5)
"""Tugs: time in which all are quiet, and in which all tug [s]."""
GTAC_SETTLED = 1.0
"""Time after the last motion of a servo [s]."""


class Marked(NamedTuple):
    """A recording and where its situations are.

    Attributes:
        recording: with one or more fingers.
        masks: by finger and situation, (n,) True at its samples.
    """

    recording: Recording
    masks: dict[str, dict[str, Flags]]


class FingerValues(NamedTuple):
    """Features of one finger in one situation.

    Attributes:
        recording: name of its recording.
        situation: one of `SITUATIONS`.
        values: (n,) by name of the feature.
    """

    recording: str
    situation: str
    values: dict[str, Array]


def values_of(marked: Marked) -> Iterator[FingerValues]:
    """Yield the features of each finger and situation of a recording."""
    recording = marked.recording
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    features = parse_features("any")
    plan = StreamPlan(
        sensors, dict.fromkeys(sensors, features), 14, Tare.parse("first"), recording.rate
    )
    extracted = extract(plan, recording)
    names = [f"any {feature}" for feature in features]
    for name, module in recording.modules.items():
        own = dict(zip(names, extracted[name].features.T, strict=True))
        own |= family_features(finger_of(module, recording.rate))
        for situation, mask in marked.masks[name].items():
            indices = np.flatnonzero(mask & np.isfinite(own[names[0]]))
            if len(indices) > MAX_SAMPLES_SHOWN:
                indices = indices[np.linspace(0, len(indices) - 1, MAX_SAMPLES_SHOWN).astype(int)]
            if len(indices):
                values = {feature: column[indices] for feature, column in own.items()}
                yield FingerValues(f"{recording.name}/{name}", situation, values)


def distribution_distance(a: Array, b: Array) -> float:
    """Return the distance of Kolmogorov and Smirnov of two samples, 0 to 1; NaN if one is empty.

    It is the largest difference of their cumulative distributions.
    """
    if not (len(a) and len(b)):
        return math.nan
    both = np.concatenate([a, b])
    shares = [np.searchsorted(np.sort(x), both, side="right") / len(x) for x in (a, b)]
    return float(np.abs(shares[0] - shares[1]).max())


def real_sets(data: Path) -> dict[str, Iterator[Marked]]:
    """Return the real recordings of a folder of data sets, by set."""
    return {
        "boxes": boxes(data / "uskin_pick_move"),
        "tugs": tugs(data / "eflesh_slip"),
        "GTac": gtac(data / "gtac"),
        "GTac V2": gtac_grasps(data / "gtac_v2"),
    }


def twin_holds(folder: Path, largest: int | None = None) -> Iterator[Marked]:
    """Yield the holds of randomized hands of the twin, with situations by the truth.

    Each is cut to the time of the hold: as in the boxes and tugs, what the finger reads without
    contact is not known.

    Args:
        folder: of recordings of randomized hands.
        largest: number of recordings that are read at the most.
    """
    for recording, truth in _with_truth(folder, largest):
        start, stop = _hold(truth)
        modules = {
            name: cut
            for name, module in recording.modules.items()
            if (cut := _between(module, start, stop)).n_samples > MIN_HOLD_SAMPLES
        }
        if modules:
            kept = replace(recording, modules=modules)
            yield Marked(kept, {name: _twin_masks(kept, truth, name) for name in modules})


def twin_grasps(folder: Path, largest: int | None = None) -> Iterator[Marked]:
    """Yield recordings of the twin that begin with an open hand: arguments as of `twin_holds`."""
    for recording, truth in _with_truth(folder, largest):
        if "starts_loaded" not in recording.metadata:
            masks = {name: _twin_masks(recording, truth, name) for name in recording.modules}
            yield Marked(recording, masks)


def _with_truth(folder: Path, largest: int | None) -> Iterator[tuple[Recording, Truth]]:
    for recording in islice(load_dataset(folder), largest):
        if recording.truth is None:
            raise ValueError(f"{recording.name} has no truth")
        yield recording, recording.truth


def _hold(truth: Truth) -> tuple[float, float]:
    """Return the time from the lock to the release, or to the loss of the object [s]."""
    grasped = truth.times[np.isin(truth.hand["phase"], HELD_PHASES)]
    return (float(grasped[0]) + SETTLED, float(grasped[-1])) if len(grasped) else (0.0, 0.0)


def _between(module: Tactile, start: float, stop: float) -> Tactile:
    first, last = np.searchsorted(module.times, (start, stop))
    return module.slice(int(first), max(int(first), int(last)))


def _twin_masks(recording: Recording, truth: Truth, finger: str) -> dict[str, Flags]:
    times = recording.modules[finger].times
    slips = slip_truth(recording, finger, times)
    if slips is None:
        raise ValueError(f"{recording.name} has no truth of slips")
    index = np.clip(np.searchsorted(truth.times, times, side="right") - 1, 0, None)
    moves = _gravity_changes(truth.hand["gravity"], recording.rate)[index]
    still = slips.codes == STILL
    masks = {
        "quiet": _settled(slips.quiet & ~moves, recording.rate),
        "moving": _settled(slips.quiet & moves, recording.rate),
        "pushed": _settled(still & ~slips.quiet, recording.rate),
    }
    return {**masks, "slip": slips.codes == SLIDING}


def _gravity_changes(gravity: Array, rate: float) -> Flags:
    lag = max(1, round(GRAVITY_LAG * rate))
    kernel = np.full(lag, 1 / lag)
    smooth = np.stack([np.convolve(axis, kernel, "same") for axis in gravity.T], axis=1)
    change = np.zeros(len(gravity))
    change[lag:] = np.linalg.norm(smooth[lag:] - smooth[:-lag], axis=1)
    return np.asarray(change > GRAVITY_STILL)


def _settled(mask: Flags, rate: float) -> Flags:
    """Return where a mask has been True for a while."""
    wait = max(1, round(SETTLED * rate))
    return np.asarray(np.convolve(mask, np.ones(wait))[: len(mask)] > wait - 0.5)


def boxes(folder: Path) -> Iterator[Marked]:
    """Yield recordings of a box that an arm moves; slip by labels, motion by the arm's speed."""
    for recording in import_recordings(folder):
        path = next(folder.glob(f"{recording.name}*")) / "robot_state.csv"
        with path.open() as lines:
            rows = [(float(row["v_x"]), float(row["v_y"])) for row in csv.DictReader(lines)]
        speed = np.hypot(*np.array(rows).T)
        masks = {}
        for name, module in recording.modules.items():
            truth = slip_truth(Recording(recording.name, {name: module}), name, module.times)
            if truth is None:
                raise ValueError(f"{recording.name} has no labels")
            own = speed[: module.n_samples]
            masks[name] = {
                "quiet": truth.quiet & (own < ARM_STILL),
                "moving": truth.quiet & (own > ARM_MOVES),
                "slip": truth.codes == SLIDING,
            }
        yield Marked(recording, masks)


def tugs(folder: Path) -> Iterator[Marked]:
    """Yield tugs at held objects: pushed if the object was held, slip if it slid at some time."""
    for recording in import_recordings(folder, "eflesh"):
        times = recording.modules["finger1"].times
        situation = "slip" if recording.metadata[SLIPPED] else "pushed"
        masks = {
            "quiet": (times > TUG_QUIET[0]) & (times < TUG_QUIET[1]),
            situation: (times > TUG_MOVES[0]) & (times < TUG_MOVES[1]),
        }
        yield Marked(recording, dict.fromkeys(recording.modules, masks))


def gtac(folder: Path) -> Iterator[Marked]:
    """Yield recordings of objects that a hand moves without labels: all of it counts as moving."""
    for recording in import_recordings(folder):
        masks = {
            name: {"moving": _settled(np.ones(module.n_samples, dtype=bool), recording.rate)}
            for name, module in recording.modules.items()
        }
        yield Marked(recording, masks)


def gtac_grasps(folder: Path) -> Iterator[Marked]:
    """Yield grasps in which the servos stand still after closing."""
    for recording in import_recordings(folder, "gtac"):
        if recording.truth is None:
            raise ValueError(f"{recording.name} has no servos")
        times, servos = recording.truth.times, recording.truth.hand[SERVO_POSITIONS]
        moves = np.append(False, np.diff(servos.astype(np.float64), axis=0).any(axis=1))
        last = times[np.flatnonzero(moves)[-1]] if moves.any() else 0.0
        yield Marked(recording, {"finger1": {"quiet": times > last + GTAC_SETTLED}})
