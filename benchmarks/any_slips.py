"""Slips that `builtin:any` finds on hands it never met, calibrated by two minutes of handling.

    python benchmarks/any_slips.py hands/ --hands 10 --repeats 5

Each hand is the reference hand of the twin with another skin, whose seed comes from the id of the
commit that froze the features and the recipe of the head. It is calibrated by four grasps of the
profile `handling`, as `calibrate twin:` does in two minutes, and tested on grasps that it has not
seen, by the metrics of `evaluate`. Rivals have a threshold by the same rule on the same handling.

| part | what is tested |
|---|---|
| reference | objects, skin and pushes of the reference hand |
| slips | slips that no push causes |
| others | other objects on the skin of another seed, without new handling |
| orca | the sensor `orca-finger`, with its own handling |
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from holdfast.detection import Model
from holdfast.io import load_recording
from holdfast.metrics.slip_curves import SLIP_THRESHOLDS, choose_threshold
from holdfast.metrics.slip_truth import SlipDecisions
from holdfast.metrics.slips import SlipCounter, SlipCounts, SlipMetrics, slip_metrics
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.simulated_grasps import path_of, plan_grasps, simulate_grasps
from holdfast.training.calibration import calibrate_with_report
from holdfast.training.evaluation import compute_decisions
from holdfast.twin.objects import OTHER_OBJECTS, load_objects

FROZEN = "629398100d71007db5c1605ecf00a7e5d3de46f2"
"""The commit that froze the recipe of the head; seeds are digits of its id."""
N_HANDLING = 4
"""Grasps of handling: two minutes."""
LAG = 8
"""Samples over which the rival takes the change of the force."""


def seed_of(hand: int, commit: str = FROZEN) -> int:
    return int(commit[3 * hand : 3 * hand + 6], 16)


def simulated(
    folder: Path, objects: str = "", repeats: int = 1, **options: object
) -> list[Recording]:
    """Return grasps, which are simulated unless they exist; failed ones are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    grasps = plan_grasps(objects, "2", repeats, **options)  # type: ignore[arg-type]
    simulate_grasps(grasps, folder, engine=Engine(1), force=False, notify=lambda _: None)
    paths = [path_of(grasp.name, folder) for grasp in grasps]
    return [load_recording(path) for path in paths if path.exists()]


def handling_of(
    folder: Path, hand: int, commit: str = FROZEN, **options: object
) -> list[Recording]:
    names, seed = list(load_objects(None)), seed_of(hand, commit)
    turn = [names[(hand + k) % len(names)] for k in range(N_HANDLING)]
    return simulated(folder, ",".join(turn), profile="handling", seed=seed, **options)


Scores = Callable[[Recording, Model], Iterator[SlipDecisions]]


def model_scores(recording: Recording, model: Model) -> Iterator[SlipDecisions]:
    for finger in compute_decisions(model, recording).fingers.values():
        if finger.slip is not None:
            yield finger.slip


