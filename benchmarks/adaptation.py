"""What a few recordings of one's own are worth: the table of docs/training.md, as Markdown.

    holdfast simulate twin/vigorous --profile vigorous --seed 0
    holdfast simulate twin/gentle --profile gentle --seed 0
    python benchmarks/adaptation.py twin/vigorous twin/gentle

For each folder, N of its recordings are drawn at random; from them builtin:twin is adapted
(`holdfast train --init builtin:twin`), and a model is trained from nothing
(`holdfast train --features holdfast --hold 0.1`); both with a search of 30 trials and with
`--trials 0`. They, and builtin:twin as it is, judge all other recordings of the folder; that is
done for `--draws` draws. Figures are pooled over draws, intervals are by bootstrap over the
recordings that are judged.

By sample the labels are those of the recordings; by event they are without margin, since nobody
can tell a disturbance before its first touch.
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
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast.training import Setting, decisions_of
from holdfast.training.design import FingerDesign, gather
from holdfast.training.fitting import Material, fit_whole
from holdfast.training.setting import SEARCH_SAMPLES
from holdfast.training.splits import divide, inner_folds
from holdfast.training.survey import survey
from holdfast.training.tuning import INNER_FOLDS, search
from holdfast.twin.labels import LabelRule, labels_from_truth

START = "builtin:twin"
HEADER = (
    "recordings of one's own", "model", "accuracy %", "against builtin:twin, points",
    "worst to best draw", "events missed in 0.1 s %", "false alarms/min",
)  # fmt: skip


class Counts(NamedTuple):
    """Of one recording: what its figures are made of."""

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
        for row in chain((HEADER, ("---",) * len(HEADER)), rows_of(folder, arguments)):
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


def rows_of(folder: Path, arguments: argparse.Namespace) -> Iterator[tuple[str, ...]]:
    recordings = list(load_dataset(folder))
    n = len(recordings)
    rng = np.random.default_rng(arguments.seed)
    draws = [rng.permutation(n).tolist() for _ in range(arguments.draws)]
    start = dict(enumerate(judge(Model.load(START), recordings)))
    yield ("none", START, *figures([start], [start], n))
    for size in arguments.sizes:
        for name, setting in settings().items():
            ours = [one_draw(recordings, draw, size, setting) for draw in draws]
            same = [{place: start[place] for place in judged} for judged in ours]
            yield (str(size), name, *figures(ours, same, n))


def settings() -> dict[str, Setting]:
    model = Model.load(START)
    own = {"features": parse_features("holdfast"), "hold": 0.1}
    return {
        "adapted": Setting.adapting(model),
        "adapted, `--trials 0`": Setting.adapting(model, trials=0),
        "from nothing": Setting(**own),
        "from nothing, `--trials 0`": Setting(**own, trials=0),
    }


def one_draw(
    recordings: Sequence[Recording], draw: Sequence[int], size: int, setting: Setting
) -> dict[int, Counts]:
    """What a model from the first of the draw makes of each of the others."""
    model = fitted([recordings[place] for place in draw[:size]], setting)
    rest = draw[size:]
    return dict(zip(rest, judge(model, [recordings[place] for place in rest]), strict=True))


def fitted(recordings: Sequence[Recording], setting: Setting) -> Model:
    """The model that `holdfast train` gives, without the figures out of fold."""
    found = survey(recordings, setting.rate)
    division = divide(found.entries, "recording", setting.seed)
    designs = gather(recordings, found, setting, division)
    parameters = {finger: searched(each, setting, finger) for finger, each in designs.items()}
    return fit_whole(Material(found, division, designs), setting, parameters)


def searched(design: FingerDesign, setting: Setting, finger: str) -> Parameters:
    recipe, samples = setting.recipe_of(finger), design.samples
    every = np.arange(len(samples.stable)) % -(-len(samples.stable) // SEARCH_SAMPLES) == 0
    some = samples.take(every)
    folds = inner_folds(some, INNER_FOLDS, setting.seed)
    if not setting.trials or len(folds) < 2:
        return recipe.reference
    return search(some, folds, recipe, n_trials=setting.trials, seed=setting.seed)


def judge(model: Model, recordings: Sequence[Recording]) -> list[Counts]:
    return [count(model, recording) for recording in recordings]


def count(model: Model, recording: Recording) -> Counts:
    decisions = decisions_of(model, recording)
    pooled = summarise([decisions]).pooled
    events = summarise([exact(decisions, recording)]).events.hand
    (tn, _), (_, tp) = pooled.confusion
    return Counts(
        right=tn + tp,
        samples=pooled.n,
        missed=(events.missed["0.1"] or 0.0) / 100 * events.n_events,
        events=events.n_events,
        false_alarms=(events.false_alarms_per_minute or 0.0) * events.stable_minutes,
        minutes=events.stable_minutes,
    )


def exact(decisions: Decisions, recording: Recording) -> Decisions:
    """The same decisions beside labels without margin."""
    rule = LabelRule(margin=0.0)
    fingers = {
        name: replace(
            finger,
            labels=label_states(labels_from_truth(recording.truth, name, rule), finger.times),
        )
        for name, finger in decisions.fingers.items()
    }
    return Decisions.of(decisions.name, fingers, len(fingers))


def figures(
    ours: Sequence[dict[int, Counts]], start: Sequence[dict[int, Counts]], n: int
) -> tuple[str, ...]:
    """The cells of a row, out of the counts of each draw and recording, ours and the start's."""
    table, other = summed(ours, n), summed(start, n)
    per_draw = [100 * right / samples for right, samples, *_ in map(sum_of, ours)]
    return (
        ranged(100 * table[0], table[1]),
        "" if ours == start else ranged(100 * (table[0] - other[0]), table[1], "+.2f"),
        "" if len(ours) == 1 else f"{min(per_draw):.1f} to {max(per_draw):.1f}",
        ranged(100 * table[2], table[3]),
        ranged(table[4], table[5]),
    )


def summed(draws: Sequence[dict[int, Counts]], n: int) -> np.ndarray:
    """(6, n) the counts of each of n recordings, over the draws that judged it."""
    nothing = Counts(*(0.0,) * 6)
    return np.array([[draw.get(k, nothing) for k in range(n)] for draw in draws]).sum(axis=0).T


def sum_of(draw: dict[int, Counts]) -> np.ndarray:
    return np.sum(list(draw.values()), axis=0)


def ranged(parts: np.ndarray, wholes: np.ndarray, form: str = ".1f") -> str:
    low, high = bootstrap_interval(ratio_of_sums(parts, wholes), n_recordings=len(parts))
    value = parts.sum() / wholes.sum()
    return f"{value:{form}} ({low:{form}} to {high:{form}})"


if __name__ == "__main__":
    main()
