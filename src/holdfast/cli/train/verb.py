"""`holdfast train`: a model from labelled recordings, with cross-validated metrics."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from holdfast.cli.options import (
    EngineOptions,
    ForceOption,
    JsonOption,
    ModelOutput,
    StartOptions,
)
from holdfast.cli.scores import KEPT_RULE, print_metrics, print_slips, print_verdict
from holdfast.cli.teach.verb import teach
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.cli.train.options import TrainingOptions
from holdfast.errors import require_extras

LEFT_OUT_UNIT = {
    "recording": "one recording at a time",
    "object": "one object at a time",
    "time": "one fifth of the time of every recording",
    "random": "random samples",
}


def train(
    data: Annotated[Path, typer.Argument(help="A folder of labelled recordings.")],
    model: ModelOutput,
    options: TrainingOptions,
    *,
    init: Annotated[
        str | None,
        typer.Option(help="Model to adapt, with its features: a file, or builtin:any."),
    ] = None,
    only: Annotated[
        Literal["slip"] | None,
        typer.Option(
            "--for",
            help="Train the slip rule alone, as holdfast teach, and keep the rest of --init "
            "(builtin:any).",
            show_default=False,
        ),
    ] = None,
    parallel: EngineOptions,
    force: ForceOption = False,
    start: StartOptions,
    as_json: JsonOption = False,
) -> None:
    r"""Train a model from labelled recordings.

    Print cross-validated metrics: each recording (or object) is evaluated by a model that was
    trained without it. The random split repeats the protocol of the paper. Its metrics are
    optimistic, because neighbouring samples are nearly equal.

    By default the model has a tare of 0.5 s, a hold of 0.1 s and a hysteresis of 0.1; with
    --features any, the tare is the first sample and the hysteresis 0; with --init, they are
    those of the model to adapt.

    Example:
      holdfast train recordings/ -o model.json
      holdfast train recordings/ -o model.json --split object --classifier svm
      holdfast train recordings/ -o model.json --features holdfast \
        --own-slip-features
      holdfast train recordings/ -o model.json --init builtin:any
      holdfast train recordings/ -o model.json --for slip
    """
    if only is not None:
        if options != TrainingOptions():
            raise ValueError("--for slip has its own parameters and features: leave the others out")
        teach(
            out=model, data=data, model=init or "builtin:any", parallel=parallel, force=force,
            start=start, as_json=as_json,
        )  # fmt: skip
        return
    require_extras("train")
    from holdfast.files import refuse_overwrite
    from holdfast.labelling.review.findings import report_hidden_labels
    from holdfast.training import train as fit
    from holdfast.training.verdict import no_verdict

    setting = options.setting(init)
    refuse_overwrite(model, force=force)  # before a training, which may take hours
    started = parallel.start()
    recordings = start.load_dataset(started.path(data))
    report_hidden_labels(recordings.paths, print_message)
    trained = fit(recordings, setting, warn=print_message, progress=progress, engine=started)
    trained.model.save(model, force=force)
    split, n, scores = trained.split, len(recordings), trained.cross_validation
    if as_json:
        verdict = trained.verdict
        print_json({"model": model, "split": split, "verdict": verdict, "cross_validation": scores})
        return
    print_verdict(trained.verdict or no_verdict(len(trained.known), n, "the model of --init"))
    print_metrics(scores)
    print_slips(scores.slips, has_rule=trained.model.has_slip_rule, unscored=KEPT_RULE)
    print_line()
    print_line(
        f"{model}: trained on {n} recordings; cross-validation leaves out {LEFT_OUT_UNIT[split]}"
    )
