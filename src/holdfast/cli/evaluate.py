"""`holdfast evaluate`: how good a model is on recordings with labels."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.console import print_json, progress, say, show

if TYPE_CHECKING:
    from collections.abc import Iterator

    from holdfast.metrics import Decisions
    from holdfast.model import Model
    from holdfast.recordings import Recording


def evaluate(
    model: Annotated[
        str, typer.Argument(help="A model file, builtin:twin or builtin:noise-floor.")
    ],
    data: Annotated[Path, typer.Argument(help="A labelled recording, or a folder of them.")],
    seed: Annotated[int, typer.Option(help="Of the bootstrap.")] = 0,
    plot: Annotated[
        Path | None, typer.Option(help="Draw errors and delays to this .svg, .png or .pdf file.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the plot.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Measures a model on labelled recordings.

    By sample (accuracy, FDR, FPR, FNR, AUC) and by event (missed, delay, false alarms), per
    finger and for the hand, with intervals by bootstrap over recordings. Recordings that the
    model was trained on are named: figures on them flatter.

    Example:
      holdfast evaluate model.json recordings/
      holdfast evaluate builtin:twin recordings/ --json
    """
    import msgspec

    from holdfast.cli.figures import refuse_plot, save_plot
    from holdfast.cli.report import show_metrics
    from holdfast.errors import TrainingError
    from holdfast.io import load_dataset
    from holdfast.metrics import summarise
    from holdfast.model import Model
    from holdfast.training import decisions_of

    if plot is not None:
        refuse_plot(plot, force)
    judge = Model.load(model)
    seen: list[str] = []
    judged = []
    recordings = load_dataset(data)

    def decide() -> "Iterator[Decisions]":
        for recording in progress(recordings, "judging"):
            seen.extend(_seen(judge, recording))
            decisions = decisions_of(judge, recording)
            if plot is not None:
                judged.append(decisions)
            yield decisions

    metrics = summarise(decide(), seed=seed)
    if metrics.pooled.n + metrics.pooled.n_undecided == 0:
        raise TrainingError(f"{data}: {len(recordings)} recordings without a label to judge by")
    _tell_seen(seen, len(recordings))
    if plot is not None:
        from holdfast.plots.evaluation import draw_evaluation

        save_plot(draw_evaluation(metrics, judged), plot, force)
    if as_json:
        print_json({**msgspec.to_builtins(metrics), "trained_on": seen})
        return
    show_metrics(metrics)
    show(f"\n{model} on {len(recordings)} recordings")


def _tell_seen(seen: list[str], n_recordings: int) -> None:
    if seen:
        some = ", ".join(seen[:5]) + (" ..." if len(seen) > 5 else "")
        say(
            f"the model has seen {len(seen)} of these {n_recordings} recordings in training "
            f"({some}): figures on them flatter"
        )


def _seen(model: "Model", recording: "Recording") -> list[str]:
    known = model.training.recordings.values() if model.training else ()
    return [recording.name] if recording.digest in known else []
