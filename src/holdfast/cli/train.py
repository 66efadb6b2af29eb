"""`holdfast train`: a model out of labelled recordings, with figures out of fold."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.terminal.console import print_json, say, show
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.model import Model
    from holdfast.training import Setting


def train(
    data: Annotated[Path, typer.Argument(help="A folder of labelled recordings.")],
    model: Annotated[Path, typer.Option("--output", "-o", help="Where the model goes (JSON).")],
    classifier: Annotated[
        str | None, typer.Option(help="logreg or svm.", show_default="logreg")
    ] = None,
    window: Annotated[
        int | None,
        typer.Option(help="N_w, samples in the Haar window; even.", show_default="14"),
    ] = None,
    features: Annotated[
        str | None,
        typer.Option(
            help="Out of F_a, F_x, F_y, F_z, m, sigma; or holdfast: our own.",
            show_default="F_a,F_x,F_y,F_z,sigma",
        ),
    ] = None,
    tare: Annotated[
        str | None,
        typer.Option(
            help="Seconds from the start, first, none, or START:END.",
            show_default="0.5, or as --init",
        ),
    ] = None,
    split: Annotated[
        str, typer.Option(help="What is held out: recording, object, or random samples.")
    ] = "recording",
    trials: Annotated[
        int, typer.Option(help="Of the search for parameters; 0: the reference setting.")
    ] = 30,
    seed: Annotated[int, typer.Option(help="Of everything random.")] = 0,
    shared: Annotated[
        bool, typer.Option("--shared", help="One classifier for all fingers.")
    ] = False,
    contact_threshold: Annotated[
        float | None, typer.Option(help="F_a below it is no contact; by default from the tare.")
    ] = None,
    hold: Annotated[
        float | None,
        typer.Option(
            help="UNSTABLE is told so long after the last sign of it [s].",
            show_default="0, or as --init",
        ),
    ] = None,
    init: Annotated[
        str | None,
        typer.Option(help="A model to adapt, with its features: a file, or builtin:twin."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a search that was stopped.")
    ] = False,
    max_samples: Annotated[
        int, typer.Option(help="A finger that are kept in memory; of more, every n-th.")
    ] = 200_000,
    jobs: Annotated[int, typer.Option(help="Searches or fits at a time; -1: one a processor.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the model.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Trains a model from labelled recordings.

    Prints figures of predictions out of fold: each recording (or object) is judged by a model
    that has not seen it. The random split repeats the paper's protocol; neighbouring samples
    are nearly copies, so it flatters.

    Example:
      holdfast train recordings/ -o model.json
      holdfast train recordings/ -o model.json --split object --classifier svm
      holdfast train recordings/ -o model.json --features holdfast --hold 0.1
      holdfast train recordings/ -o model.json --init builtin:twin
    """
    from holdfast.files import refuse_overwrite
    from holdfast.io import load_dataset
    from holdfast.training import train as fit

    setting = _setting(
        init,
        {"classifier": classifier, "window": window, "features": features},
        tare=tare,
        split=split,
        trials=trials,
        seed=seed,
        shared=shared,
        contact_threshold=contact_threshold,
        hold=hold,
        max_samples=max_samples,
    )
    refuse_overwrite(model, force=force)
    recordings = load_dataset(data)
    journal = _journal(model, resume=resume, force=force)
    try:
        trained = fit(recordings, setting, journal=journal, tell=say, follow=progress, n_jobs=jobs)
    except KeyboardInterrupt:
        if journal.exists():
            say(f"what the search found so far is in {journal}: go on with --resume")
        raise
    trained.model.save(model, force=force)
    journal.unlink(missing_ok=True)
    if as_json:
        print_json({"model": model, "split": split, "cross_validation": trained.cross_validation})
        return
    from holdfast.cli.evaluate import show_metrics

    show_metrics(trained.cross_validation)
    show(
        f"\n{model}: trained on {len(recordings)} recordings, judged by leaving out "
        f"{'random samples' if split == 'random' else f'one {split} at a time'}"
    )


def _setting(init: str | None, rule: dict[str, Any], **options: Any) -> "Setting":  # noqa: ANN401
    """How to train; options that are None were not given.

    Args:
        init: a model to adapt, which brings a rule of its own.
        rule: classifier, window and features.
        options: all else that `Setting` takes.
    """
    from holdfast.features import DEPLOYED_FEATURES, Tare, parse_features
    from holdfast.training import Setting

    rule, chosen = (
        {name: value for name, value in given.items() if value is not None}
        for given in (rule, options)
    )
    if "tare" in chosen:
        chosen["tare"] = Tare.parse(chosen["tare"])
    if init is not None:
        return Setting.adapting(_model(init, rule), **chosen)
    names = rule.get("features", ",".join(DEPLOYED_FEATURES))
    rule["features"] = parse_features(names, rule.get("window", Setting.window))
    return Setting(**rule, **chosen)


def _model(init: str, rule: dict[str, Any]) -> "Model":
    """The model to adapt, called as the user calls it."""
    from msgspec.structs import replace

    from holdfast.model import Model

    if rule:
        raise ValueError(
            "--init brings the classifier, window and features of its model; leave out "
            + " and ".join(f"--{name}" for name in rule)
        )
    return replace(Model.load(init), name=init)


def _journal(model: Path, *, resume: bool, force: bool) -> Path:
    """Where the search is kept until the model is written."""
    from holdfast.errors import OutputError

    journal = model.with_name(f"{model.name}.search")
    if journal.exists() and force and not resume:
        journal.unlink()
    if journal.exists() and not resume:
        raise OutputError(
            f"{journal} holds a search that was stopped: go on with --resume, or start anew "
            "with --force"
        )
    if resume and not journal.exists():
        raise OutputError(f"nothing to resume: there is no {journal}")
    return journal
