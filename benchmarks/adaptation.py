"""Measure what labelled recordings of a hand add to builtin:any: docs/study/adaptation.md.

    holdfast simulate adaptation/ --randomize --repeats 12 --grasps 24 --seed 200
    python benchmarks/adaptation.py adaptation/ --real "$HOLDFAST_DATA"

Every hand is a randomized hand of the twin, with 24 grasps. The last 4 are tested. `adapted` is
what `holdfast train --init builtin:any` makes from the first 1, 2, 5 or 20 of the others, and
`new` what `holdfast train --features any --hold 0.1 --trials 0` makes from them. All differences
are to builtin:any on the same grasps; their intervals are by bootstrap over the hands.

`--real` reads the folder with the real uSkin recordings. Two of the five have a slip; each is
tested by models of the other one alone, and of the other one and one recording without slip.
They were not used to choose anything.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.features import parse_features
from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.metrics import bootstrap_interval, ratio_of_sums, summarise
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.training import Setting, compute_decisions
from holdfast.training.adaptation import choose_adaptation
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.model_fit import TrainingData, fit_model
from holdfast.training.setting import Split
from holdfast.training.splits import split_data
from holdfast.training.training_samples import SamplesPlan, gather_samples

START = Model.load("builtin:any")
SETTINGS = {
    "adapted": Setting.adapting(START),
    "new": Setting(features=parse_features("any"), hold=0.1, trials=0),
}
N_TESTED = 4
HEADER = ("recordings", "model", "AUC", "difference", "accuracy %", "difference, points",
          "false alarms/min", "difference", "hands; changed")  # fmt: skip


class Figures(NamedTuple):
    """Metrics of one model on one hand: AUC in contact, accuracy [%], false alarms per minute."""

    auc: float
    accuracy: float
    false_alarms: float


def main(folder: Path, sizes: Sequence[int], real: Path | None) -> None:
    shipped: dict[tuple[int, str], list[Figures]] = defaultdict(list)
    others: dict[tuple[int, str], list[Figures]] = defaultdict(list)
    changes: dict[int, list[str]] = defaultdict(list)
    for grasps in hands_of(folder):
        tested = grasps[-N_TESTED:]
        start = figures_of(START, tested)
        for (size, name), (model, change) in models_of(grasps[:-N_TESTED], sizes).items():
            shipped[size, name].append(start)
            others[size, name].append(figures_of(model, tested))
            changes[size] += [change] if change else []
    print_rows([HEADER, ("---",) * len(HEADER)])
    first = next(iter(shipped.values()))
    print_rows([("none", "shipped", *cells(first, first), str(len(first)))])
    for (size, name), found in others.items():
        text = (
            f"{len(found)}; {count_text(changes[size])}" if name == "adapted" else str(len(found))
        )
        print_rows([(str(size), name, *cells(found, shipped[size, name]), text)])
    if real is not None:
        print_real(real)


def hands_of(folder: Path) -> Iterator[list[Recording]]:
    """Yield the grasps of one hand at a time."""
    for _, grasps in groupby(load_dataset(folder), key=lambda each: each.metadata["hand"]):
        yield list(grasps)


def models_of(
    recordings: Sequence[Recording], sizes: Sequence[int]
) -> dict[tuple[int, str], tuple[Model, str]]:
    """Return the models of the first recordings, and what was changed of an adapted one.

    Without both classes there is no new model, and the shipped one is kept.
    """
    found = {}
    for name, setting in SETTINGS.items():
        scan = scan_dataset(recordings, relative=True)
        split: Split = "recording" if len(recordings) > 1 else "time"
        data_split = split_data(scan.recordings, split, 0)
        plan = SamplesPlan(scan, setting, data_split, only_stable=True)
        data = TrainingData(scan, data_split, gather_samples(recordings, plan))
        own = data.fingers["*"]
        for size in sizes:
            held = set(range(size, len(recordings)))
            if own.without(held).one_class:
                found[size, name] = START, "kept" if setting.init else ""
                continue
            parameters = setting.recipe_of("*").reference
            if setting.init is not None:
                parameters = choose_adaptation(
                    own, START.fingers["*"].stable.linear, held
                ).parameters
            model = fit_model(data, setting, {"*": parameters}, held)
            found[size, name] = model or START, str(parameters.get("change", ""))
    return dict(sorted(found.items(), key=lambda item: item[0][0]))


def figures_of(model: Model, recordings: Sequence[Recording]) -> Figures:
    decisions = (compute_decisions(model, recording) for recording in recordings)
    metrics = summarise(decisions, n_resamples=1)
    pooled, hand = metrics.pooled, metrics.events.hand
    return Figures(*(np.nan if x is None else x for x in (
        pooled.auc_contact, pooled.accuracy, hand.false_alarms_per_minute
    )))  # fmt: skip


def cells(found: Sequence[Figures], start: Sequence[Figures]) -> list[str]:
    """Return mean and paired difference of every metric; hands without it are left out."""
    table = []
    for own, other, form in zip(zip(*found, strict=True), zip(*start, strict=True),
                                (".3f", ".1f", ".1f"), strict=True):  # fmt: skip
        known = np.isfinite(own) & np.isfinite(other)
        difference = (np.array(own) - np.array(other))[known]
        table += [f"{np.array(own)[known].mean():{form}}", with_interval(difference, "+" + form)]
    return table


def with_interval(values: np.ndarray, form: str) -> str:
    if not values.any():
        return ""
    mean = ratio_of_sums(values, np.ones(len(values)))
    low, high = bootstrap_interval(mean, n_recordings=len(values)) or (np.nan, np.nan)
    return f"{values.mean():{form}} ({low:{form}} to {high:{form}})"


def count_text(changes: Sequence[str]) -> str:
    counts = {name: changes.count(name) for name in sorted(set(changes))}
    return ", ".join(f"{'kept' if name == 'none' else name} {n}" for name, n in counts.items())


def print_real(data: Path) -> None:
    every = list(import_recordings(data / "uskin_pick_move", "uskin-pick-move"))
    slips = [each for each in every if has_slip(each)]
    quiet = [each for each in every if not has_slip(each)]
    print()
    print_rows([("tested", "recordings", "model", "AUC", "accuracy %", "false alarms/min")])
    print_rows([("---",) * 6])
    for tested in slips:
        others = [each for each in slips if each is not tested]
        print_rows([real_row(tested, "none", "shipped", [START])])
        for size, sets in ((1, [others]), (2, [[*others, one] for one in quiet])):
            fits = [models_of(own, [size]) for own in sets]
            for name in SETTINGS:
                models = [fit[size, name][0] for fit in fits]
                taken = count_text([fit[size, name][1] for fit in fits])
                text = f"{name} ({taken})" if name == "adapted" else name
                print_rows([real_row(tested, str(size), text, models)])


def real_row(tested: Recording, size: str, name: str, models: Sequence[Model]) -> tuple[str, ...]:
    """Return the row of one left-out recording: the mean over the models."""
    auc, accuracy, alarms = np.mean([figures_of(model, [tested]) for model in models], axis=0)
    return tested.name[-8:], size, name, f"{auc:.3f}", f"{accuracy:.1f}", f"{alarms:.1f}"


def has_slip(recording: Recording) -> bool:
    modules = recording.modules.values()
    return any(label.state == "UNSTABLE" for module in modules for label in module.labels)


def print_rows(rows: Sequence[Sequence[str]]) -> None:
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sizes", type=int, nargs="+", default=(1, 2, 5, 20))
    parser.add_argument("--real", type=Path)
    given = parser.parse_args()
    main(given.folder, given.sizes, given.real)
