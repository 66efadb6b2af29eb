"""`holdfast tune`: a model with the threshold for a wanted rate of false alarms."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from holdfast.cli.options import (
    ForceOption,
    JsonOption,
    ModelArgument,
    ModelOutput,
    StartOptions,
    report_handling,
)
from holdfast.cli.scores import (
    print_points,
    print_verdict,
    warn_about_recordings,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from holdfast.recordings import Recording

ANSWERS = {"stable": "STABLE", "slip": "a slip", "slip_changes": "a slip, begun in contact,"}


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
        Literal["stable", "slip"],
        typer.Option("--for", help="Threshold to choose: that of STABLE, or that of a slip."),
    ] = "stable",
    force: ForceOption = False,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Choose the threshold for a wanted rate of false alarms.

    Write a copy of the model. Of the thresholds of the probability of stability that give at most
    so many false alarms of the hand on the recordings, it has the one that misses the fewest
    events. Tare, contact, hysteresis and hold time stay, and count. Use recordings that the model
    was not trained on: the rate is a promise for similar grasps only.

    With --for slip, it is the threshold of each slip rule, by the false alarms and slips of single
    fingers; a slip is reported in at most 2 % of quiet hold. The recordings need a truth, or
    labels with the cause slip.

    Example:
      holdfast tune model.json recordings/ -o tuned.json --false-alarms 1
      holdfast tune model.json grasps/ -o mine.json --false-alarms 1 --for slip
      holdfast tune builtin:any recordings/ -o mine.json --false-alarms 0.5 --json
    """
    require_extras("train")
    from holdfast.detection import Model
    from holdfast.files import refuse_overwrite
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

    tuned = choose(loaded, recordings, false_alarms, question, progress=deciding)
    # The verdict is on the copy, with its new threshold.
    evaluation = evaluate_recordings(tuned.model, recordings, progress=progress)
    warn_about_recordings(evaluation, n)
    tuned.model.save(out, force=force)
    if as_json:
        head = {"model": out, "verdict": evaluation.verdict}
        print_json({**head, **tuned.document(), "trained_on": evaluation.trained_on})
        return
    print_verdict(evaluation.verdict or no_verdict(len(evaluation.trained_on), n))
    for part in (tuned, tuned.changes):
        if part is None:
            continue
        chosen, before = part.chosen, part.before
        # By threshold: the one of before may be among those that were tried.
        points = {point.threshold: point for point in (*part.points, before)}
        notes = {before.threshold: "before", chosen.threshold: "chosen"}
        print_points([points[t] for t in sorted(points)], notes)
        print_line()
        print_line(
            f"{out}: {ANSWERS[part.head]} from a probability of {chosen.threshold:.3g} on, was "
            f"{before.threshold:.3g}"
        )
    if tuned.other_head:
        print_message(tuned.other_head)
