"""`holdfast tune`: a model with the threshold for a wanted rate of false alarms."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.evaluate import print_verdict, warn_about_recordings
from holdfast.cli.options import (
    ForceOption,
    JsonOption,
    ModelArgument,
    ModelOutput,
    StartOptions,
    report_handling,
)
from holdfast.cli.slip_scores import print_slip_points, slips_origin
from holdfast.cli.terminal.console import format_number, print_json, print_line, print_table
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from holdfast.recordings import Recording
    from holdfast.training import CurvePoint, Tuned


class TunedQuestion(StrEnum):
    """Question whose threshold is chosen."""

    STABLE = "stable"
    SLIP = "slip"


def tune(
    model: ModelArgument,
    data: Annotated[Path, typer.Argument(help="A labelled recording, or a folder of them.")],
    out: ModelOutput,
    *,
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
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Choose the threshold for a wanted rate of false alarms.

    Write a copy of the model. Of the thresholds of the probability of stability that give at most
    so many false alarms of the hand on the recordings, it has the one that misses the fewest
    events. Tare, contact, hysteresis and hold time stay, and count. Use recordings that the model
    was not trained on: the rate is a promise for similar grasps only.

    With --for slip, it is the threshold of the slip rule, by the false alarms and slips of single
    fingers; a slip is reported in at most 2 % of quiet hold. The recordings need a truth, or
    labels with the cause slip.

    Example:
      holdfast tune model.json recordings/ -o tuned.json --false-alarms 1
      holdfast tune model.json grasps/ -o mine.json --false-alarms 1 --for slip
      holdfast tune builtin:any recordings/ -o mine.json --false-alarms 0.5 --json
    """
    require_extras("train")
    from holdfast.files import refuse_overwrite
    from holdfast.model import Model
    from holdfast.training import tune as choose
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.training.verdict import no_verdict

    refuse_overwrite(out, force=force)
    loaded = Model.load(model)
    recordings = start.load_dataset(data)
    n = len(recordings)
    report_handling(loaded, recordings)

    def deciding(items: "Iterable[Recording]") -> "Iterator[Recording]":
        return progress(items, "deciding", n)

    tuned = choose(loaded, recordings, false_alarms, question.value, progress=deciding)
    evaluation = evaluate_recordings(tuned.model, recordings, progress=progress)
    warn_about_recordings(evaluation, n)
    tuned.model.save(out, force=force)
    if as_json:
        known = evaluation.trained_on
        document = _slip_document(tuned) if tuned.chosen.slips else _document(tuned)
        print_json({"model": out, "verdict": evaluation.verdict, **document, "trained_on": known})
        return
    print_verdict(evaluation.verdict or no_verdict(len(evaluation.trained_on), n))
    chosen, before = tuned.chosen, tuned.before
    points = {point.threshold: point for point in (*tuned.points, before)}
    notes = {before.threshold: "before", chosen.threshold: "chosen"}
    _print_points([points[t] for t in sorted(points)], notes)
    print_line()
    answer = "STABLE" if chosen.slips is None else "a slip"
    print_line(
        f"{out}: {answer} from a probability of {chosen.threshold:.3g} on, was "
        f"{before.threshold:.3g}"
    )


def _document(tuned: "Tuned") -> dict[str, object]:
    def document(point: "CurvePoint") -> dict[str, object]:
        return {"threshold": point.threshold, "stable": point.stable, "events": point.events}

    return {
        "threshold": tuned.chosen.threshold,
        "chosen": document(tuned.chosen),
        "before": document(tuned.before),
        "around": [document(point) for point in tuned.points],
    }


def _slip_document(tuned: "Tuned") -> dict[str, object]:
    from msgspec import to_builtins

    return {
        "for": TunedQuestion.SLIP.value,
        "threshold": tuned.chosen.threshold,
        "chosen": tuned.chosen.slips,
        "before": tuned.before.slips,
        "around": [{"threshold": p.threshold, **to_builtins(p.slips)} for p in tuned.points],
    }


def _print_points(points: "Sequence[CurvePoint]", notes: dict[float, str]) -> None:
    slips = {point.threshold: point.slips for point in points if point.slips is not None}
    if slips:
        origin = slips_origin(next(iter(slips.values())))
        print_slip_points(slips.items(), notes, origin)
        return
    print_line("of the hand; missed events within 0.05, 0.1 and 0.2 s of their onset")
    header = ("threshold", "STABLE %", "false/min", "0.05 s %", "0.1 s %", "0.2 s %",
              "delay s", "")  # fmt: skip
    print_table(header, [(*_cells(p), notes.get(p.threshold, "")) for p in points])


def _cells(point: "CurvePoint") -> tuple[str, ...]:
    events = point.events
    if events is None:
        return ()
    missed = (format_number(share, 1) for share in events.missed.values())
    never = events.delay_median is None and events.n_events
    delay = "never" if never else format_number(events.delay_median, 3)
    return (
        f"{point.threshold:.4g}", f"{point.stable:.1f}", f"{point.false_alarms:.2f}", *missed, delay
    )  # fmt: skip
