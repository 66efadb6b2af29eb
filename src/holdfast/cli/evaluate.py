"""`holdfast evaluate`: metrics of a model on labelled recordings."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.csv_options import CsvOptions
from holdfast.cli.options import (
    EngineOptions,
    JsonOption,
    ModelArgument,
    PlotOptions,
    SeedOption,
    StartOptions,
    report_handling,
)
from holdfast.cli.scores import print_metrics, print_slips, print_verdict, warn_about_recordings
from holdfast.cli.terminal.console import print_json, print_line
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.recordings import Recording


def evaluate(
    model: ModelArgument,
    data: Annotated[
        Path, typer.Argument(help="A labelled recording or CSV file, or a folder of them.")
    ],
    *,
    csv: CsvOptions,
    seed: SeedOption = 0,
    parallel: EngineOptions,
    figure: PlotOptions,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    """Evaluate a model on labelled recordings.

    Print metrics by sample (accuracy, FDR, FPR, FNR, AUC) and by event (missed events, detection
    delay, false alarms), for each finger and for the hand, and of the slips of each finger (found
    in time, false alarms), if the model has a slip rule; with bootstrap intervals over the
    recordings. Before them stands what the model is worth ("good", "usable", "weak" or "not
    enough data"), from the recordings that it was not trained on. The others are named, because
    their metrics are optimistic. The figure shows errors, delays and slips. CSV files, with labels
    in a column, are read directly; a folder of them needs --sensor.

    Example:
      holdfast evaluate model.json recordings/
      holdfast evaluate builtin:twin recordings/ --json
      holdfast evaluate builtin:any press.csv --sensor sensor.json
    """
    require_extras("train")
    import msgspec

    from holdfast.detection import Model
    from holdfast.errors import TrainingError
    from holdfast.training.evaluation import evaluate_recordings
    from holdfast.training.verdict import no_verdict

    def draw() -> "Figure":
        from holdfast.plots.evaluation import draw_evaluation

        return draw_evaluation(metrics, evaluation.decisions)

    figure.check()  # before the evaluation, which may take minutes
    loaded = Model.load(model)
    started = parallel.start()
    path = started.path(data)
    recordings: Sequence[Recording] = (
        list(map(start.of, csv.read(path))) if csv.fits(str(path)) else start.load_dataset(path)
    )
    report_handling(loaded, recordings)
    evaluation = evaluate_recordings(
        loaded, recordings, seed, started, progress=progress, keep=figure.plot is not None
    )
    metrics = evaluation.metrics
    # Labelled samples without a decision count too: the labels are there.
    if metrics.pooled.n + metrics.pooled.n_undecided == 0:
        raise TrainingError(
            f"{data}: none of its recordings ({len(recordings)}) has labels; labels expected"
        )
    warn_about_recordings(evaluation, len(recordings))
    figure.save(draw)
    if as_json:
        document = {"trained_on": evaluation.trained_on, "verdict": evaluation.verdict}
        print_json({**msgspec.to_builtins(metrics), **document})
        return
    print_verdict(evaluation.verdict or no_verdict(len(evaluation.trained_on), len(recordings)))
    print_metrics(metrics)
    print_slips(metrics.slips, has_rule=loaded.has_slip_rule)
    print_line()
    print_line(f"{model} on {len(recordings)} recordings")
