"""`holdfast train`: a model from labelled recordings, with cross-validated metrics."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import EngineOption, JobsOption, JsonOption, SeedOption, start_engine
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.model import Model
    from holdfast.training import Setting

LEFT_OUT = {
    "recording": "one recording at a time",
    "object": "one object at a time",
    "time": "one fifth of the time of every recording",
    "random": "random samples",
}


def train(
    data: Annotated[Path, typer.Argument(help="A folder of labelled recordings.")],
    model: Annotated[Path, typer.Option("--output", "-o", help="The model file to write (JSON).")],
    classifier: Annotated[
        str | None,
        typer.Option(
            help="logreg (logistic regression) or svm (linear SVM).", show_default="logreg"
        ),
    ] = None,
    window: Annotated[
        int | None,
        typer.Option(help="N_w: even number of samples in the Haar window.", show_default="14"),
    ] = None,
    features: Annotated[
        str | None,
        typer.Option(
            help="Names from F_a, F_x, F_y, F_z, m, sigma; holdfast for the extended set; or any "
            "for relative features, which fit any sensor, unit and rate.",
            show_default="F_a,F_x,F_y,F_z,sigma",
        ),
    ] = None,
    tare: Annotated[
        str | None,
        typer.Option(
            help="Tare: seconds from the start, first, none, or START:END [s].",
            show_default="0.5; first with --features any; or as --init",
        ),
    ] = None,
    split: Annotated[
        str,
        typer.Option(
            help="Unit to leave out in cross-validation: recording, object, time or random."
        ),
    ] = "recording",
    trials: Annotated[
        int,
        typer.Option(help="Trials of the parameter search; 0 uses the reference parameters."),
    ] = 30,
    objective: Annotated[
        str | None,
        typer.Option(
            help="Loss that the search minimises: error (share of wrong decisions) or log_loss.",
            show_default="log_loss; error for svm",
        ),
    ] = None,
    seed: SeedOption = 0,
    shared: Annotated[
        bool | None,
        typer.Option(
            "--shared/--separate",
            help="Train one classifier for all fingers, or one for each.",
            show_default="--shared with --features any",
        ),
    ] = None,
    contact_threshold: Annotated[
        float | None,
        typer.Option(
            help="F_a below this value is no contact, in the unit of the readings.",
            show_default="from the tare",
        ),
    ] = None,
    hold: Annotated[
        float | None,
        typer.Option(
            help="Time for which UNSTABLE is kept after the last unstable sample [s].",
            show_default="0.1, or as --init",
        ),
    ] = None,
    hysteresis: Annotated[
        float | None,
        typer.Option(
            help="Distance from the threshold that the probability must exceed to change the "
            "state.",
            show_default="0.1, 0 with --features any, or as --init",
        ),
    ] = None,
    init: Annotated[
        str | None,
        typer.Option(help="Model to adapt, with its features: a file, or builtin:any."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a search that was stopped.")
    ] = False,
    max_samples: Annotated[
        int,
        typer.Option(
            help="Maximum number of samples per finger; of more, every n-th sample is used."
        ),
    ] = 200_000,
    engine: EngineOption = "loky",
    jobs: JobsOption = 1,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the model.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Train a model from labelled recordings.

    Print cross-validated metrics: each recording (or object) is evaluated by a model that was
    trained without it. The random split repeats the protocol of the paper. Its metrics are
    optimistic, because neighbouring samples are nearly equal.

    Example:
      holdfast train recordings/ -o model.json
      holdfast train recordings/ -o model.json --split object --classifier svm
      holdfast train recordings/ -o model.json --features holdfast --hold 0.1
      holdfast train recordings/ -o model.json --init builtin:any
      holdfast train recordings/ -o model.json --engine dask:tcp://hub:8786
    """
    from holdfast.cli.evaluate import print_metrics, print_verdict
    from holdfast.files import refuse_overwrite
    from holdfast.io import load_dataset

    require_extras("train")
    from holdfast.labelling.review.findings import report_hidden_labels
    from holdfast.training import train as fit
    from holdfast.training.verdict import no_verdict

    setting = _setting(
        init,
        {"classifier": classifier, "window": window, "features": features},
        tare=tare,
        split=split,
        trials=trials,
        objective=objective,
        seed=seed,
        shared=shared,
        contact_threshold=contact_threshold,
        hold=hold,
        hysteresis=hysteresis,
        max_samples=max_samples,
    )
    refuse_overwrite(model, force=force)
    used = start_engine(engine, jobs)
    if resume and used.scheduler is not None:
        raise ValueError("--resume is for --engine loky; a search on a cluster keeps no trials")
    recordings = load_dataset(used.path(data))
    report_hidden_labels(recordings.paths, print_message)
    journal = _search_journal(model, resume=resume, force=force)
    try:
        trained = fit(
            recordings, setting, journal=journal, warn=print_message, progress=progress, engine=used
        )
    except KeyboardInterrupt:
        if journal.exists():
            print_message(f"the trials so far are in {journal}: continue with --resume")
        raise
    trained.model.save(model, force=force)
    journal.unlink(missing_ok=True)
    if as_json:
        print_json(
            {
                "model": model,
                "split": trained.split,
                "verdict": trained.verdict,
                "cross_validation": trained.cross_validation,
            }
        )
        return
    print_verdict(
        trained.verdict or no_verdict(len(trained.known), len(recordings), "the model of --init")
    )
    print_metrics(trained.cross_validation)
    print_line()
    print_line(
        f"{model}: trained on {len(recordings)} recordings; "
        f"cross-validation leaves out {LEFT_OUT[trained.split]}"
    )


