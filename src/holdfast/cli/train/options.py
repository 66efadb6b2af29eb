"""Options of `holdfast train` that become the `Setting` of a training."""

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE, FittingTareOption, HysteresisOption, SeedOption
from holdfast.cli.terminal.console import print_lines

if TYPE_CHECKING:
    from holdfast.training import Setting


def list_classifiers(name: str | None) -> str | None:
    """Return a name; print all names and exit if it is `list`."""
    if name == "list":
        from holdfast.training.classifiers import RECIPES

        print_lines(RECIPES)
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
            callback=list_classifiers,
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
        int | None,
        typer.Option(help="0 uses the reference parameters, not the best of a grid."),
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
        from msgspec.structs import replace

        from holdfast.detection import DEPLOYED_FEATURES, Model, Tare, parse_features
        from holdfast.training import Setting
        from holdfast.training.setting import DEFAULT_HOLD, DEFAULT_HYSTERESIS

        chosen = {name: value for name, value in asdict(self).items() if value is not None}
        if "tare" in chosen:
            chosen["tare"] = Tare.parse(chosen["tare"])
        if init is not None:
            refused = [name for name in ("classifier", "window", "features") if name in chosen]
            if refused:
                raise ValueError(
                    "--init uses the classifier, window and features of its model; leave out "
                    + " and ".join(f"--{name}" for name in refused)
                )
            return Setting.adapting(replace(Model.load(init), name=init), **chosen)
        names = chosen.get("features", ",".join(DEPLOYED_FEATURES))
        chosen["features"] = parse_features(names, chosen.get("window", Setting.window))
        # Windows in seconds: the features of `any`, whose model decides without hysteresis.
        relative = all(spec.seconds for spec in chosen["features"])
        steady = {"hold": DEFAULT_HOLD, "hysteresis": 0.0 if relative else DEFAULT_HYSTERESIS}
        return Setting(**(steady | chosen))
