"""Add a head of causes to a model: why a contact that does not slide is unstable.

    holdfast simulate twin/ --seed 0
    python benchmarks/train_causes.py builtin:twin twin/ -o src/holdfast/models/twin.json
    holdfast simulate hands/ --randomize --repeats 300 --seed 0
    python benchmarks/train_causes.py builtin:any hands/ -o src/holdfast/models/any.json

Slip is no cause here: its own head decides it (`train_slips.py`). The true cause is that of the
labels made from the truth, by sample; samples that slide are left out. Prints the confusion on
objects (or hands) left out. Nothing here reads a real recording.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import Cause
from holdfast.detection import Head, Model
from holdfast.detection.features import extract
from holdfast.io import load_dataset
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.recordings import Recording
from holdfast.resampling import true_updates
from holdfast.sensors.types import Array, Integers
from holdfast.training.head_fits import fit_causes

MAX_RATE = 20.0
"""Samples per second that are kept of each recording [Hz]; neighbours are nearly copies."""
C = 1e-3
"""Weight of the samples against the penalty on the weights."""
N_FOLDS = 5
CAUSES = (Cause.CLOSING, Cause.DISTURBANCE, Cause.GLITCH, Cause.LOST)
NAMED_AS = {Cause.RELEASED: Cause.LOST}
"""Causes that look alike to a finger: it loses contact."""


class UnstableSamples(NamedTuple):
    """Unstable samples of one recording whose cause is known."""

    features: Array
    causes: npt.NDArray[np.str_]
    group: str


def main(name: str, folder: Path, out: Path | None) -> None:
    """Fit the head, print its confusion out of fold, and write the model."""
    model = Model.load(name)
    recordings = load_dataset(folder)
    samples = [samples_of(model, recording) for recording in recordings]
    groups = sorted({sample.group for sample in samples})
    folds = np.array([groups.index(sample.group) % N_FOLDS for sample in samples])
    print_confusion(model, samples, folds)
    if out is not None:
        save(model, fit(model, samples), recordings, out)


def samples_of(model: Model, recording: Recording) -> UnstableSamples:
    """Return the unstable samples of a recording, of all fingers."""
    recording = true_updates(recording)
    sensors = model.fingers_of({name: item.sensor for name, item in recording.modules.items()})
    extracted = extract(model.plan(sensors, recording.rate), recording)
    columns = model.finger("*").indices(model.finger("*").stable)  # other heads may have more
    rows = {finger: part.features[:, columns] for finger, part in extracted.items()}
    step = max(1, round(recording.rate / MAX_RATE))
    features, causes = [np.empty((0, len(columns)))], [np.empty(0, "U12")]
    for finger, labels in labels_by_truth(recording, LabelRule(margin=0.0)).items():
        if finger not in rows:
            continue
        times = recording.modules[finger].times
        cause = np.full(len(times), "", dtype="U12")
        for label in labels:
            if label.state == "UNSTABLE" and label.cause is not None:
                inside = slice(*np.searchsorted(times, (label.start, label.end)))
                cause[inside] = NAMED_AS.get(label.cause, label.cause)
        kept = np.isin(cause, CAUSES) & np.isfinite(rows[finger]).all(axis=1)
        kept &= np.arange(len(times)) % step == 1 % step
        features.append(rows[finger][kept])
        causes.append(cause[kept])
    group = str(recording.metadata.get("object") or recording.name)
    return UnstableSamples(
        np.concatenate(features),
        np.concatenate(causes),
        recording.name if recording.metadata.get("sensor_kind") else group,
    )


def fit(model: Model, samples: Sequence[UnstableSamples]) -> Head:
    """Fit the head to the samples of some recordings."""
    features = np.concatenate([sample.features for sample in samples])
    causes = np.concatenate([sample.causes for sample in samples])
    rule, classes = fit_causes(features, causes, C)
    used = model.finger("*").stable.features
    return Head(name="cause", link="softmax", features=used, rule=rule, classes=classes)


def print_confusion(model: Model, samples: Sequence[UnstableSamples], folds: Integers) -> None:
    """Print the estimated causes of single samples of folds left out, in percent of a row."""
    counts = np.zeros((len(CAUSES), len(CAUSES)), dtype=np.int64)
    for fold in range(N_FOLDS):
        others = [sample for sample, fold_of in zip(samples, folds, strict=True) if fold_of != fold]
        head = fit(model, others)
        weights, names = head.rule.raw_weights(), np.array(head.classes)
        for k in np.flatnonzero(folds == fold):
            scores = samples[k].features @ weights[:, 1:].T + weights[:, 0]
            cells = (np.searchsorted(CAUSES, samples[k].causes),)
            cells += (np.searchsorted(CAUSES, names[scores.argmax(axis=1)]),)
            np.add.at(counts, cells, 1)
    print(f"| cause | samples | {' | '.join(CAUSES)} |\n|---|---|{'---|' * len(CAUSES)}")
    for cause, row in zip(CAUSES, counts, strict=True):
        shares = " | ".join(f"{100 * n / max(row.sum(), 1):.0f}" for n in row)
        print(f"| {cause} | {row.sum()} | {shares} |")


def save(model: Model, head: Head, recordings: Sequence[Recording], out: Path) -> None:
    """Write the model; its provenance names the recordings of the head, too."""
    training = model.training
    if training is not None:
        digests = set(training.recordings.values())
        added = {item.name: item.digest for item in recordings if item.digest not in digests}
        training = msgspec.structs.replace(training, recordings=training.recordings | added)
    changed = model.changed(lambda part: part.with_heads(head))
    msgspec.structs.replace(changed, training=training, name=out.stem).save(out, force=True)
    print(f"{out} written")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("model")
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--out", type=Path)
    options = parser.parse_args()
    main(options.model, options.folder, options.out)
