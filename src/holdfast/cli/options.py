"""Options that several verbs share, with the checks and conversions of their values."""

import math
import os
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import print_message
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.devices.sources import Source
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.model import Model
    from holdfast.parallel import Engine
    from holdfast.sensors import Sensor

TOKEN_VARIABLE = "HOLDFAST_TOKEN"
"""Environment variable with the token of the pages."""
MAX_TOKEN_LENGTH = 1024
"""Longest token that is read from a file [characters]."""
PLOT_SUFFIXES = (".pdf", ".png", ".svg")


class RatePolicy(StrEnum):
    """What to do with a source whose rate is not within 20 % of the model's."""

    RESAMPLE = "resample"
    STRICT = "strict"


ModelArgument = Annotated[
    str, typer.Argument(help="A model file, builtin:any, builtin:twin or builtin:noise-floor.")
]


def complete_source(context: typer.Context, source: str) -> str:
    """Return a source with the parameters of the configuration file that it does not have.

    Raises:
        ValueError: the source is `hand`, and there is no configuration file.
    """
    if context.obj is not None:
        completed: str = context.obj.complete(source)
        return completed
    if source == "hand" and not Path(source).exists():
        raise ValueError(
            "hand is the source of a configuration file; there is no holdfast.toml in this "
            "folder (or name one with holdfast --config FILE)"
        )
    return source


