"""`holdfast tune`: a model with the threshold for a wanted rate of false alarms."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.evaluate import print_verdict, warn_about_recordings
from holdfast.cli.options import (
    ForceOption,
    InContactOption,
    JsonOption,
    ModelArgument,
    ModelOutput,
    report_handling,
)
from holdfast.cli.slip_scores import print_slip_points, slips_origin
from holdfast.cli.terminal.console import format_number, print_json, print_line, print_table
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from holdfast.metrics.slips import SlipMetrics
    from holdfast.model import Model
    from holdfast.recordings import Recording
    from holdfast.training import ThresholdMetrics, Tuned
    from holdfast.training.slips import TunedSlips


class TunedQuestion(StrEnum):
    """Question whose threshold is chosen."""

    STABLE = "stable"
    SLIP = "slip"


def tune(
    model: ModelArgument,
    data: Annotated[Path, typer.Argument(help="A labelled recording, or a folder of them.")],
    out: ModelOutput,
    false_alarms: Annotated[
        float,
        typer.Option(
            "--false-alarms",
            help="Maximum number of false alarms per minute of stable hold; for slip, per minute "
            "of all held time of a finger.",
        ),
    ],
    question: Annotated[
        TunedQuestion,
        typer.Option("--for", help="Threshold to choose: that of STABLE, or that of a slip."),
    ] = TunedQuestion.STABLE,
    force: ForceOption = False,
    in_contact: InContactOption = False,
    as_json: JsonOption = False,
) -> None:
    """Choose the threshold for a wanted rate of false alarms.

    Write a copy of the model. Of the thresholds of the probability of stability that give at most
    so many false alarms of the hand on the recordings, it has the one that misses the fewest
    events. Tare, contact, hysteresis and hold time stay, and count. Use recordings that the model
    was not trained on: the rate is a promise for similar grasps only.

    With --for slip, it has the lowest threshold of the slip rule that gives at most so many false
    alarms of a finger, and reports a slip in at most 2 % of quiet hold. The recordings need a
    truth, or labels with the cause slip.

    Example:
      holdfast tune model.json recordings/ -o tuned.json --false-alarms 1
      holdfast tune model.json recordings/ -o tuned.json --false-alarms 1 --for slip
      holdfast tune builtin:any recordings/ -o mine.json --false-alarms 0.5 --json
    """
    require_extras("train")
    from holdfast.files import refuse_overwrite
    from holdfast.io import load_dataset
    from holdfast.model import Model
    from holdfast.training import Tuned
    from holdfast.training import tune as choose
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.training.slips import TunedSlips, tune_slips
    from holdfast.training.verdict import no_verdict

    refuse_overwrite(out, force=force)
    loaded = Model.load(model)
    recordings = load_dataset(data, in_contact=in_contact)
    n = len(recordings)
    report_handling(loaded, recordings)

    def deciding(items: "Iterable[Recording]") -> "Iterator[Recording]":
        return progress(items, "deciding", n)

    tuned: Tuned | TunedSlips
    if question is TunedQuestion.SLIP:
        tuned = tune_slips(loaded, recordings, false_alarms, progress=deciding)
    else:
        tuned = choose(loaded, recordings, false_alarms, progress=deciding)
    evaluation = evaluate_recordings(tuned.model, recordings, progress=progress)
    warn_about_recordings(evaluation, n)
    tuned.model.save(out, force=force)
    if as_json:
        document = _slip_document(tuned) if isinstance(tuned, TunedSlips) else _document(tuned)
        known = evaluation.trained_on
        print_json({"model": out, "verdict": evaluation.verdict, **document, "trained_on": known})
        return
    print_verdict(evaluation.verdict or no_verdict(len(evaluation.trained_on), n))
    if isinstance(tuned, TunedSlips):
        _print_slips(loaded, tuned, recordings[0], out)
    else:
        _print_stable(tuned, out)


def _print_stable(tuned: "Tuned", out: Path) -> None:
    _print_points(tuned)
    print_line()
    print_line(
        f"{out}: STABLE from a probability of {tuned.chosen.threshold:.3g} on, was "
        f"{tuned.before.threshold:.3g}"
    )


def _print_slips(model: "Model", tuned: "TunedSlips", first: "Recording", out: Path) -> None:
    sensors = {name: module.sensor for name, module in first.modules.items()}
    parts = [model.finger(*finger) for finger in model.fingers_of(sensors).items()]
    thresholds = sorted({part.slip.threshold for part in parts if part.slip})
    points = dict(tuned.points)
    if len(thresholds) == 1:
        points.setdefault(thresholds[0], tuned.before)
    notes = dict.fromkeys(thresholds, "before") | {tuned.threshold: "chosen"}
    print_slip_points(sorted(points.items()), notes, slips_origin(tuned.chosen))
    print_line()
    before = ", ".join(f"{threshold:.3g}" for threshold in thresholds)
    print_line(f"{out}: a slip from a probability of {tuned.threshold:.3g} on, was {before}")


def _slip_document(tuned: "TunedSlips") -> dict[str, object]:
    return {
        "for": TunedQuestion.SLIP.value,
        "threshold": tuned.threshold,
        "chosen": tuned.chosen,
        "before": tuned.before,
        "around": [_slip_point(threshold, metrics) for threshold, metrics in tuned.points],
    }


def _slip_point(threshold: float, metrics: "SlipMetrics") -> dict[str, object]:
    from msgspec import to_builtins

    return {"threshold": threshold, **to_builtins(metrics)}


def _document(tuned: "Tuned") -> dict[str, object]:
    return {
        "threshold": tuned.chosen.threshold,
        "chosen": tuned.chosen,
        "before": tuned.before,
        "around": tuned.points,
    }


def _print_points(tuned: "Tuned") -> None:
    print_line("of the hand; missed events within 0.05, 0.1 and 0.2 s of their onset")
    header = ("threshold", "STABLE %", "false/min", "0.05 s %", "0.1 s %", "0.2 s %",
              "delay s", "")  # fmt: skip
    points = [*tuned.points]
    if tuned.before.threshold not in {point.threshold for point in points}:
        points.append(tuned.before)
    notes = {tuned.before.threshold: "before", tuned.chosen.threshold: "chosen"}
    points.sort(key=lambda point: point.threshold)
    print_table(header, [(*_cells(p), notes.get(p.threshold, "")) for p in points])


def _cells(point: "ThresholdMetrics") -> tuple[str, ...]:
    events = point.events
    missed = (format_number(share, 1) for share in events.missed.values())
    never = events.delay_median is None and events.n_events
    delay = "never" if never else format_number(events.delay_median, 3)
    return (
        f"{point.threshold:.4g}", f"{point.stable:.1f}", f"{point.false_alarms:.2f}", *missed, delay
    )  # fmt: skip
