"""`holdfast train`: a model from labelled recordings, with cross-validated metrics."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import (
    RARE,
    EngineOption,
    FittingTareOption,
    ForceOption,
    HysteresisOption,
    JobsOption,
    JsonOption,
    ModelOutput,
    SeedOption,
    StartOptions,
    start_engine,
)
from holdfast.cli.terminal.console import print_json, print_line, print_lines, print_message
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.io import Dataset
    from holdfast.model import Model
    from holdfast.parallel import Engine
    from holdfast.training import Setting, Trained

LEFT_OUT_UNIT = {
    "recording": "one recording at a time",
    "object": "one object at a time",
    "time": "one fifth of the time of every recording",
    "random": "random samples",
}


def _list_classifiers(name: str | None) -> str | None:
    if name == "list":
        from holdfast.classifiers import recipe_names

        print_lines(recipe_names())
        raise typer.Exit
    return name


@dataclass(frozen=True)
class TrainingOptions:
    """Group of options: all but three fields of `Setting`; None for what is not given."""

    classifier: Annotated[
        str | None,
        typer.Option(
            help="Name of the way of fitting, such as logreg (logistic regression) or svm (linear "
            "SVM); list prints all names.",
            show_default="logreg",
            callback=_list_classifiers,
            is_eager=True,
        ),
    ] = None
    window: Annotated[
        int | None,
        typer.Option(help="N_w: even number of samples in the Haar window.", show_default="14"),
        RARE,
    ] = None
    features: Annotated[
        str | None,
        typer.Option(
            help="Names from F_a, F_x, F_y, F_z, m, sigma; holdfast for the extended set; or any "
            "for relative features, which fit any sensor, unit and rate.",
            show_default="F_a,F_x,F_y,F_z,sigma",
        ),
    ] = None
    tare: Annotated[FittingTareOption, RARE] = None
    split: Annotated[
        str,
        typer.Option(
            help="Unit to leave out in cross-validation: recording, object, time or random."
        ),
    ] = "recording"
    trials: Annotated[
        int,
        typer.Option(help="Trials of the parameter search; 0 uses the reference parameters."),
    ] = 30
    objective: Annotated[
        str | None,
        typer.Option(
            help="Loss that the search minimises: error (share of wrong decisions) or log_loss.",
            show_default="log_loss; error for svm",
        ),
        RARE,
    ] = None
    seed: SeedOption = 0
    shared: Annotated[
        bool | None,
        typer.Option(
            "--shared/--separate",
            help="Train one classifier for all fingers, or one for each.",
            show_default="--shared with --features any",
        ),
        RARE,
    ] = None
    contact_threshold: Annotated[
        float | None,
        typer.Option(
            help="F_a below this value is no contact, in the unit of the readings.",
            show_default="from the tare",
        ),
        RARE,
    ] = None
    hold: Annotated[
        float | None,
        typer.Option(help="Time for which UNSTABLE is kept after the last unstable sample [s]."),
        RARE,
    ] = None
    hysteresis: HysteresisOption = None
    own_slip_features: Annotated[
        bool,
        typer.Option(
            "--own-slip-features",
            help="Give the slip rule features of its own, which see single taxels move, and their "
            "squares; it also estimates how fast a finger slides, where the recordings have the "
            "true speed.",
        ),
    ] = False
    max_samples: Annotated[
        int,
        typer.Option(
            help="Maximum number of samples per finger; of more, every n-th sample is used."
        ),
        RARE,
    ] = 200_000

    def setting(self, init: str | None) -> "Setting":
        """Return the setting of a training.

        Args:
            init: model to adapt, which has its own classifier, window and features.

        Raises:
            ValueError: an option is not valid, or contradicts `init`.
            ModelError: the model to adapt cannot be read, or does not fit the options.
        """
        from holdfast.features import DEPLOYED_FEATURES, Tare, parse_features
        from holdfast.training import Setting
        from holdfast.training.setting import DEFAULT_HOLD, DEFAULT_HYSTERESIS

        chosen = {name: value for name, value in asdict(self).items() if value is not None}
        if "tare" in chosen:
            chosen["tare"] = Tare.parse(chosen["tare"])
        if init is not None:
            return Setting.adapting(_model_to_adapt(init, chosen), **chosen)
        names = chosen.get("features", ",".join(DEPLOYED_FEATURES))
        chosen["features"] = parse_features(names, chosen.get("window", Setting.window))
        relative = all(spec.seconds for spec in chosen["features"])
        steady = {"hold": DEFAULT_HOLD, "hysteresis": 0.0 if relative else DEFAULT_HYSTERESIS}
        return Setting(**(steady | chosen))


def train(
    data: Annotated[Path, typer.Argument(help="A folder of labelled recordings.")],
    model: ModelOutput,
    options: TrainingOptions,
    *,
    init: Annotated[
        str | None,
        typer.Option(help="Model to adapt, with its features: a file, or builtin:any."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue a search that was stopped."), RARE
    ] = False,
    engine: EngineOption = "loky",
    jobs: JobsOption = 1,
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
      holdfast train recordings/ -o model.json --features holdfast --hold 0.1
      holdfast train recordings/ -o model.json --features holdfast \
        --own-slip-features
      holdfast train recordings/ -o model.json --init builtin:any
      holdfast train recordings/ -o model.json --engine dask:tcp://hub:8786
    """
    require_extras("train")
    from holdfast.files import refuse_overwrite
    from holdfast.labelling.review.findings import report_hidden_labels

    setting = options.setting(init)
    refuse_overwrite(model, force=force)
    started = start_engine(engine, jobs)
    if resume and started.scheduler is not None:
        raise ValueError("--resume is for --engine loky; a search on a cluster keeps no trials")
    recordings = start.load_dataset(started.path(data))
    report_hidden_labels(recordings.paths, print_message)
    journal = _search_journal(model, resume=resume, force=force)
    trained = _fit(recordings, setting, journal, started)
    trained.model.save(model, force=force)
    journal.unlink(missing_ok=True)
    _print(trained, model, len(recordings), as_json=as_json)


