"""Compare the speed of slips that a model estimates with the true speed.

    holdfast simulate test/ --seed 2
    holdfast simulate slips/ --profile slips --seed 2
    python benchmarks/slip_speed.py builtin:twin test/ slips/ --boxes ../shared/data

On the twin: samples that slide, in slips over 1 mm, by their true speed. "Estimated" is the
estimate where the finger is reported to slide; "reported" counts the others as 0, as
`slip_speed` does. The distance of a slip is the sum of the reported speed over it.

On the boxes (`uskin_pick_move`): the rank correlation of the reported speed, the mean of both
fingers, with the speed of the marker on the box over 0.2 s, which holds the labelled slips. The
model is taken for any sensor, its tare is the first sample, and everything counts as contact: in
these recordings the box is held from the first sample on.
"""

import argparse
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from scipy.stats import spearmanr

from holdfast.contact import Cause, ContactState
from holdfast.detector import FingerTrace, detect
from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.metrics.slip_truth import DISTANCES, sample_durations, slip_truth
from holdfast.metrics.statistics import bootstrap_interval, ratio_of_sums
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast.sensors.types import Array, Flags
from holdfast.training.targets import MILLIMETRES, in_long_slips, true_speed

BANDS = (1.0, 5.0, 20.0, 100.0, math.inf)
"""Limits of the bands of the true speed [mm/s]."""
MARKER_SECONDS = 0.1
"""The marker's speed is over this time before and after a sample [s]."""


class Speeds(NamedTuple):
    """Sliding samples of the slips over 1 mm of one recording.

    Attributes:
        true: (n,) speed [mm/s].
        reported: (n,) speed [mm/s]; 0 where the finger is not reported to slide.
        is_reported: (n,) whether it is.
        distances: (n_slips, 2) true and reported distance of each slip [mm].
    """

    true: Array
    reported: Array
    is_reported: Flags
    distances: Array


