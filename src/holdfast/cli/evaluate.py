"""`holdfast evaluate`: metrics of a model on labelled recordings."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.csv_options import CsvOptions
from holdfast.cli.options import (
    RARE,
    EngineOption,
    JobsOption,
    JsonOption,
    ModelArgument,
    PlotOptions,
    SeedOption,
    StartOptions,
    report_handling,
    start_engine,
)
from holdfast.cli.slip_scores import print_slips
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.metrics import EventMetrics, Intervals, Metrics, SampleMetrics
    from holdfast.recordings import Recording
    from holdfast.training.evaluation import Evaluation

PERCENT_FIELDS = ("accuracy", "fdr", "fpr", "fnr")
AUC_NOTE = (
    "AUC in contact: stable against unstable. AUC of all: also against no contact, "
    "where the force decides, not the probability."
)
"""Explanation of the two AUCs below their table."""


def evaluate(
    model: ModelArgument,
    data: Annotated[
        Path, typer.Argument(help="A labelled recording or CSV file, or a folder of them.")
    ],
    *,
    csv: Annotated[CsvOptions, RARE],
    seed: SeedOption = 0,
    engine: EngineOption = "loky",
    jobs: JobsOption = 1,
    figure: PlotOptions,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Evaluate a model on labelled recordings.

    Print metrics by sample (accuracy, FDR, FPR, FNR, AUC) and by event (missed events, detection
    delay, false alarms), for each finger and for the hand, and of the slips of each finger (found
    in time, false alarms), if the model has a slip rule; with bootstrap intervals over the
    recordings. Sentences before them say what the model is good for, from the recordings that it
    was not trained on. The others are named, because their metrics are optimistic. The figure
    shows errors, delays and slips. CSV files, with labels in a column, are read directly; a folder
    of them needs --sensor.

    Example:
      holdfast evaluate model.json recordings/
      holdfast evaluate builtin:twin recordings/ --json
      holdfast evaluate builtin:any press.csv --sensor sensor.json
      holdfast evaluate model.json recordings/ --engine dask:tcp://hub:8786
    """
    require_extras("train")
    import msgspec

    from holdfast.errors import TrainingError
    from holdfast.model import Model
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.training.verdict import no_verdict

    figure.check()
    loaded = Model.load(model)
    started = start_engine(engine, jobs)
    path = started.path(data)
    recordings: Sequence[Recording] = (
        list(map(start.of, csv.read(path))) if csv.fits(str(path)) else start.load_dataset(path)
    )
    report_handling(loaded, recordings)
    evaluation = evaluate_recordings(
        loaded, recordings, seed, started, progress=progress, keep=figure.plot is not None
    )
    metrics = evaluation.metrics
    if metrics.pooled.n + metrics.pooled.n_undecided == 0:
        raise TrainingError(
            f"{data}: none of its recordings ({len(recordings)}) has labels; labels expected"
        )
    warn_about_recordings(evaluation, len(recordings))
    figure.save(lambda: _draw(evaluation))
    if as_json:
        document = {"trained_on": evaluation.trained_on, "verdict": evaluation.verdict}
        print_json({**msgspec.to_builtins(metrics), **document})
        return
    print_verdict(evaluation.verdict or no_verdict(len(evaluation.trained_on), len(recordings)))
    print_metrics(metrics)
    print_slips(metrics.slips, has_rule=loaded.has_slip_rule)
    print_line()
    print_line(f"{model} on {len(recordings)} recordings")


def _draw(evaluation: "Evaluation") -> "Figure":
    from holdfast.plots.evaluation import draw_evaluation

    return draw_evaluation(evaluation.metrics, evaluation.decisions)


def warn_about_recordings(evaluation: "Evaluation", n_recordings: int) -> None:
    """Print the names of recordings on which the model was trained, and of copies."""
    if evaluation.copies:
        pairs = [f"{name} of {original}" for name, original in evaluation.copies]
        names = ", ".join(pairs[:5]) + (" ..." if len(pairs) > 5 else "")
        print_message(f"copies, with the same readings: {names}; the verdict counts them once")
    trained_on = evaluation.trained_on
    if trained_on:
        names = ", ".join(trained_on[:5]) + (" ..." if len(trained_on) > 5 else "")
        print_message(
            f"the model was trained on {len(trained_on)} of these {n_recordings} recordings "
            f"({names}): their metrics are optimistic"
        )


