"""How good labels by rules are, and what training on them costs: the tables of docs/labels.md.

    holdfast simulate twin/reference --profile reference --seed 0
    holdfast simulate twin/vigorous --profile vigorous --seed 0
    holdfast simulate twin/gentle --profile gentle --seed 0
    holdfast import uskin_pick_move real
    python benchmarks/label_rules.py --folder twin/reference --folder twin/vigorous \
        --folder twin/gentle --real real

For each folder of the twin's recordings: the agreement of each rule with the truth (kappa, onset
differences), with the poses as they are and with the jitter of a tracker; and the paper's model
trained on every second recording with labels by the truth and by each rule, judged on the others
against the truth. For real recordings with a marker on the object: the agreement with the
measured labels, and with an angle chosen on the other recordings.
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
from holdfast.training.fitting import fit_all

Labels = Mapping[str, Sequence[Label]]
Rule = Callable[[Recording], Labels]

REFERENCE = {"C": 1.0, "class_weight": "balanced"}
ANGLES = (0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.3)
DOUBT = (0.5, 0.7, 0.8)
FAR = 1.0  # [m]: with it, displacement is the angle alone


def main() -> None:
    arguments = parse()
    for name, (title, header, rows_of) in TABLES.items():
        if arguments.only in (None, name):
            found = (row for each in arguments.folder for row in rows_of(each, arguments.every))
            table(title, header, found)
    if arguments.real and arguments.only in (None, "real"):
        real = list(load_dataset(arguments.real))
        table("Against measured slip: kappa, stable against the rest", *real_table(real))


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, action="append", default=[])
    parser.add_argument("--real", type=Path)
    parser.add_argument("--every", type=int, default=1, help="take every n-th recording only")
    parser.add_argument("--only", choices=[*TABLES, "real"], help="one of the tables")
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
    """By poses as a tracker gives them: 60 a second, each with its own error."""

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
    "tracking, poses as they are": by_poses,
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
            agreed[name].append(against_own(recording, rule(recording)))
    for name, found in agreed.items():
        yield f"{folder.name}, {len(chosen)}", name, *agreement_cells(pool(found).pooled)


def against_own(recording: Recording, labels: Labels) -> RecordingAgreement:
    own = {name: module.labels for name, module in recording.modules.items()}
    times = {name: module.times for name, module in recording.modules.items()}
    return compare(own, labels, times, recording.name)


def agreement_cells(found: PooledAgreement) -> Iterator[str]:
    onsets = found.onset_differences
    yield f"{found.kappa:.3f}"
    yield f"{found.kappa_stable:.3f}"
    yield f"{onsets.n} of {onsets.n + onsets.only_a}"
    yield str(onsets.only_b)
    yield f"{onsets.median * 1000:+.0f} ms"
    yield f"{onsets.p95 * 1000:.0f} ms"


def doubt_rows(folder: Path, every: int) -> Iterator[tuple[str, ...]]:
    """How much of the time, and of the time that is labelled wrongly, doubtful labels hold."""
    recordings = load_dataset(folder)
    chosen = range(0, len(recordings), every)
    for name in ("signal", "tracking, poses as they are"):
        counts = np.concatenate([right_or_wrong(recordings[k], RULES[name]) for k in chosen])
        cells = []
        for below in DOUBT:
            doubtful = counts[counts[:, 0] < below, 1:].sum(axis=0)
            time, wrong = 100 * doubtful / counts[:, 1:].sum(axis=0)
            cells.append(f"{time:.0f}, {wrong:.0f}")
        yield f"{folder.name}, {len(chosen)}", name, *cells


def right_or_wrong(recording: Recording, rule: Rule) -> np.ndarray:
    """(n_labels, 3) confidence, samples, and samples that the truth labels otherwise."""
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
    taught, judged = recordings[::2], recordings[1::2]
    best = None
    rules: dict[str, Rule | None] = {"the truth": None, **RULES}
    for name, rule in rules.items():
        given = taught if rule is None else [each.with_labels(rule(each)) for each in taught]
        metrics = evaluate(fit_all(given, Setting(trials=0), REFERENCE), judged)
        best = best or metrics
        cells = training_cells(metrics, best)
        yield f"{folder.name}, {len(taught)} and {len(judged)}", name, *cells


def training_cells(metrics: Metrics, best: Metrics) -> Iterator[str]:
    yield f"{metrics.pooled.accuracy:.1f}"
    mine, theirs = right_of(metrics), right_of(best)
    less = ratio_of_sums(theirs[:, 0] - mine[:, 0], mine[:, 1])
    low, high = bootstrap_interval(less, len(mine))
    cost = 100 * (theirs[:, 0] - mine[:, 0]).sum() / mine[:, 1].sum()
    yield "" if metrics is best else f"{cost:.1f} ({100 * low:.1f} to {100 * high:.1f})"
    yield f"{metrics.pooled.auc_contact:.3f}"
    yield f"{metrics.events.hand.missed['0.2']:.0f}"
    yield f"{metrics.events.hand.false_alarms_per_minute:.1f}"


def right_of(metrics: Metrics) -> np.ndarray:
    """(n_recordings, 2) samples that were told right, and all that were told."""
    confusions = [
        np.sum([finger.confusion for finger in each.fingers.values()], axis=0)
        for each in metrics.recordings
    ]
    return np.array([[np.trace(each), each.sum()] for each in confusions])


# Real recordings


def real_table(recordings: Sequence[Recording]) -> tuple[Sequence[str], Iterator[Sequence[str]]]:
    header = ("labels by", *(each.name[-8:] for each in recordings), "all", "onsets found",
              "onset: median")  # fmt: skip

    def rows() -> Iterator[Sequence[str]]:
        for name, rule in REAL_RULES.items():
            yield name, *real_cells([against_own(each, rule(each)) for each in recordings])
        agreed = {angle: [turned(each, angle) for each in recordings] for angle in ANGLES}
        best = [best_angle(agreed, place) for place in range(len(recordings))]
        found = [agreed[angle][place] for place, angle in enumerate(best)]
        shown = ", ".join(f"{angle:g}" for angle in best)
        yield f"tracking, turned by an angle chosen on the others ({shown} rad)", *real_cells(found)

    return header, rows()


REAL_RULES: dict[str, Rule] = {
    "signal": lambda each: signal.propose(each, tare="first"),
    "tracking, speed": lambda each: tracking.propose(each, tare="first"),
    "tracking, displacement": lambda each: tracking.propose(
        each, tare="first", rule=TrackingRule(measure="displacement")
    ),
}


def turned(recording: Recording, angle: float) -> RecordingAgreement:
    rule = TrackingRule(measure="displacement", distance=FAR, angle=angle)
    return against_own(recording, tracking.propose(recording, tare="first", rule=rule))


def best_angle(agreed: Mapping[float, Sequence[RecordingAgreement]], place: int) -> float:
    """The angle that agrees best on all recordings but one."""

    def kappa(angle: float) -> float:
        others = [each for k, each in enumerate(agreed[angle]) if k != place]
        return pool(others).pooled.kappa_stable or 0.0

    return max(agreed, key=kappa)


def real_cells(found: Sequence[RecordingAgreement]) -> Iterator[str]:
    for each in found:
        (finger, *_) = each.fingers.values()
        yield one_class(finger.confusion) or f"{finger.kappa_stable:.2f}"
    whole: Agreement = pool(found)
    onsets = whole.pooled.onset_differences
    yield f"{whole.pooled.kappa_stable:.2f}"
    yield f"{onsets.n} of {onsets.n + onsets.only_a}, {onsets.only_b} of its own"
    yield "" if onsets.median is None else f"{onsets.median * 1000:+.0f} ms"


def one_class(confusion: Sequence[Sequence[int]]) -> str:
    """What is right, where the labels know one class and kappa means nothing."""
    counts = np.array(confusion)
    if counts[:2].sum():
        return ""
    return f"{100 * counts[2, 2] / counts.sum():.0f} % right"


Rows = Callable[[Path, int], Iterator[Sequence[str]]]
TABLES: dict[str, tuple[str, Sequence[str], Rows]] = {
    "agreement": (
        "Agreement with the twin's truth",
        ("recordings", "labels by", "kappa", "kappa, stable against the rest", "onsets found",
         "onsets of its own", "onset: median", "95 % within"),
        agreement_rows,
    ),
    "doubt": (
        "Where the wrong labels are",
        ("recordings", "labels by",
         *(f"below {below}: time %, of what is wrong %" for below in DOUBT)),
        doubt_rows,
    ),
    "training": (
        "The paper's model, judged against the truth",
        ("recordings", "trained on labels by", "accuracy %", "less than by the truth",
         "AUC in contact", "events missed in 0.2 s %", "false alarms/min"),
        training_rows,
    ),
}  # fmt: skip


if __name__ == "__main__":
    main()
