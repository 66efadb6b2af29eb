"""Print how models rank slip against holding on the real recordings.

    python benchmarks/real_slips.py DATA builtin:any [OTHER.json ...]

DATA holds `uskin_pick_move` (five recordings of a box, labels by sample) and `eflesh_slip` (69
tugs, one label each). Two scores of each model: one minus the probability of stability, and the
probability of a slip. Boxes: AUC of samples labelled slip against those labelled stable, of the
fingers of a recording together. Tugs: AUC over sequences of the largest score after the first
half second, and the share of the quiet first 0.2 to 0.5 s without a slip reported.
"""

import argparse
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from holdfast.contact import Cause, ContactState
from holdfast.detector import FingerTrace, detect
from holdfast.io.importers import import_recordings
from holdfast.io.importers.table import SLIPPED
from holdfast.metrics.statistics import mann_whitney_u
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast_interop.importers.eflesh import SEQUENCE_RATE

TUG_QUIET = (0.2, 0.5)
"""Interval in which every tug is quiet, after the first windows are full [s]."""

Score = Callable[[FingerTrace], np.ndarray]
SCORES: dict[str, Score] = {
    "1 - stable": lambda trace: 1.0 - trace.stable_probability,
    "slip": lambda trace: (
        np.full(len(trace), np.nan) if trace.slip_probability is None else trace.slip_probability
    ),
}


def auc(positive: np.ndarray, negative: np.ndarray) -> float:
    positive, negative = positive[~np.isnan(positive)], negative[~np.isnan(negative)]
    pairs = len(positive) * len(negative)
    return mann_whitney_u(positive, negative) / pairs if pairs else math.nan


def boxes(folder: Path) -> list[Recording]:
    return list(import_recordings(folder))


def tugs(folder: Path) -> Iterator[tuple[Recording, bool]]:
    """Yield each sequence and whether the object slipped."""
    for recording in import_recordings(folder, "eflesh"):
        yield recording, recording.metadata[SLIPPED]


def box_aucs(model: Model, recordings: list[Recording], score: Score) -> list[float]:
    """Return the AUC of each recording that has slip."""
    aucs = []
    for recording in recordings:
        traces = detect(model, recording).fingers
        slip, stable = [], []
        for name, trace in traces.items():
            labels = recording.modules[name].labels
            slips = tuple(label for label in labels if label.cause is Cause.SLIP)
            values = score(trace)
            slip.append(values[label_states(slips, trace.times) == ContactState.UNSTABLE.code])
            states = label_states(labels, trace.times)
            stable.append(values[states == ContactState.STABLE.code])
        if sum(map(len, slip)):
            aucs.append(auc(np.concatenate(slip), np.concatenate(stable)))
    return aucs


def tug_figures(
    model: Model, sequences: list[tuple[Recording, bool]], score: Score
) -> tuple[float, float]:
    """Return the AUC over sequences, and the share of quiet samples below the threshold."""
    largest, quiet = [], []
    for recording, _ in sequences:
        sensor = next(iter(recording.modules.values())).sensor
        head = model.finger("*", sensor).slip
        traces = detect(model, recording).fingers.values()
        values = np.array([score(trace) for trace in traces])
        times = np.arange(values.shape[1]) / SEQUENCE_RATE
        with np.errstate(invalid="ignore"):
            largest.append(np.nanmax(values[:, times > TUG_QUIET[1]]))
        inside = values[:, (times > TUG_QUIET[0]) & (times < TUG_QUIET[1])]
        if head is not None:
            quiet.append(np.mean(inside < head.threshold))
    slipped = np.array([slip for _, slip in sequences])
    peaks = np.array(largest)
    return auc(peaks[slipped], peaks[~slipped]), float(np.mean(quiet)) if quiet else math.nan


def main(data: Path, names: list[str]) -> None:
    recordings, sequences = boxes(data / "uskin_pick_move"), list(tugs(data / "eflesh_slip"))
    print("| model | score | boxes with slip, AUC | tugs, AUC | tugs: quiet below threshold |")
    print("|---|---|---|---|---|")
    for name in names:
        model = Model.load(name)
        for title, score in SCORES.items():
            if title == "slip" and model.finger("*").slip is None:
                continue
            shown = " ".join(f"{value:.3f}" for value in box_aucs(model, recordings, score))
            tug, quiet = tug_figures(model, sequences, score)
            share = "" if title != "slip" else f"{quiet:.2f}"
            print(f"| {name} | {title} | {shown} | {tug:.3f} | {share} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("data", type=Path)
    parser.add_argument("models", nargs="+")
    given = parser.parse_args()
    main(given.data, given.models)