def _setting(
    init: str | None,
    features: dict[str, Any],
    **options: Any,  # noqa: ANN401
) -> "Setting":
    """Return the training setting; options that are None were not given.

    Args:
        init: model to adapt, which has its own classifier, window and features.
        features: classifier, window and features.
        options: all other fields of `Setting`.
    """
    from holdfast.features import DEPLOYED_FEATURES, Tare, parse_features
    from holdfast.training import Setting
    from holdfast.training.setting import DEFAULT_HOLD, DEFAULT_HYSTERESIS

    given, chosen = (
        {name: value for name, value in group.items() if value is not None}
        for group in (features, options)
    )
    if "tare" in chosen:
        chosen["tare"] = Tare.parse(chosen["tare"])
    if init is not None:
        return Setting.adapting(_model_to_adapt(init, given), **chosen)
    names = given.get("features", ",".join(DEPLOYED_FEATURES))
    given["features"] = parse_features(names, given.get("window", Setting.window))
    relative = all(spec.seconds for spec in given["features"])
    steady = {"hold": DEFAULT_HOLD, "hysteresis": 0.0 if relative else DEFAULT_HYSTERESIS}
    return Setting(**given, **(steady | chosen))


def _model_to_adapt(init: str, given: dict[str, Any]) -> "Model":
    """Load the model of `--init`; its name is the text of the option."""
    from msgspec.structs import replace

    from holdfast.model import Model

    if given:
        raise ValueError(
            "--init uses the classifier, window and features of its model; leave out "
            + " and ".join(f"--{name}" for name in given)
        )
    return replace(Model.load(init), name=init)


def _search_journal(model: Path, *, resume: bool, force: bool) -> Path:
    """Return the file that keeps the trials of the search until the model is written."""
    from holdfast.errors import OutputError

    journal = model.with_name(f"{model.name}.search")
    if journal.exists() and force and not resume:
        journal.unlink()
    if journal.exists() and not resume:
        raise OutputError(
            f"{journal} holds a search that was stopped: continue it with --resume, or start "
            "again with --force"
        )
    if resume and not journal.exists():
        raise OutputError(f"nothing to resume: {journal} does not exist")
    return journal