def speeds_of(model: Model, recording: Recording) -> Speeds:
    """Return the speeds of all fingers of a recording of the twin."""
    parts = [
        finger_speeds(recording, name, trace)
        for name, trace in detect(model, recording).fingers.items()
    ]
    return Speeds(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def finger_speeds(recording: Recording, name: str, trace: FingerTrace) -> Speeds:
    truth = slip_truth(recording, name, trace.times)
    if truth is None or trace.slip_speed is None:
        raise SystemExit(f"{recording.name}: no true speed of {name}, or a model without it")
    used, speed = in_long_slips(trace.times, truth), np.nan_to_num(trace.slip_speed)
    slid = speed * sample_durations(trace.times)
    distances = [
        (MILLIMETRES * slip.distance, slid[slice(*np.searchsorted(trace.times, slip[:2]))].sum())
        for slip in truth.slips
        if slip.distance >= DISTANCES[0]
    ]
    true = true_speed(recording, name, trace.times)
    return Speeds(
        true[used], speed[used], speed[used] > 0, np.array(distances).reshape(len(distances), 2)
    )


def error_cell(parts: Sequence[tuple[Array, Array]]) -> str:
    """Return the mean error over some samples of each recording, with its interval."""
    sums = [np.abs(true - estimate).sum() for true, estimate in parts]
    counts = [len(true) for true, _ in parts]
    if not sum(counts):
        return "-"
    interval = bootstrap_interval(ratio_of_sums(sums, counts), len(parts))
    limits = "" if interval is None else f" ({interval[0]:.1f} to {interval[1]:.1f})"
    return f"{sum(sums) / sum(counts):.1f}{limits}"


def print_twin(model: Model, folder: Path) -> None:
    """Print the errors on the recordings of a folder, by bands of the true speed."""
    speeds = [speeds_of(model, recording) for recording in load_dataset(folder)]
    joined = Speeds(*(np.concatenate(columns) for columns in zip(*speeds, strict=True)))
    print(f"\n{folder.name}: {len(speeds)} recordings, {len(joined.distances)} slips over 1 mm\n")
    print(
        "| true speed, mm/s | samples | mean | reported, % | error, estimated | error, reported |"
    )
    print("|---|---|---|---|---|---|")
    for low, high in [(BANDS[0], BANDS[-1]), *pairwise(BANDS)]:
        print(band_row(speeds, joined, low, high))
    shown, (true, slid) = joined.is_reported, joined.distances.T
    ranks = rank(joined.reported[shown], joined.true[shown]), rank(joined.reported, joined.true)
    print("\nrank correlation: estimated {}, reported {}".format(*ranks))
    print(
        f"distance of a slip: median {np.median(true):.1f} mm, reported {np.median(slid):.1f} mm, "
        f"error {np.median(np.abs(slid - true)):.1f} mm; rank correlation {rank(slid, true)}"
    )


def band_row(speeds: Sequence[Speeds], joined: Speeds, low: float, high: float) -> str:
    """Return the row of a band of the true speed [mm/s]."""
    chosen = [(part, (part.true >= low) & (part.true < high)) for part in speeds]
    inside = (joined.true >= low) & (joined.true < high)
    raised = [(part, rows & part.is_reported) for part, rows in chosen]
    errors = [
        error_cell([(part.true[rows], part.reported[rows]) for part, rows in samples])
        for samples in (raised, chosen)
    ]
    title = f"{low:g} to {high:g}" if high < math.inf else f"over {low:g}"
    share = 100 * joined.is_reported[inside].mean()
    mean = joined.true[inside].mean()
    return f"| {title} | {inside.sum()} | {mean:.1f} | {share:.0f} | {' | '.join(errors)} |"


def rank(estimate: Array, true: Array) -> str:
    """Return the rank correlation as text."""
    return f"{spearmanr(estimate, true)[0]:.2f}"


def for_any_sensor(model: Model) -> Model:
    """Return a model of any sensor, for recordings that begin in contact."""
    part = replace(model.finger("*"), sensor=None, contact_threshold=0.0)
    return replace(model, fingers={"*": part}, sensors={}, tare="first")


def marker_speed(recording: Recording) -> Array:
    """Return (n,) the speed of the marker at the samples [mm/s]; NaN where it was lost."""
    if recording.truth is None:
        raise SystemExit(f"{recording.name} has no pose of a marker")
    times, places = recording.truth.times, recording.truth.hand["marker_pose"][:, :3]
    ends = np.searchsorted(times, [times - MARKER_SECONDS, times + MARKER_SECONDS])
    first, last = np.clip(ends, 0, len(times) - 1)
    moved = np.linalg.norm(places[last] - places[first], axis=1)
    return np.asarray(MILLIMETRES * moved / (times[last] - times[first]))


def print_boxes(model: Model, folder: Path) -> None:
    """Print how the reported speed follows that of the marker, for each recording."""
    print(
        "\n| box | samples | rank | marker, slip / else | reported, slip / else | rank in slips |"
    )
    print("|---|---|---|---|---|---|")
    model, pooled = for_any_sensor(model), []
    for recording in import_recordings(folder / "uskin_pick_move"):
        true, times = marker_speed(recording), recording.truth.times
        traces = detect(model, recording).fingers.values()
        reported = np.mean(
            [np.interp(times, trace.times, trace.slip_speed) for trace in traces], axis=0
        )
        slips = labelled_slip(recording)
        known = np.isfinite(true) & np.isfinite(reported)
        true, reported, slips = true[known], reported[known], slips[known]
        pooled.append((true, reported))
        means = [
            " / ".join(f"{x[rows].mean():.1f}" if rows.any() else "-" for rows in (slips, ~slips))
            for x in (true, reported)
        ]
        inside = rank(reported[slips], true[slips]) if slips.any() else "-"
        print(
            f"| {recording.name[-19:]} | {len(true)} | {rank(reported, true)} | {means[0]} | "
            f"{means[1]} | {inside} |"
        )
    true, reported = (np.concatenate(columns) for columns in zip(*pooled, strict=True))
    print(f"| all | {len(true)} | {rank(reported, true)} | | | |")


def labelled_slip(recording: Recording) -> Flags:
    """Return (n,) where the box is labelled to slip."""
    module = next(iter(recording.modules.values()))
    slips = tuple(label for label in module.labels if label.cause is Cause.SLIP)
    states = label_states(slips, recording.truth.times)
    return np.asarray(states == ContactState.UNSTABLE.code)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("model")
    parser.add_argument("folders", type=Path, nargs="*", help="recordings of the twin")
    parser.add_argument("--boxes", type=Path, metavar="DATA", help="folder of uskin_pick_move")
    options = parser.parse_args()
    loaded = Model.load(options.model)
    for name in options.folders:
        print_twin(loaded, name)
    if options.boxes:
        print_boxes(loaded, options.boxes)
