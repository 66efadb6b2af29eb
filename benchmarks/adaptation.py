"""Measure how much a few own recordings improve a model: table of docs/training.md, as Markdown.

    holdfast simulate twin/vigorous --profile finger-vigorous --seed 0
    holdfast simulate twin/gentle --profile finger-gentle --seed 0
    python benchmarks/adaptation.py twin/vigorous twin/gentle

For each folder, N of its recordings are drawn at random. builtin:twin is adapted to them
(`holdfast train --init builtin:twin`), and a new model is trained on them
(`holdfast train --features holdfast --hold 0.1`); both with a search of 30 trials and with
`--trials 0`. These models, and builtin:twin without adaptation, are evaluated on all other
recordings of the folder. This is repeated for `--draws` draws. Metrics are pooled over the draws;
intervals are by bootstrap over the evaluated recordings.

Metrics by sample use the labels of the recordings. Metrics by event use labels without margin,
because a disturbance cannot be detected before its first touch.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.classifiers import Parameters
from holdfast.features import parse_features
from holdfast.io import load_dataset
from holdfast.metrics import Decisions, bootstrap_interval, ratio_of_sums, summarise
from holdfast.metrics.truth_labels import LabelRule, labels_from_truth
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast.training import Setting, compute_decisions
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.model_fit import TrainingData, fit_full_model
from holdfast.training.setting import SEARCH_SAMPLES
from holdfast.training.splits import inner_folds, split_data
from holdfast.training.training_samples import FingerSamples, gather_samples
from holdfast.training.tuning import INNER_FOLDS, search

START = "builtin:twin"
HEADER = (
    "own recordings", "model", "accuracy %", "difference to builtin:twin, points",
    "worst to best draw", "events missed in 0.1 s %", "false alarms/min",
)  # fmt: skip


class Counts(NamedTuple):
    """Counts of one recording, from which its metrics are computed."""

    right: float
    samples: float
    missed: float
    events: float
    false_alarms: float
    minutes: float


def main() -> None:
    arguments = parse()
    for folder in arguments.folders:
        print(f"\n{folder.name}, {arguments.draws} draws\n")
        for row in chain((HEADER, ("---",) * len(HEADER)), table_rows(folder, arguments)):
            print("| " + " | ".join(row) + " |", flush=True)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sizes", type=int, nargs="+", default=(2, 4, 8))
    return parser.parse_args()


def table_rows(folder: Path, arguments: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    recordings = list(load_dataset(folder))
    n = len(recordings)
    rng = np.random.default_rng(arguments.seed)
    draws = [rng.permutation(n).tolist() for _ in range(arguments.draws)]
    start = dict(enumerate(count_all(Model.load(START), recordings)))
    yield ("none", START, *row_cells([start], [start], n))
    for size in arguments.sizes:
        for name, setting in settings().items():
            counts = [evaluate_draw(recordings, draw, size, setting) for draw in draws]
            same = [{place: start[place] for place in evaluated} for evaluated in counts]
            yield (str(size), name, *row_cells(counts, same, n))


def settings() -> dict[str, Setting]:
    model = Model.load(START)
    own = {"features": parse_features("holdfast"), "hold": 0.1}
    return {
        "adapted": Setting.adapting(model),
        "adapted, `--trials 0`": Setting.adapting(model, trials=0),
        "new": Setting(**own),
        "new, `--trials 0`": Setting(**own, trials=0),
    }


def evaluate_draw(
    recordings: Sequence[Recording], draw: Sequence[int], size: int, setting: Setting
) -> dict[int, Counts]:
    """Train on the first `size` recordings of the draw; return the counts of all others."""
    model = train_model([recordings[place] for place in draw[:size]], setting)
    rest = draw[size:]
    return dict(zip(rest, count_all(model, [recordings[place] for place in rest]), strict=True))


def train_model(recordings: Sequence[Recording], setting: Setting) -> Model:
    """Train a model as `holdfast train` does, without cross-validation."""
    found = scan_dataset(recordings, setting.rate)
    data_split = split_data(found.recordings, "recording", setting.seed)
    fingers = gather_samples(recordings, found, setting, data_split)
    parameters = {
        finger: search_parameters(each, setting, finger) for finger, each in fingers.items()
    }
    return fit_full_model(TrainingData(found, data_split, fingers), setting, parameters)


def search_parameters(own: FingerSamples, setting: Setting, finger: str) -> Parameters:
    recipe, samples = setting.recipe_of(finger), own.samples
    chosen = np.arange(len(samples.stable)) % -(-len(samples.stable) // SEARCH_SAMPLES) == 0
    some = samples.take(chosen)
    folds = inner_folds(some, INNER_FOLDS, setting.seed)
    if not setting.trials or len(folds) < 2:
        return recipe.reference
    return search(some, folds, recipe, n_trials=setting.trials, seed=setting.seed)


def count_all(model: Model, recordings: Sequence[Recording]) -> list[Counts]:
    return [count(model, recording) for recording in recordings]


def count(model: Model, recording: Recording) -> Counts:
    decisions = compute_decisions(model, recording)
    pooled = summarise([decisions]).pooled
    events = summarise([without_margin(decisions, recording)]).events.hand
    (tn, _), (_, tp) = pooled.confusion
    return Counts(
        right=tn + tp,
        samples=pooled.n,
        missed=(events.missed["0.1"] or 0.0) / 100 * events.n_events,
        events=events.n_events,
        false_alarms=(events.false_alarms_per_minute or 0.0) * events.stable_minutes,
        minutes=events.stable_minutes,
    )


def without_margin(decisions: Decisions, recording: Recording) -> Decisions:
    """Return the decisions with labels without margin."""
    rule = LabelRule(margin=0.0, glitch=None)
    fingers = {
        name: replace(
            finger,
            labels=label_states(labels_from_truth(recording.truth, name, rule), finger.times),
        )
        for name, finger in decisions.fingers.items()
    }
    return Decisions.of(decisions.name, fingers, len(fingers))


def row_cells(
    counts: Sequence[dict[int, Counts]], start: Sequence[dict[int, Counts]], n: int
) -> tuple[str, ...]:
    """Return the cells of a row from the counts of each draw: the model, and the start model."""
    table, other = sum_draws(counts, n), sum_draws(start, n)
    per_draw = [100 * right / samples for right, samples, *_ in map(sum_counts, counts)]
    return (
        with_interval(100 * table[0], table[1]),
        "" if counts == start else with_interval(100 * (table[0] - other[0]), table[1], "+.2f"),
        "" if len(counts) == 1 else f"{min(per_draw):.1f} to {max(per_draw):.1f}",
        with_interval(100 * table[2], table[3]),
        with_interval(table[4], table[5]),
    )


def sum_draws(draws: Sequence[dict[int, Counts]], n: int) -> np.ndarray:
    """Return (6, n) counts of n recordings, summed over the draws."""
    nothing = Counts(*(0.0,) * 6)
    return np.array([[draw.get(k, nothing) for k in range(n)] for draw in draws]).sum(axis=0).T


def sum_counts(draw: dict[int, Counts]) -> np.ndarray:
    return np.sum(list(draw.values()), axis=0)


def with_interval(parts: np.ndarray, wholes: np.ndarray, form: str = ".1f") -> str:
    low, high = bootstrap_interval(ratio_of_sums(parts, wholes), n_recordings=len(parts))
    value = parts.sum() / wholes.sum()
    return f"{value:{form}} ({low:{form}} to {high:{form}})"


if __name__ == "__main__":
    main()