SourceArgument = Annotated[
    str,
    typer.Argument(
        help="Path of a recording, URI of a source (see above), or hand (of holdfast.toml).",
        callback=complete_source,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of all random numbers.")]
JobsOption = Annotated[
    int, typer.Option("--jobs", help="Number of parallel processes; -1: one per processor.")
]
EngineOption = Annotated[
    str,
    typer.Option("--engine", help="loky: processes of this machine; dask:ADDRESS: a Dask cluster."),
]
TareOption = Annotated[
    str,
    typer.Option("--tare", help="Tare: seconds from the start, first, none, or START:END [s]."),
]

RateOption = Annotated[
    RatePolicy,
    typer.Option(
        "--rate",
        help="If the rate is not within 20 % of the model's: resample the source, or refuse it.",
    ),
]
DebounceOption = Annotated[
    float | None,
    typer.Option(
        "--debounce",
        help="Minimum time a new state must last before it is reported [s].",
        show_default="as in the model",
    ),
]
HysteresisOption = Annotated[
    float | None,
    typer.Option(
        "--hysteresis",
        help="Distance from the threshold that the probability must exceed to change the state.",
        show_default="as in the model",
    ),
]
RawOption = Annotated[
    bool,
    typer.Option(
        "--raw", help="Decide every sample by itself: no hold, minimum duration or hysteresis."
    ),
]
IgnoreOption = Annotated[
    str,
    typer.Option("--ignore", help="Taxels to ignore, counted from 1: index:7,index:12."),
]
SpeedOption = Annotated[
    float,
    typer.Option(
        "--speed", help="Speed of a recording or the twin: 1 is real time, 0 as fast as possible."
    ),
]

HostOption = Annotated[str, typer.Option("--host", help="Address to listen on.")]
PortOption = Annotated[
    int, typer.Option("--port", help="Port to listen on; 0 selects a free port.")
]
TokenOption = Annotated[
    str | None,
    typer.Option(
        "--token",
        help="Secret that clients must send; required for other hosts. Other users of this "
        "machine can read it in the list of processes: prefer --token-file.",
    ),
]
TokenFileOption = Annotated[
    Path | None,
    typer.Option(
        "--token-file",
        help="File with the secret in its first line; or set HOLDFAST_TOKEN instead.",
    ),
]
PlotOption = Annotated[
    Path | None, typer.Option("--plot", help="Write a figure to this .svg, .png or .pdf file.")
]
ForcePlotOption = Annotated[
    bool, typer.Option("--force", help="Overwrite the figure if it exists.")
]


def start_engine(engine: str, jobs: int) -> "Engine":
    """Return the engine of `--engine` and `--jobs`, after a connection to it.

    Raises:
        ValueError: there is no such engine, or no jobs.
        EngineError: no cluster answers at the address, or a worker has another version.
        MissingExtra: dask is not installed.
    """
    from holdfast.parallel import Engine

    if jobs == 0:
        raise ValueError("jobs other than 0 expected, 0 given")
    chosen = Engine.parse(engine, jobs)
    chosen.check()
    return chosen


def check_shared(path: Path, engine: "Engine") -> None:
    """Check that a file that an engine has written is there.

    Raises:
        OutputError: a worker of a cluster wrote it to a disk of its own.
    """
    from holdfast.errors import OutputError

    if engine.scheduler is not None and not path.exists():
        raise OutputError(
            f"a worker wrote {path.absolute()}, but it is not on this machine: choose a folder "
            "that all machines have at the same path"
        )


def find_token(token: str | None, file: Path | None) -> str | None:
    """Return the token of `--token`, `--token-file` or the environment; None without one.

    Raises:
        ValueError: both options are given, or the file cannot be read as text.
    """
    if token is not None and file is not None:
        raise ValueError("--token and --token-file given; only one of them expected")
    if file is None:
        return os.environ.get(TOKEN_VARIABLE) if token is None else token
    try:
        if not file.is_file():
            raise ValueError(f"--token-file {file}: a file expected, there is none")
        with file.open(encoding="utf-8") as opened:
            return opened.readline(MAX_TOKEN_LENGTH + 1).strip()
    except OSError as cause:
        raise ValueError(f"--token-file {file}: cannot be read: {cause.strerror}") from cause
    except UnicodeDecodeError as cause:
        raise ValueError(f"--token-file {file}: text expected, other bytes given") from cause


def load_model(
    name: str, debounce: float | None, hysteresis: float | None, *, raw: bool = False
) -> "Model":
    """Load a model and apply `--debounce` and `--hysteresis`, if given.

    Args:
        name: path of the model, or the name of a built-in one.
        debounce: minimum time that a new state must last [s]; None for that of the model.
        hysteresis: of the probability; None for that of the model.
        raw: leave the debouncing out.

    Raises:
        ValueError: a source is given instead of a model; or `raw` and another value.
        ModelError: the model cannot be read.
    """
    from msgspec.structs import replace

    from holdfast.devices.uri import is_uri
    from holdfast.model import Debounce, Model

    is_source = is_uri(name) and not name.startswith("builtin:")
    if is_source or name.endswith((".parquet", ".mcap")):
        raise ValueError(f"{name} is a source; MODEL SOURCE expected, such as builtin:any {name}")

    if raw and (debounce, hysteresis) != (None, None):
        raise ValueError("--raw decides without debouncing; leave out --debounce and --hysteresis")
    model = Model.load(name)
    own = Debounce() if raw else model.debounce
    chosen = Debounce(
        own.min_duration if debounce is None else debounce,
        own.hysteresis if hysteresis is None else hysteresis,
        own.hold,
    )
    return replace(model, name=model.name or name, debounce=chosen)


def create_stream_detector(
    model: "Model", source: "Source", rate: RatePolicy, ignore: str
) -> "StreamDetector":
    """Create the detector of an open source, and report fingers that the source lacks."""
    from holdfast.live.stream_detector import StreamDetector

    taxels = parse_taxels(ignore, source.sensors)
    stream = StreamDetector(model, source, strict=rate is RatePolicy.STRICT, ignore=taxels)
    report_missing_fingers(model, source.name, source.sensors)
    return stream


def report_missing_fingers(model: "Model", name: str, modules: Mapping[str, object]) -> None:
    """Print the fingers of the model that a source or recording lacks."""
    missing = [finger for finger in model.fingers if finger not in ("*", *modules)]
    if missing:
        print_message(
            f"{name} has {', '.join(modules)}; the model also has {', '.join(missing)}, "
            "which get no estimates"
        )


def parse_taxels(text: str, sensors: Mapping[str, "Sensor"]) -> dict[str, tuple[int, ...]]:
    """Return the indices of the taxels of each finger from the text of `--ignore`.

    Args:
        text: FINGER:TAXEL,... with the numbers of the taxels, from 1.
        sensors: of the modules. The taxels of other fingers are not checked.

    Raises:
        ValueError: the text is not FINGER:TAXEL,..., or a sensor has no such taxel.

    Example:
        >>> from holdfast.sensors import sensor
        >>> parse_taxels("index:7,index:12,thumb:1", {"index": sensor("uskin-4x4")})
        {'index': (6, 11), 'thumb': (0,)}
    """
    from holdfast.sensors import taxel_index

    taxels: dict[str, tuple[int, ...]] = {}
    for part in filter(None, text.split(",")):
        finger, _, number = part.strip().rpartition(":")
        if not (finger and number.isdecimal()):
            raise ValueError(f"--ignore: FINGER:TAXEL,... expected, {text!r} given")
        if finger in sensors:
            _check_taxel(finger, int(number), sensors[finger].n_taxels)
        taxels[finger] = (*taxels.get(finger, ()), taxel_index(int(number)))
    return taxels


def _check_taxel(finger: str, number: int, n_taxels: int) -> None:
    from holdfast.sensors import taxel_number

    first, last = taxel_number(0), taxel_number(n_taxels - 1)
    if not first <= number <= last:
        raise ValueError(
            f"{finger}: taxel {number} to be ignored; it has the taxels {first} to {last}"
        )


def check_speed(source: str, speed: float) -> None:
    """Check that the source can be played at this speed.

    Raises:
        ValueError: the speed is negative or not finite, or the source is a device and the
            speed is not 1.
    """
    from holdfast.devices.uri import is_uri

    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"--speed: at least 0 expected, {speed:g} given")
    if speed != 1 and is_uri(source) and not source.startswith("twin:"):
        raise ValueError(f"--speed is for recordings and the twin; {source} is a device")


def check_plot(plot: Path, force: bool) -> None:
    """Check that a figure can be written to this path.

    Raises:
        ValueError: the suffix is not one of `PLOT_SUFFIXES`.
        OutputError: the file exists and `force` is not given, or its folder does not exist.
        MissingExtra: matplotlib is not installed.
    """
    from holdfast.files import refuse_overwrite

    if plot.suffix.lower() not in PLOT_SUFFIXES:
        raise ValueError(f"a plot ends in {', '.join(PLOT_SUFFIXES)}; {plot.name!r} given")
    require_extras("plot")
    refuse_overwrite(plot, force=force)


def save_plot(figure: "Figure", plot: Path, force: bool) -> None:
    """Write a figure, and print its path on stderr."""
    from holdfast.files import whole_file

    with whole_file(plot, force=force) as part:
        figure.savefig(part)
    print_message(f"{plot} written")
