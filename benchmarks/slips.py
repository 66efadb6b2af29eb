"""Score decisions about the slip of fingers, of methods and of models, on given recordings.

    holdfast simulate train/ --profile slips --seed 0
    holdfast simulate test/ --profile slips --seed 1
    python benchmarks/slips.py train/ test/ --model builtin:twin --model mine.json
    python benchmarks/slips.py train/ test/ --methods holdfast slip_servo --picture pictures/

Prints the table `slips` of the study as Markdown: every method is fitted to TRAIN_FOLDER, its
threshold is chosen there out of fold, and it is scored on TEST_FOLDER. The last line is the trivial
one that never reports a slip. A model has two lines: at
its own threshold, and at the threshold that is chosen on TRAIN_FOLDER by the same rule. Below it,
for the models, the causes by sample. `--picture` draws truth beside decisions of the first model,
of the first grasp with each kind of slip event in TEST_FOLDER in which a finger slides over 1 mm:
each in a file, and all in `slips.png`.

Recordings on which a model was trained are no test of it: use seeds that it has not seen.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from holdfast.io import load_dataset
from holdfast.metrics import score_recording
from holdfast.metrics.slip_thresholds import slip_intervals, slip_summary
from holdfast.metrics.slip_truth import DISTANCES
from holdfast.metrics.slips import SlipCounts, SlipCurve
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Integers
from holdfast.training import compute_decisions
from holdfast_lab.figures.slips import KIND_TITLES, event_kinds, slip_figure, slips_figure
from holdfast_lab.report.images import png_of
from holdfast_lab.report.result_tables import Row
from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.study.comparison.slip_table import (
    FITTED_TO,
    HELD_MINUTES,
    METHOD,
    N_GROSS,
    N_OVER_1MM,
    N_SLIPS,
    method_keys,
    slip_rows,
    slip_table,
)
from holdfast_lab.study.evaluation.cause_counts import cause_table, count_causes
from holdfast_lab.study.evaluation.evaluate_method import EvaluationEffort, EvaluationJob
from holdfast_lab.study.evaluation.evaluate_slips import (
    SlipEvaluation,
    evaluate_slips,
    summarise_slips,
)
from holdfast_lab.study.methods.slip_methods import SLIP_METHODS
from holdfast_lab.study.plan import scan_corpus

CHOSEN, SHIPPED = "from training", "its own"
THRESHOLD = "threshold"
LINES = (FITTED_TO, METHOD, THRESHOLD)
MODEL = "its training"
NEVER = {FITTED_TO: "-", METHOD: "never a slip", THRESHOLD: "-"}
"""Line of the trivial baseline, which finds nothing and has no false alarm."""
COUNTS = (N_SLIPS, N_GROSS, N_OVER_1MM, HELD_MINUTES)
"""Columns about the recordings, the same in all lines."""


class ModelCounts(NamedTuple):
    """Counts of a model on the recordings of a folder, one entry for each with known slips."""

    shipped: list[dict[str, SlipCounts]]
    curves: list[dict[str, SlipCurve]]


def method_rows(
    names: Sequence[str], train: Path, test: Path, effort: EvaluationEffort, seed: int
) -> Iterator[Row]:
    """Yield the rows of the methods."""
    training, tested = scan_corpus("train", train), scan_corpus("test", test)
    for name in names:
        job = EvaluationJob(
            name, training, ("object", "recording"), (tested,), effort=effort, seed=seed,
            compared=tuple(names), slips=True,
        )  # fmt: skip
        evaluations = evaluate_slips(job)
        if "test" in evaluations:
            yield from slip_rows({**method_keys(name), THRESHOLD: CHOSEN}, evaluations["test"])


def count_model(model: Model, folder: Path) -> ModelCounts:
    """Return the counts of a model on the recordings of a folder."""
    decided = (compute_decisions(model, recording) for recording in load_dataset(folder))
    results = [score_recording(decisions, slip_curves=True) for decisions in decided]
    known = [result for result in results if result.slips]
    return ModelCounts(
        [dict(result.slips) for result in known], [dict(result.slip_curves) for result in known]
    )


def model_rows(name: str, train: Path, test: Path, seed: int) -> Iterator[Row]:
    """Yield the rows of a model: at its own threshold, and at one chosen on the training folder."""
    model = Model.load(name)
    keys = {FITTED_TO: MODEL, METHOD: title_of(name)}
    tested = count_model(model, test)
    if not tested.shipped:
        raise SystemExit(f"{name} has no slip rule, or no slips are known in {test}")
    by_recording = [
        SlipCurve.of_one(SlipCounts.total(fingers.values())) for fingers in tested.shipped
    ]
    summary = slip_summary(tested.shipped, slip_intervals(by_recording, seed=seed))
    if summary is not None:
        shipped = SlipEvaluation("", len(by_recording), summary)
        yield from slip_rows({**keys, THRESHOLD: SHIPPED}, shipped)
    training = count_model(model, train)
    chosen = summarise_slips(tested.curves, seed, training=training.curves)
    yield from slip_rows({**keys, THRESHOLD: CHOSEN}, chosen)


def never_rows(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield the rows of the trivial baseline, with the columns of another line."""
    line = {key: rows[0].keys[key] for key in LINES}
    for row in rows:
        if line.items() <= row.keys.items():
            figure = row.keys["figure"]
            value = row.ours if figure in COUNTS else 0.5 if figure == "AUC" else 0.0
            yield Row({**NEVER, "figure": figure}, value, None, row.n)


