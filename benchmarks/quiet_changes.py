"""Print how often the state of a finger changes while it quietly holds, and what it costs in delay.

    holdfast simulate twin/ --seed 1
    holdfast simulate slips/ --seed 1 --profile slips
    holdfast simulate hands/ --randomize --repeats 300 --measured all
    python benchmarks/quiet_changes.py twin/ slips/ --hands hands/ --real DATA

Quiet is a hold from 1 s after its beginning to half a second before its end, where what ends it
may have begun:

- folders of grasps of the twin: STABLE by the truth;
- hands: the same in randomized hands, while the arm stands still;
- gaps: of these, the PapillArrays of over 300 Hz, of which about 2 times a second 4 to 23 ms are
  lost, as on a real one;
- GTac: a gripper whose servos stand still, in DATA/gtac_v2.

Changes, alarms (STABLE to UNSTABLE or NO_CONTACT) by minute of a finger; shares of its samples.
Delays are those of the events of the hand, of the decisions as they are and `raw`: without hold,
filter, hysteresis and minimum duration. A missed event counts as infinite. Last, the share called
STABLE, by the truth, of samples of fingers that close in contact, that are being released, and that
have no contact, over the first 0.3 s.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from chatter import alarms, delays, hand_of, raw
from real_sets import QUIET_FROM

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, Cause
from holdfast.detector import FingerTrace, detect
from holdfast.errors import HoldfastError
from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.metrics import pool_events
from holdfast.metrics.events import alarm_indices
from holdfast.metrics.masks import runs
from holdfast.metrics.truth_labels import LabelRule, labels_from_truth
from holdfast.model import Model
from holdfast.recordings import Recording, label_states

SETTLED, ENDING = 1.0, 0.5
"""Times from the beginning and before the end of a hold between which it is quiet [s]."""
STILL_SECONDS, STILL_DEVIATION = 1.0, 0.5
"""An arm stands still while gravity, as the palm feels it, has at most this standard deviation
[m/s^2] over this time [s]; arms vibrate."""
FAST = 300.0
"""Least rate of a stream with gaps [Hz]."""
GAPS_PER_SECOND, SHORTEST_GAP, LONGEST_GAP = 2.0, 0.004, 0.023
"""Gaps of a real PapillArray of 500 Hz: their number, and their durations [s]."""
QUIET_HEADS = (
    "model", "stream", "fingers", "quiet min", "changes/min", "alarms/min", "STABLE %",
    "NO_CONTACT %", "without an estimate %",
)  # fmt: skip
DELAY_HEADS = (
    "model", "recordings", "decisions", "events", "median delay ms", "95 % ms",
    "missed at 0.05, 0.1, 0.2 s %", "false alarms/min",
)  # fmt: skip

NOT_HELD_HEADS = ("model", "recordings", "closing %", "released %", "first 0.3 s of no contact %")
AFTER_CONTACT = 0.3
"""Time after the end of a contact [s]."""

Quiet = Callable[[Recording, str, np.ndarray], np.ndarray]
"""Returns (n,) where a finger of a recording quietly holds, at times."""


class Counts(NamedTuple):
    """Sums over quiet samples: changes, alarms, samples by state code, time [s]."""

    changes: int
    alarms: int
    states: np.ndarray
    seconds: float


def main(options: argparse.Namespace) -> None:
    print_heads(QUIET_HEADS)
    for name in options.models:
        for stream, recordings, quiet in streams(options):
            print_row(name, stream, *quiet_figures(Model.load(name), recordings, quiet))
    print()
    print_heads(DELAY_HEADS)
    for name in options.models:
        model = Model.load(name)
        for folder in options.twin:
            for kind, used in (("raw", raw(model)), ("as they are", model)):
                hands = (hand_of(used, recording) for recording in load_dataset(folder))
                events = pool_events([alarms(hand) for hand in hands])
                print_row(name, folder.name, kind, *delays(events))
    print()
    print_heads(NOT_HELD_HEADS)
    for name in options.models:
        for stream, recordings, quiet in streams(options):
            if quiet is quiet_by_truth:
                print_row(name, stream, *not_held_figures(Model.load(name), recordings))


def print_heads(heads: Iterable[str]) -> None:
    heads = tuple(heads)
    print("| " + " | ".join(heads) + " |\n|---|---|" + "--:|" * (len(heads) - 2))


def print_row(*cells: str) -> None:
    print("| " + " | ".join(cells) + " |", flush=True)


def streams(options: argparse.Namespace) -> Iterator[tuple[str, Iterable[Recording], Quiet]]:
    """Yield name, recordings and quiet of each stream."""
    for folder in options.twin:
        yield folder.name, load_dataset(folder), quiet_by_truth
    if options.hands is not None:
        yield "hands", load_dataset(options.hands), quiet_by_truth
        yield "gaps", with_gaps(load_dataset(options.hands)), quiet_by_truth
    if options.real is not None:
        yield "GTac", import_recordings(options.real / "gtac_v2"), quiet_at_end


def quiet_figures(model: Model, recordings: Iterable[Recording], quiet: Quiet) -> tuple[str, ...]:
    """Return the cells of a stream; of recordings whose sensors the model knows."""
    parts = []
    for recording in recordings:
        try:
            traces = detect(model, recording).fingers
        except HoldfastError:
            continue
        counts = (count(t, quiet(recording, name, t.times)) for name, t in traces.items())
        parts += [part for part in counts if part.seconds > 0]
    if not parts:
        return ("0", *["-"] * (len(QUIET_HEADS) - 3))
    minutes = sum(part.seconds for part in parts) / 60
    states = sum(part.states for part in parts)
    shares = 100 * np.asarray(states) / np.sum(states)
    return (
        str(len(parts)),
        f"{minutes:.1f}",
        f"{sum(part.changes for part in parts) / minutes:.2f}",
        f"{sum(part.alarms for part in parts) / minutes:.2f}",
        *(f"{shares[code]:.2f}" for code in (STABLE, NO_CONTACT, UNKNOWN)),
    )


def count(trace: FingerTrace, quiet: np.ndarray) -> Counts:
    """Count the changes of a finger in its quiet holds."""
    changes = n_alarms = 0
    seconds, states = 0.0, np.zeros(4, dtype=np.int64)
    for first, end in runs(quiet):
        part = trace.state[first:end]
        changes += int(np.count_nonzero(np.diff(part)))
        n_alarms += len(alarm_indices(part))
        states += np.bincount(part, minlength=4)
        seconds += float(trace.times[end - 1] - trace.times[first])
    return Counts(changes, n_alarms, states, seconds)


def not_held_figures(model: Model, recordings: Iterable[Recording]) -> tuple[str, ...]:
    """Return the shares called STABLE of samples that are not held, in percent."""
    counts = np.zeros((3, 2), dtype=np.int64)
    for recording in recordings:
        try:
            traces = detect(model, recording).fingers
        except HoldfastError:
            continue
        for name, trace in traces.items():
            masks = not_held(recording, name, trace.times)
            counts += [((trace.state[mask] == STABLE).sum(), mask.sum()) for mask in masks]
    return tuple(f"{100 * stable / n:.2f}" if n else "-" for stable, n in counts.tolist())


def not_held(recording: Recording, finger: str, times: np.ndarray) -> list[np.ndarray]:
    """Return (n,) where a finger closes in contact, is being released, and has just let go."""
    if recording.truth is None:
        raise SystemExit(f"{recording.name}: a recording with truth expected")
    labels = labels_from_truth(recording.truth, finger, LabelRule(margin=0.0))
    masks = [
        label_states(tuple(x for x in labels if x.cause is cause), times) != UNKNOWN
        for cause in (Cause.CLOSING, Cause.RELEASED)
    ]
    states = label_states(labels, times)
    let_go = np.zeros(len(times), dtype=bool)
    for first, end in runs(states == NO_CONTACT):
        if first > 0:
            last = np.searchsorted(times, times[first] + AFTER_CONTACT)
            let_go[first : min(end, int(last))] = True
    return [*masks, let_go]


def quiet_by_truth(recording: Recording, finger: str, times: np.ndarray) -> np.ndarray:
    """Return where a finger quietly holds and the arm does not move, by the truth."""
    if recording.truth is None:
        raise SystemExit(f"{recording.name}: a recording with truth expected")
    labels = labels_from_truth(recording.truth, finger, LabelRule(margin=0.0))
    held = label_states(labels, times) == STABLE
    if "gravity" in recording.truth.hand:
        still = arm_is_still(recording.truth.hand["gravity"], recording.truth.times)
        places = np.searchsorted(recording.truth.times, times).clip(0, len(still) - 1)
        held &= still[places]
    quiet = np.zeros_like(held)
    for first, end in runs(held):
        inside = times[first] + SETTLED, times[end - 1] - ENDING
        quiet[slice(*np.searchsorted(times, inside))] = True
    return quiet


def arm_is_still(gravity: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return (n,) where gravity hardly changes, from half a second before to half one after."""
    half = max(1, round(0.5 * STILL_SECONDS / float(np.median(np.diff(times)))))
    padded = np.pad(gravity, ((half, half), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=0)
    return np.sqrt(windows.var(axis=-1).sum(axis=-1)) <= STILL_DEVIATION


def quiet_at_end(recording: Recording, finger: str, times: np.ndarray) -> np.ndarray:
    """Return True from when the servos of the gripper stand still."""
    return np.arange(len(times)) >= int(QUIET_FROM * len(times))


def with_gaps(recordings: Iterable[Recording]) -> Iterator[Recording]:
    """Yield the fast PapillArrays without the samples in their gaps."""
    for place, recording in enumerate(recordings):
        skins = {module.sensor.name for module in recording.modules.values()}
        if skins == {"papillarray"} and recording.rate > FAST:
            generator = np.random.default_rng(place)
            modules = {}
            for name, module in recording.modules.items():
                kept = outside_gaps(module.times, generator)
                modules[name] = replace(
                    module, times=module.times[kept], readings=module.readings[kept], labels=()
                )
            yield replace(recording, modules=modules)


def outside_gaps(times: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return (n,) True for the samples that are not lost."""
    n = generator.poisson(GAPS_PER_SECOND * (times[-1] - times[0]))
    starts = generator.uniform(times[0], times[-1], n)
    ends = starts + generator.uniform(SHORTEST_GAP, LONGEST_GAP, n)
    kept = np.ones(len(times), dtype=bool)
    for start, end in zip(starts, ends, strict=True):
        # Neighbouring gaps may overlap: then the second one is left out.
        first, last = np.searchsorted(times, (start, end))
        before, after = max(first - 1, 0), min(last + 1, len(kept))
        if kept[before:after].all():
            kept[first:last] = False
    kept[0] = True
    return kept


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("twin", type=Path, nargs="+", help="folders of grasps of the twin")
    parser.add_argument("--hands", type=Path, help="folder of randomized hands")
    parser.add_argument("--real", type=Path, help="real recordings, which hold gtac_v2")
    parser.add_argument("--models", nargs="+", default=["builtin:any", "builtin:twin"])
    main(parser.parse_args())
