"""`holdfast tune`: a model with the threshold for a wanted rate of false alarms."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.evaluate import print_verdict, warn_about_training
from holdfast.cli.options import ForceOption, JsonOption, ModelArgument, ModelOutput
from holdfast.cli.terminal.console import format_number, print_json, print_line, print_table
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from holdfast.recordings import Recording
    from holdfast.training import ThresholdMetrics, Tuned


def tune(
    model: ModelArgument,
    data: Annotated[Path, typer.Argument(help="A labelled recording, or a folder of them.")],
    out: ModelOutput,
    false_alarms: Annotated[
        float,
        typer.Option(
            "--false-alarms", help="Maximum number of false alarms per minute of stable hold."
        ),
    ],
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Choose the threshold for a wanted rate of false alarms.

    Write a copy of the model. Of the thresholds of the probability of stability that give at most
    so many false alarms of the hand on the recordings, it has the one that misses the fewest
    events. Tare, contact, hysteresis and hold time stay, and count. Use recordings that the model
    was not trained on: the rate is a promise for similar grasps only.

    Example:
      holdfast tune model.json recordings/ -o tuned.json --false-alarms 1
      holdfast tune builtin:any recordings/ -o mine.json --false-alarms 0.5 --json
    """
    require_extras("train")
    from holdfast.files import refuse_overwrite
    from holdfast.io import load_dataset
    from holdfast.model import Model
    from holdfast.training import tune as choose
    from holdfast.training.evaluation import was_trained_on
    from holdfast.training.verdict import no_verdict, verdict_of_events

    refuse_overwrite(out, force=force)
    loaded = Model.load(model)
    recordings = load_dataset(data)
    trained_on: list[str] = []

    def with_progress(items: "Iterable[Recording]") -> "Iterator[Recording]":
        for recording in progress(items, "deciding", len(recordings)):
            if was_trained_on(loaded, recording):
                trained_on.append(recording.name)
            yield recording

    tuned = choose(loaded, recordings, false_alarms, progress=with_progress)
    warn_about_training(trained_on, len(recordings))
    tuned.model.save(out, force=force)
    sentence = None if trained_on else verdict_of_events(tuned.chosen.events)
    if as_json:
        print_json(_document(tuned, out, sentence, trained_on))
        return
    print_verdict(sentence or no_verdict(len(trained_on), len(recordings)))
    _print_points(tuned)
    print_line()
    print_line(
        f"{out}: STABLE from a probability of {tuned.chosen.threshold:.3g} on, was "
        f"{tuned.before.threshold:.3g}"
    )


def _document(
    tuned: "Tuned", out: Path, sentence: str | None, trained_on: list[str]
) -> dict[str, object]:
    return {
        "model": out,
        "verdict": sentence,
        "threshold": tuned.chosen.threshold,
        "chosen": tuned.chosen,
        "before": tuned.before,
        "around": tuned.points,
        "trained_on": trained_on,
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
