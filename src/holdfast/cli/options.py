"""What verbs that judge samples have in common: the model as it is wanted, and what to tell."""

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import say

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.live.stream_detector import StreamDetector
    from holdfast.model import Model
    from holdfast.sources import Source


class RateRule(StrEnum):
    """What becomes of a source at another rate than the model's."""

    RESAMPLE = "resample"
    STRICT = "strict"


ModelArgument = Annotated[
    str, typer.Argument(help="A model's file, builtin:twin or builtin:noise-floor.")
]
SourceArgument = Annotated[str, typer.Argument(help="A recording's path, or a URI: see above.")]
RateOption = Annotated[
    RateRule, typer.Option("--rate", help="Of a source not within 20 % of the model's rate.")
]
DebounceOption = Annotated[
    float | None, typer.Option("--debounce", help="Tell a state once it has lasted so long [s].")
]
HysteresisOption = Annotated[
    float | None,
    typer.Option("--hysteresis", help="How far past its threshold a probability must go."),
]
IgnoreOption = Annotated[
    str, typer.Option("--ignore", help="Taxels that count for nothing: index:7,index:12.")
]


def debounced(name: str, debounce: float | None, hysteresis: float | None) -> "Model":
    """The model of that name, held back as asked for where it is asked for."""
    from msgspec.structs import replace

    from holdfast.model import Debounce, Model

    model = Model.load(name)
    known = model.debounce
    held = Debounce(
        known.min_duration if debounce is None else debounce,
        known.hysteresis if hysteresis is None else hysteresis,
        known.hold,
    )
    return replace(model, name=model.name or name, debounce=held)


def stream_detector_of(
    model: "Model", source: "Source", rate: RateRule, ignore: str
) -> "StreamDetector":
    """Return the stream detector of an open source; report on stderr what the source lacks."""
    from holdfast.live.stream_detector import StreamDetector

    stream = StreamDetector(model, source, strict=rate is RateRule.STRICT, ignore=taxels_of(ignore))
    tell_missing(model, source.name, source.sensors)
    return stream


def tell_missing(model: "Model", name: str, modules: Mapping[str, object]) -> None:
    """Tells on stderr which fingers of the model a source or recording lacks."""
    missing = [finger for finger in model.fingers if finger not in ("*", *modules)]
    if missing:
        say(f"the model also judges {', '.join(missing)}; {name} has {', '.join(modules)}")


def taxels_of(text: str) -> dict[str, tuple[int, ...]]:
    """Taxels by finger, as `--ignore` gives them.

    Raises:
        ValueError: it is not of that form.

    Example:
        >>> taxels_of("index:7,index:12,thumb:0")
        {'index': (7, 12), 'thumb': (0,)}
    """
    found: dict[str, tuple[int, ...]] = {}
    for part in filter(None, text.split(",")):
        finger, _, number = part.strip().rpartition(":")
        if not (finger and number.isdecimal()):
            raise ValueError(f"--ignore: FINGER:TAXEL,... expected, {text!r} given")
        found[finger] = (*found.get(finger, ()), int(number))
    return found


SUFFIXES = (".pdf", ".png", ".svg")


def refuse_plot(plot: Path, force: bool) -> None:
    """Does nothing where a figure may be written there.

    Raises:
        ValueError: another suffix.
        OutputError: it exists and `force` is not given, or its folder does not exist.
    """
    from holdfast.files import refuse_overwrite

    if plot.suffix.lower() not in SUFFIXES:
        raise ValueError(f"a plot ends in {', '.join(SUFFIXES)}; {plot.name!r} given")
    refuse_overwrite(plot, force=force)


def save_plot(figure: "Figure", plot: Path, force: bool) -> None:
    """Writes the figure, and says so."""
    from holdfast.files import whole_file

    with whole_file(plot, force=force) as part:
        figure.savefig(part)
    say(f"{plot} written")


def check_speed(source: str, speed: float) -> None:
    """Refuses a speed that no source has, or that is not that of this one.

    Raises:
        ValueError: it is negative or not finite, or a device is given another than its own.
    """
    from holdfast.sources.uri import is_uri

    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"--speed: at least 0 expected, {speed:g} given")
    if speed != 1 and is_uri(source) and not source.startswith("twin:"):
        raise ValueError(f"--speed is for recordings and the twin; {source} has its own")