def title_of(name: str) -> str:
    """Return the name of a model as it stands in the tables: of a file, without its folder."""
    return Path(name).stem if Path(name).suffix else name


def cause_counts(name: str, folder: Path) -> list[Integers]:
    """Return the causes of each recording of a folder by a model."""
    model = Model.load(name)
    return [count_causes(model, recording) for recording in load_dataset(folder)]


def draw(name: str, folder: Path, out: Path) -> None:
    """Write a picture of the first slip of each kind over 1 mm, and one of them all."""
    out.mkdir(parents=True, exist_ok=True)
    model, events = Model.load(name), dict[str, Recording]()
    for recording in load_dataset(folder):
        for kind in event_kinds(recording, DISTANCES[0]):
            events.setdefault(kind, recording)
    figures = {kind: slip_figure(model, events[kind], kind) for kind in events}
    shown = [(events[kind], kind) for kind in KIND_TITLES if kind in events]
    for title, figure in {**figures, "slips": slips_figure(model, shown)}.items():
        path = out / f"{title}.png"
        path.write_bytes(png_of(figure))
        print(path)


def main() -> None:
    """Print the tables, and draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("train", type=Path, metavar="TRAIN_FOLDER")
    parser.add_argument("test", type=Path, metavar="TEST_FOLDER")
    parser.add_argument("--model", action="append", default=[], help="name or file of a model")
    parser.add_argument("--methods", nargs="*", choices=tuple(SLIP_METHODS), metavar="NAME",
                        help=f"of {', '.join(SLIP_METHODS)}; all by default")  # fmt: skip
    parser.add_argument("--picture", type=Path, metavar="DIR", help="folder for pictures")
    parser.add_argument("--max-samples", type=int, default=20_000, help="still, of a finger")
    parser.add_argument("--seed", type=int, default=0, help="of folds and resamples")
    options = parser.parse_args()
    if options.picture and not options.model:
        parser.error("--picture needs a --model")
    names = tuple(SLIP_METHODS) if options.methods is None else tuple(options.methods)
    effort = EvaluationEffort(max_samples=options.max_samples)
    rows = list(method_rows(names, options.train, options.test, effort, options.seed))
    for name in options.model:
        rows += model_rows(name, options.train, options.test, options.seed)
    rows += never_rows(rows)
    print(to_markdown(slip_table(rows, LINES)))
    if options.model:
        counts = {title_of(name): cause_counts(name, options.test) for name in options.model}
        print(to_markdown(cause_table(counts, options.seed)))
    if options.picture:
        draw(options.model[0], options.test, options.picture)


if __name__ == "__main__":
    main()
