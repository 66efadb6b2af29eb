"""`holdfast evaluate`: how good a model is on recordings with labels."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import print_json, print_table, say, show
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from collections.abc import Iterator

    from holdfast.metrics import Decisions, EventMetrics, Intervals, Metrics, SampleMetrics
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

    from holdfast.cli.options import refuse_plot, save_plot
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


PERCENT = ("accuracy", "fdr", "fpr", "fnr")


def show_metrics(metrics: "Metrics") -> None:
    """Prints the figures by sample and by event, with the intervals of the whole."""
    rows = [_sample_row(name, finger) for name, finger in metrics.fingers.items()]
    show("by sample")
    print_table(
        ("", "n", "accuracy %", "FDR %", "FPR %", "FNR %", "AUC", "AUC in contact"),
        [*rows, _sample_row("all", metrics.pooled)],
    )
    show("\nby event (onset of instability in a held contact)")
    events = [*metrics.events.fingers.items(), ("hand", metrics.events.hand)]
    print_table(
        ("", "events", "missed in 0.05 s %", "0.1 s %", "0.2 s %", "median delay s", "p95 s",
         "false alarms/min"),
        [_event_row(name, each) for name, each in events],
    )  # fmt: skip
    if metrics.intervals is not None:
        _show_intervals(metrics.intervals)


def _sample_row(name: str, each: "SampleMetrics") -> tuple[str, ...]:
    shares = (_number(getattr(each, field), 1) for field in PERCENT)
    return name, str(each.n), *shares, _number(each.auc, 3), _number(each.auc_contact, 3)


def _event_row(name: str, each: "EventMetrics") -> tuple[str, ...]:
    missed = (_number(share, 1) for share in each.missed.values())
    delays = (
        _number(delay, 3) if delay is not None or not each.n_events else "never"
        for delay in (each.delay_median, each.delay_p95)
    )
    return name, str(each.n_events), *missed, *delays, _number(each.false_alarms_per_minute, 1)


def _show_intervals(intervals: "Intervals") -> None:
    parts = [
        f"{name} {_number(low, digits)} to {_number(high, digits)}"
        for name, digits in (("accuracy", 1), ("fdr", 1), ("fnr", 1), ("auc", 3))
        if (interval := getattr(intervals, name)) is not None
        for low, high in [interval]
    ]
    show(
        f"\n{100 * intervals.level:g} % intervals over {intervals.n_recordings} recordings: "
        + ", ".join(parts)
    )


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