def print_verdict(sentence: str) -> None:
    """Print the sentence on what a model is good for."""
    print_paragraph(sentence)
    print_line()


def print_metrics(metrics: "Metrics") -> None:
    """Print two tables, by sample and by event, and the intervals of all fingers together."""
    rows = [_sample_row(name, finger) for name, finger in metrics.fingers.items()]
    print_line("by sample")
    print_table(
        ("", "n", "accuracy %", "FDR %", "FPR %", "FNR %", "AUC in contact", "AUC of all"),
        [*rows, _sample_row("all", metrics.pooled), _always_stable(metrics.pooled)],
    )
    print_paragraph(AUC_NOTE)
    print_line()
    print_line(f"by event (onset of instability in a held contact, {_onsets(metrics)})")
    events = [*metrics.events.fingers.items(), ("hand", metrics.events.hand)]
    print_table(
        ("", "events", "missed 0.05 s", "0.1 s", "0.2 s %", "delay s", "p95 s", "alarms/min"),
        [*(_event_row(name, finger) for name, finger in events), _never_an_alarm(metrics)],
    )  # fmt: skip
    if metrics.intervals is not None:
        _print_intervals(metrics.intervals)
    if metrics.score_bins is not None:
        print_line(f"AUC from {metrics.score_bins} bins of probability, because of many samples")


def _onsets(metrics: "Metrics") -> str:
    """Return where the onsets of the events come from."""
    origin = metrics.events.hand.onsets
    words = {"mixed": "by truth or labels", "rule": "by labels of a rule, without their margin"}
    return words.get(origin, f"by the {origin}")


def _sample_row(name: str, metrics: "SampleMetrics") -> tuple[str, ...]:
    percents = (format_number(getattr(metrics, field), 1) for field in PERCENT_FIELDS)
    aucs = (format_number(metrics.auc_contact, 3), format_number(metrics.auc, 3))
    return name, str(metrics.n), *percents, *aucs


def _always_stable(metrics: "SampleMetrics") -> tuple[str, ...]:
    """Return the row of a model that decides every one of these samples stable."""
    (tn, fp), (fn, tp) = metrics.confusion
    n_stable, n = fn + tp, max(metrics.n, 1)
    share, wrong = (format_number(100 * k / n, 1) for k in (n_stable, tn + fp))
    return "always STABLE", str(metrics.n), share, wrong, "100.0", "0.0", "0.500", "0.500"


def _never_an_alarm(metrics: "Metrics") -> tuple[str, ...]:
    """Return the row of the events of a model that always decides STABLE."""
    n = metrics.events.hand.n_events
    missed = ["100.0" if n else format_number(None, 1)] * len(metrics.events.hand.missed)
    return "always STABLE", str(n), *missed, "never", "never", "0.0"


def _event_row(name: str, metrics: "EventMetrics") -> tuple[str, ...]:
    missed = (format_number(share, 1) for share in metrics.missed.values())
    delays = (
        format_number(delay, 3) if delay is not None or not metrics.n_events else "never"
        for delay in (metrics.delay_median, metrics.delay_p95)
    )
    false_alarms = format_number(metrics.false_alarms_per_minute, 1)
    return name, str(metrics.n_events), *missed, *delays, false_alarms


def _print_intervals(intervals: "Intervals") -> None:
    parts = [
        f"{name} {format_number(low, digits)} to {format_number(high, digits)}"
        for name, field, digits in (
            ("accuracy", "accuracy", 1),
            ("FDR", "fdr", 1),
            ("FNR", "fnr", 1),
            ("AUC in contact", "auc_contact", 3),
        )
        if (interval := getattr(intervals, field)) is not None
        for low, high in [interval]
    ]
    groups = "" if intervals.n_groups is None else f" in {intervals.n_groups} groups"
    of = f"{intervals.n_recordings} recordings{groups}"
    print_line()
    print_paragraph(f"{100 * intervals.level:g} % intervals over {of}: " + ", ".join(parts))