def rival_scores(change: Callable[[np.ndarray], np.ndarray]) -> Scores:
    """Return a rival: a function of the force (n, 3) in place of the log odds of the model."""

    def scores(recording: Recording, model: Model) -> Iterator[SlipDecisions]:
        from holdfast.detection import detect

        traces = detect(model, recording).fingers
        for name, finger in compute_decisions(model, recording).fingers.items():
            if finger.slip is None:
                continue
            # In noises of a quiet open hand: so that all fingers and sensors share thresholds.
            force = traces[name].force
            start = np.nan_to_num(force[: max(len(force) // 20, 30)])
            value = change(np.nan_to_num(force)) / max(float(start.std()), 1e-6)
            probability = value / (value + 1e3)  # any rising function ranks alike
            held = finger.slip.probability > 0
            yield replace(finger.slip, probability=np.where(held, probability, 0.0))

    return scores


def over_lag(force: np.ndarray) -> np.ndarray:
    change = np.zeros(len(force))
    change[LAG:] = np.linalg.norm(force[LAG:] - force[:-LAG], axis=1)
    return change


def from_start(force: np.ndarray) -> np.ndarray:
    """Return the change of the force from the first second of contact on."""
    load = np.linalg.norm(force, axis=1)
    held = load > 0.3 * np.quantile(load, 0.9)
    first = int(np.argmax(held)) + 150
    return np.linalg.norm(force - force[min(first, len(force) - 1)], axis=1)


def curve(
    recordings: Sequence[Recording], scores: Scores, model: Model, at: np.ndarray
) -> SlipCounts:
    """Return the counts of all fingers at some thresholds."""
    decided = [own for recording in recordings for own in scores(recording, model)]
    counts = [SlipCounter.of(own).count(own.raised_at(at)) for own in decided if own.truth]
    return SlipCounts.total(counts)


def rival_threshold(handling: Sequence[Recording], scores: Scores, model: Model) -> float:
    index = choose_threshold(curve(handling, scores, model, SLIP_THRESHOLDS), 1.0)
    return 1.0 if index is None else float(SLIP_THRESHOLDS[index])


def shares(metrics: SlipMetrics) -> list[float | None]:
    """Return what is found before 1 mm, within 0.05 and 0.1 s [%], and false alarms a minute."""
    within = [metrics.incipient[limit] for limit in ("0.05", "0.1")]
    return [metrics.before_1mm, *within, metrics.false_alarms_per_minute["held"]]


def row(part: str, name: str, metrics: SlipMetrics) -> str:
    *found, rate = (value or 0.0 for value in shares(metrics))
    numbers = " | ".join(f"{cell:.0f}" for cell in found)
    auc = metrics.auc or float("nan")
    return (
        f"| {part} | {name} | {numbers} | {rate:.2f} | {auc:.2f} | {metrics.n} | "
        f"{metrics.n_over_1mm} | {metrics.held_minutes:.1f} |"
    )


def best_threshold(counts: SlipCounts) -> int:
    """Return the index of the lowest threshold with one false alarm a minute on the test itself."""
    index = choose_threshold(counts, 1.0)
    return len(counts) - 1 if index is None else index


Counts = dict[tuple[str, str], SlipCounts]
"""Counts by part and by what decides."""


def counts_of_hand(hand: int, model: Model, options: argparse.Namespace) -> Counts:
    """Simulate a hand unless its recordings exist, calibrate the model, and test all parts."""
    folder, seed = options.folder / f"hand{hand}", seed_of(hand, options.commit)
    counts = Counts()
    own = (
        [] if options.parts == ["orca"] else handling_of(folder / "handling", hand, options.commit)
    )
    tests = {}
    if "reference" in options.parts:
        reference = {"profile": "reference", "seed": seed, "repeats": options.repeats}
        tests["reference"] = own, simulated(folder / "reference", **reference)
    if "slips" in options.parts:
        tests["slips"] = own, simulated(folder / "slips", profile="slips", seed=seed)
    if "others" in options.parts:
        other = {"profile": "reference", "seed": seed + 1, "table": OTHER_OBJECTS}
        tests["others"] = own, simulated(folder / "others", **other)
    if "orca" in options.parts and hand < options.orca:
        orca = {"profile": "reference", "seed": seed, "sensor": "orca-finger"}
        handling = handling_of(folder / "orca-handling", hand, options.commit, sensor="orca-finger")
        tests["orca"] = handling, simulated(folder / "orca", **orca)
    for part, (handling, recordings) in tests.items():
        report = calibrate_with_report(model, handling)
        print(f"<!-- hand {hand}, {part}: {report.sensors[0].slips[0].text()} -->")
        at = np.array([threshold_of(report.model, recordings[0])])
        counts[part, "any, calibrated"] = curve(recordings, model_scores, report.model, at)
        for title, scores in RIVALS.items():
            threshold = np.array([rival_threshold(handling, scores, report.model)])
            counts[part, title] = curve(recordings, scores, report.model, threshold)
        every = curve(recordings, model_scores, report.model, SLIP_THRESHOLDS)
        best = every[best_threshold(every)].as_curve
        counts[part, "any, best threshold for 1 on the test itself"] = best
    return counts


RIVALS = {
    "change over 8 samples": rival_scores(over_lag),
    "change from the start": rival_scores(from_start),
}


def main(options: argparse.Namespace) -> None:
    model = Model.load(options.model)
    totals: dict[tuple[str, str], list[SlipCounts]] = {}
    titles = ("part", "by", "before 1 mm [%]", "within 0.05 s [%]", "within 0.1 s [%]",
              "false alarms a held minute", "AUC", "slips", "over 1 mm", "min")  # fmt: skip
    print(f"| {' | '.join(titles)} |\n|---|---|{'--:|' * 8}")
    for hand in range(options.hands):
        for (part, title), counts in counts_of_hand(hand, model, options).items():
            totals.setdefault((part, title), []).append(counts[0])
            print(row(f"{part}, hand {hand}", title, slip_metrics(counts[0])), flush=True)
    for (part, title), counts in totals.items():
        values = np.array([shares(slip_metrics(x)) for x in counts], float)
        ranges = ", ".join(
            f"{low:.3g} to {high:.3g}"
            for low, high in zip(np.nanmin(values, 0), np.nanmax(values, 0), strict=True)
        )
        pooled = slip_metrics(SlipCounts.total(counts))
        print(row(f"{part}, all {len(counts)}", f"{title} ({ranges})", pooled))


def threshold_of(model: Model, recording: Recording) -> float:
    name, module = next(iter(recording.modules.items()))
    slip = model.finger(name, module.sensor).slip
    return 1.0 if slip is None else slip.threshold


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", default="builtin:any")
    parser.add_argument("--hands", type=int, default=10)
    parser.add_argument("--orca", type=int, default=1, help="hands with the part orca")
    parser.add_argument("--repeats", type=int, default=5, help="of each object, of reference")
    parser.add_argument("--parts", nargs="*", default=["reference", "slips", "others", "orca"])
    parser.add_argument("--commit", default=FROZEN, help="whose id has the seeds")
    main(parser.parse_args())