def _fit(recordings: "Dataset", setting: "Setting", journal: Path, engine: "Engine") -> "Trained":
    """Train a model; after Ctrl-C, print how to continue."""
    from holdfast.training import train as fit

    try:
        return fit(
            recordings,
            setting,
            journal=journal,
            warn=print_message,
            progress=progress,
            engine=engine,
        )
    except KeyboardInterrupt:
        if journal.exists():
            print_message(f"the trials so far are in {journal}: continue with --resume")
        raise


def _print(trained: "Trained", model: Path, n_recordings: int, *, as_json: bool) -> None:
    from holdfast.cli.evaluate import print_metrics, print_verdict
    from holdfast.cli.slip_scores import KEPT_RULE, print_slips
    from holdfast.training.verdict import no_verdict

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
        trained.verdict or no_verdict(len(trained.known), n_recordings, "the model of --init")
    )
    print_metrics(trained.cross_validation)
    print_slips(
        trained.cross_validation.slips,
        has_rule=trained.model.has_slip_rule,
        unscored=KEPT_RULE,
    )
    print_line()
    print_line(
        f"{model}: trained on {n_recordings} recordings; "
        f"cross-validation leaves out {LEFT_OUT_UNIT[trained.split]}"
    )


def _model_to_adapt(init: str, chosen: dict[str, Any]) -> "Model":
    """Load the model of `--init`; its name is the text of the option."""
    from msgspec.structs import replace

    from holdfast.model import Model

    refused = [name for name in ("classifier", "window", "features") if name in chosen]
    if refused:
        raise ValueError(
            "--init uses the classifier, window and features of its model; leave out "
            + " and ".join(f"--{name}" for name in refused)
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
