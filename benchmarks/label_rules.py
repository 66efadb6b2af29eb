"""Measure the quality of labels by rules and of models trained on them.

The tables are in docs/study/labels-by-rules.md.

    holdfast simulate twin/reference --profile finger-reference --seed 0
    holdfast simulate twin/vigorous --profile finger-vigorous --seed 0
    holdfast simulate twin/gentle --profile finger-gentle --seed 0
    holdfast import uskin_pick_move real
    python benchmarks/label_rules.py --folder twin/reference --folder twin/vigorous \
        --folder twin/gentle --real real

For each folder of recordings of the twin: the agreement of each rule with the truth (kappa, onset
differences), with exact poses and with the jitter of a tracker; and metrics of the paper's model,
trained on every second recording with labels by the truth and by each rule, and evaluated on the
others against the truth. For real recordings with a marker on the object: the agreement with the
measured labels, also with an angle chosen on the other recordings.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from holdfast.io import load_dataset
from holdfast.labelling.review.compare import (
    Agreement,
    PooledAgreement,
    RecordingAgreement,
    compare,
    pool,
)
from holdfast.labelling.rules import signal, tracking
from holdfast.labelling.rules.tracking import TrackingRule
from holdfast.metrics import Metrics, bootstrap_interval, ratio_of_sums
from holdfast.recordings import Label, Recording, Truth
from holdfast.training import Setting, evaluate
from holdfast.training.model_fit import fit_recordings

Labels = Mapping[str, Sequence[Label]]
Rule = Callable[[Recording], Labels]

REFERENCE = {"C": 1.0, "class_weight": "balanced"}
ANGLES = (0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3)
CONFIDENCES = (0.5, 0.7, 0.8)
UNUSED_DISTANCE = 1.0
"""Distance that is never reached, so that displacement depends on the angle only [m]."""


def main() -> None:
    arguments = parse()
    for name, (title, header, rows_of) in TABLES.items():
        if arguments.only in (None, name):
            found = (row for each in arguments.folder for row in rows_of(each, arguments.every))
            table(title, header, found)
    if arguments.real and arguments.only in (None, "real"):
        real = list(load_dataset(arguments.real))
        table("Agreement with measured slip: kappa, stable against the rest", *real_table(real))


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, action="append", default=[])
    parser.add_argument("--real", type=Path)
    parser.add_argument("--every", type=int, default=1, help="use only every n-th recording")
    parser.add_argument("--only", choices=[*TABLES, "real"], help="print only one table")
    return parser.parse_args()


def table(title: str, header: Sequence[str], rows: Iterator[Sequence[str]]) -> None:
    print(f"\n{title}\n\n| {' | '.join(header)} |\n|{'---|' * len(header)}", flush=True)
    for row in rows:
        print(f"| {' | '.join(row)} |", flush=True)


# Agreement with the truth


def by_signal(recording: Recording) -> Labels:
    return signal.propose(recording)


def by_poses(recording: Recording) -> Labels:
    return tracking.propose(recording)


def by_tracker(metres: float, degrees: float) -> Rule:
    """Return the tracking rule with poses of a tracker: 60 per second, with random errors."""

    def rule(recording: Recording) -> Labels:
        rng = np.random.default_rng(int(recording.digest[:8], 16))
        truth = recording.truth
        every = max(round(recording.rate / 60), 1)

        def seen(pose: np.ndarray) -> np.ndarray:
            place = pose[:, :3] + rng.normal(0, metres, (len(pose), 3))
            error = Rotation.from_rotvec(rng.normal(0, np.radians(degrees), (len(pose), 3)))
            turn = Rotation.from_quat(np.roll(pose[:, 3:], -1, axis=1)) * error
            return np.concatenate([place, np.roll(turn.as_quat(), 1, axis=1)], axis=1)[::every]

        thing = {"object_pose": seen(truth.hand["object_pose"])}
        tips = {f: {"tip_pose": seen(a["tip_pose"])} for f, a in truth.fingers.items()}
        poses = Truth(truth.times[::every], thing, tips)
        return tracking.propose(replace(recording, truth=poses))

    return rule


RULES: dict[str, Rule] = {
    "signal": by_signal,
    "tracking, exact poses": by_poses,
    "tracking, 0.1 mm and 0.1 degrees": by_tracker(1e-4, 0.1),
    "tracking, 0.5 mm and 0.5 degrees": by_tracker(5e-4, 0.5),
}


def agreement_rows(folder: Path, every: int) -> Iterator[tuple[str, ...]]:
    recordings = load_dataset(folder)
    chosen = range(0, len(recordings), every)
    agreed: dict[str, list[RecordingAgreement]] = {name: [] for name in RULES}
    for place in chosen:
        recording = recordings[place]
        for name, rule in RULES.items():
            agreed[name].append(compare_with_own(recording, rule(recording)))
    for name, found in agreed.items():
        yield f"{folder.name}, {len(chosen)}", name, *agreement_cells(pool(found).pooled)


def compare_with_own(recording: Recording, labels: Labels) -> RecordingAgreement:
    own = {name: module.labels for name, module in recording.modules.items()}
    times = {name: module.times for name, module in recording.modules.items()}
    return compare(own, labels, times, recording.name)


def agreement_cells(found: PooledAgreement) -> Iterator[str]:
    onsets = found.onset_differences
    yield f"{found.kappa:.3f}"
    yield f"{found.kappa_stable:.3f}"
    yield f"{onsets.n} of {onsets.n + onsets.only_a}"
    yield str(onsets.only_b)
    yield "-" if onsets.median is None else f"{onsets.median * 1000:+.0f} ms"
    yield "-" if onsets.p95 is None else f"{onsets.p95 * 1000:.0f} ms"


def confidence_rows(folder: Path, every: int) -> Iterator[tuple[str, ...]]:
    """Yield the share of labels with low confidence: of all time, and of wrong time."""
    recordings = load_dataset(folder)
    chosen = range(0, len(recordings), every)
    for name in ("signal", "tracking, exact poses"):
        counts = np.concatenate([wrong_samples(recordings[k], RULES[name]) for k in chosen])
        cells = []
        for below in CONFIDENCES:
            uncertain = counts[counts[:, 0] < below, 1:].sum(axis=0)
            time, wrong = 100 * uncertain / counts[:, 1:].sum(axis=0)
            cells.append(f"{time:.0f}, {wrong:.0f}")
        yield f"{folder.name}, {len(chosen)}", name, *cells


def wrong_samples(recording: Recording, rule: Rule) -> np.ndarray:
    """Return (n_labels, 3): confidence, samples, and samples with another label in the truth."""
    rows = []
    for name, labels in rule(recording).items():
        module = recording.modules[name]
        for label in labels:
            first, last = np.searchsorted(module.times, (label.start, label.end))
            wrong = (module.label_states[first:last] != label.state.code).sum()
            rows.append((label.confidence, last - first, wrong))
    return np.array(rows)


# Training


def training_rows(folder: Path, every: int) -> Iterator[tuple[str, ...]]:
    recordings = list(load_dataset(folder))[::every]
    training, evaluated = recordings[::2], recordings[1::2]
    best = None
    rules: dict[str, Rule | None] = {"the truth": None, **RULES}
    for name, rule in rules.items():
        given = training if rule is None else [each.with_labels(rule(each)) for each in training]
        metrics = evaluate(fit_recordings(given, Setting(trials=0), REFERENCE), evaluated)
        best = best or metrics
        cells = training_cells(metrics, best)
        yield f"{folder.name}, {len(training)} and {len(evaluated)}", name, *cells


def training_cells(metrics: Metrics, best: Metrics) -> Iterator[str]:
    yield f"{metrics.pooled.accuracy:.1f}"
    mine, theirs = correct_samples(metrics), correct_samples(best)
    less = ratio_of_sums(theirs[:, 0] - mine[:, 0], mine[:, 1])
    low, high = bootstrap_interval(less, len(mine))
    cost = 100 * (theirs[:, 0] - mine[:, 0]).sum() / mine[:, 1].sum()
    yield "" if metrics is best else f"{cost:.1f} ({100 * low:.1f} to {100 * high:.1f})"
    yield f"{metrics.pooled.auc_contact:.3f}"
    yield f"{metrics.events.hand.missed['0.2']:.0f}"
    yield f"{metrics.events.hand.false_alarms_per_minute:.1f}"


def correct_samples(metrics: Metrics) -> np.ndarray:
    """Return (n_recordings, 2): correct samples, and all samples with a decision."""
    confusions = [
        np.sum([finger.confusion for finger in each.fingers.values()], axis=0)
        for each in metrics.recordings
    ]
    return np.array([[np.trace(each), each.sum()] for each in confusions])


# Real recordings


def real_table(recordings: Sequence[Recording]) -> tuple[Sequence[str], Iterator[Sequence[str]]]:
    header = ("labels by", *(each.name[-8:] for each in recordings), "all", "onsets found",
              "onset difference: median")  # fmt: skip

    def rows() -> Iterator[Sequence[str]]:
        for name, rule in REAL_RULES.items():
            yield name, *real_cells([compare_with_own(each, rule(each)) for each in recordings])
        agreed = {angle: [by_angle(each, angle) for each in recordings] for angle in ANGLES}
        best = [best_angle(agreed, place) for place in range(len(recordings))]
        found = [agreed[angle][place] for place, angle in enumerate(best)]
        shown = ", ".join(f"{angle:g}" for angle in best)
        yield (
            f"tracking, rotation by an angle chosen on the others ({shown} rad)",
            *real_cells(found),
        )

    return header, rows()


REAL_RULES: dict[str, Rule] = {
    "signal": lambda each: signal.propose(each, tare="first"),
    "tracking, speed": lambda each: tracking.propose(each, tare="first"),
    "tracking, displacement": lambda each: tracking.propose(
        each, tare="first", rule=TrackingRule(measure="displacement")
    ),
}


def by_angle(recording: Recording, angle: float) -> RecordingAgreement:
    rule = TrackingRule(measure="displacement", distance=UNUSED_DISTANCE, angle=angle)
    return compare_with_own(recording, tracking.propose(recording, tare="first", rule=rule))


def best_angle(agreed: Mapping[float, Sequence[RecordingAgreement]], place: int) -> float:
    """Return the angle with the best agreement on all recordings but one."""

    def kappa(angle: float) -> float:
        others = [each for k, each in enumerate(agreed[angle]) if k != place]
        return pool(others).pooled.kappa_stable or 0.0

    return max(agreed, key=kappa)


def real_cells(found: Sequence[RecordingAgreement]) -> Iterator[str]:
    for each in found:
        (finger, *_) = each.fingers.values()
        yield single_class_share(finger.confusion) or f"{finger.kappa_stable:.2f}"
    whole: Agreement = pool(found)
    onsets = whole.pooled.onset_differences
    yield f"{whole.pooled.kappa_stable:.2f}"
    yield f"{onsets.n} of {onsets.n + onsets.only_a}, {onsets.only_b} additional"
    yield "" if onsets.median is None else f"{onsets.median * 1000:+.0f} ms"


def single_class_share(confusion: Sequence[Sequence[int]]) -> str:
    """Return the share of correct samples if the labels have one class; kappa is undefined."""
    counts = np.array(confusion)
    if counts[:2].sum():
        return ""
    return f"{100 * counts[2, 2] / counts.sum():.0f} % correct"


Rows = Callable[[Path, int], Iterator[Sequence[str]]]
TABLES: dict[str, tuple[str, Sequence[str], Rows]] = {
    "agreement": (
        "Agreement with the twin's truth",
        ("recordings", "labels by", "kappa", "kappa, stable against the rest", "onsets found",
         "additional onsets", "onset difference: median", "95 % within"),
        agreement_rows,
    ),
    "doubt": (
        "Confidence of wrong labels",
        ("recordings", "labels by",
         *(f"below {below}: % of time, % of wrong time" for below in CONFIDENCES)),
        confidence_rows,
    ),
    "training": (
        "The paper's model, evaluated against the truth",
        ("recordings", "trained on labels by", "accuracy %", "loss against labels by the truth",
         "AUC in contact", "events missed in 0.2 s %", "false alarms/min"),
        training_rows,
    ),
}  # fmt: skip


if __name__ == "__main__":
    main()
