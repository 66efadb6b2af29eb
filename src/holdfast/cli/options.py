"""Options that several verbs share, with the checks and conversions of their values.

An option is declared once. A group of options is a dataclass whose fields are options; a verb
that takes one has all its options (see `spread_groups` of `app.py`).
"""

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.terminal.console import print_message
from holdfast.errors import HoldfastError, require_extras
from holdfast.removed import removal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from holdfast.detection import Model
    from holdfast.devices.sources import Source
    from holdfast.io import Dataset
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.parallel import Engine
    from holdfast.recordings import Recording
    from holdfast.sensors import Sensor

TOKEN_VARIABLE = "HOLDFAST_TOKEN"
"""Environment variable with the token of the pages."""
MAX_TOKEN_LENGTH = 1024
"""Longest token that is read from a file [characters]."""
LOCALHOST = "127.0.0.1"
RARE = "rare"
"""Mark of an option, or of a group of options, that few users need: `Annotated[JobsOption, RARE]`.
The help of a verb shows it with `--help-all` only."""
PLOT_SUFFIXES = (".pdf", ".png", ".svg")


class RatePolicy(StrEnum):
    """Whether a source is resampled or refused if its rate is not within 20 % of the model's."""

    RESAMPLE = "resample"
    STRICT = "strict"


ModelArgument = Annotated[
    str, typer.Argument(help="A model file, builtin:any, builtin:twin or builtin:noise-floor.")
]


def check_source(source: str | None) -> str | None:
    """Return a source, if it is none that was removed, such as `hand`.

    Raises:
        HoldfastError: it was removed, and no file has this name.
    """
    text = removal("sources", source or "", f"the source {source}")
    if text and not Path(source or "").exists():
        raise HoldfastError(text)
    return source


SourceArgument = Annotated[
    str,
    typer.Argument(
        help="Path of a recording, or URI of a source (see above).", callback=check_source
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]
ForceOption = Annotated[bool, typer.Option("--force", help="Overwrite what exists already.")]
FpsOption = Annotated[
    float | None,
    typer.Option("--fps", help="Pictures per second of a video.", show_default="60, or its stamps"),
    RARE,
]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of all random numbers."), RARE]
DEFAULT_JOBS = 1
"""Value of `--jobs` of every verb, as in scikit-learn: other processes take seconds to start, and
each has the memory of its own recordings. Results do not depend on it."""
JobsOption = Annotated[
    int, typer.Option("--jobs", help="Number of parallel processes; -1: one per processor.")
]
_TARE = typer.Option("--tare", help="Tare: seconds from the start, first, none, or START:END [s].")
TareOption = Annotated[str, _TARE]
FittingTareOption = Annotated[str | None, _TARE]
"""Without a value, the tare is chosen to fit the recordings."""
HysteresisOption = Annotated[
    float | None,
    typer.Option(
        "--hysteresis",
        help="Distance from the threshold that the probability must exceed to change the state; "
        "by default that of the model.",
    ),
    RARE,
]
IgnoreOption = Annotated[
    str,
    typer.Option("--ignore", help="Taxels to ignore, counted from 1: index:7,index:12."),
    RARE,
]
InContactOption = Annotated[
    bool,
    typer.Option(
        "--in-contact",
        help="The object is held at the first sample: it is load, not an open hand.",
    ),
]
SpeedOption = Annotated[
    float,
    typer.Option(
        "--speed", help="Speed of a recording or the twin: 1 is real time, 0 as fast as possible."
    ),
]
SecondsOption = Annotated[float | None, typer.Option("--seconds", help="Stop after this time [s].")]
OnceOption = Annotated[
    bool, typer.Option("--once", help="Play a recording once, and stop at its end.")
]
HostOption = Annotated[str, typer.Option("--host", help="Address to listen on.")]
PortOption = Annotated[
    int, typer.Option("--port", help="Port to listen on; 0 selects a free port.")
]
BrowserOption = Annotated[
    bool | None,
    typer.Option(
        "--browser/--no-browser",
        help="Open the page in a browser.",
        show_default="if a browser can be opened",
    ),
]
CameraOption = Annotated[
    str | None,
    typer.Option(
        "--camera",
        help="Number of a camera (0 is the first), or a video file that stands for one; its "
        "video is written beside the recording.",
    ),
]
ModelOutput = Annotated[
    Path, typer.Option("--output", "-o", help="The model file to write (JSON).")
]


@dataclass(frozen=True)
class StartOptions:
    """Group of options: how the recordings or the source of a verb begin."""

    in_contact: InContactOption = False

    def load_dataset(self, folder: Path | str, *, labels: bool = True) -> "Dataset":
        """Return the recordings of a folder with this start.

        Raises:
            RecordingError: the folder does not exist, or has no recording.
        """
        from holdfast.io import load_dataset

        return load_dataset(folder, labels=labels, in_contact=self.in_contact)

    def of(self, recording: "Recording") -> "Recording":
        """Return a recording with this start."""
        # None, and not False: without the option, what the recording says of its start counts.
        return recording.with_start(loaded=self.in_contact or None)

    def create_stream(
        self,
        model: "Model",
        source: "Source",
        **options: Any,  # noqa: ANN401 (of the class)
    ) -> "StreamDetector":
        """Return the detector of an open source with this start."""
        from holdfast.live.stream_detector import StreamDetector

        return StreamDetector(model, source, in_contact=self.in_contact, **options)


@dataclass(frozen=True)
class EngineOptions:
    """Group of options: where the work is done, and by how many processes."""

    engine: Annotated[
        str,
        typer.Option(help="loky: processes of this machine; dask:ADDRESS: a Dask cluster."),
        RARE,
    ] = "loky"
    jobs: JobsOption = DEFAULT_JOBS

    def start(self) -> "Engine":
        """Return the engine, after a connection to it.

        Raises:
            ValueError: there is no such engine, or no jobs.
            EngineError: no cluster answers at the address, or a worker has another version.
            MissingExtra: dask is not installed.
        """
        from holdfast.parallel import Engine

        if self.jobs == 0:
            raise ValueError("jobs other than 0 expected, 0 given")
        started = Engine.parse(self.engine, self.jobs)
        started.check()  # a wrong address is reported now, not after the data are read
        return started


@dataclass(frozen=True)
class DetectorOptions:
    """Group of options: how a model detects."""

    rate: Annotated[
        RatePolicy,
        typer.Option(
            help="If the rate is not within 20 % of the model's: resample the source, or refuse it."
        ),
        RARE,
    ] = RatePolicy.RESAMPLE
    debounce: Annotated[
        float | None,
        typer.Option(
            help="Minimum time a new state must last before it is reported [s].",
            show_default="as in the model",
        ),
        RARE,
    ] = None
    hysteresis: HysteresisOption = None
    ignore: IgnoreOption = ""

    def load_model(self, name: str) -> "Model":
        """Load a model, and apply `--debounce` and `--hysteresis`.

        Args:
            name: path of the model, or the name of a built-in one.

        Raises:
            ValueError: a source is given instead of a model.
            ModelError: the model cannot be read.
        """
        from msgspec.structs import replace

        from holdfast.detection import Model
        from holdfast.devices.uri import is_uri

        # Before the model is read, whose message would name a missing file. builtin:any has the
        # form of a URI; a forgotten MODEL is the usual mistake.
        is_source = is_uri(name) and not name.startswith("builtin:")
        if is_source or name.endswith((".parquet", ".mcap", ".csv")):
            raise ValueError(
                f"{name} is a source; MODEL SOURCE expected, such as builtin:any {name}"
            )
        model = Model.load(name)
        chosen = {"min_duration": self.debounce, "hysteresis": self.hysteresis}
        changes = {key: value for key, value in chosen.items() if value is not None}
        return replace(model, name=model.name or name, debounce=replace(model.debounce, **changes))

    def create_stream(
        self, model: "Model", source: "Source", start: StartOptions
    ) -> "StreamDetector":
        """Create the detector of an open source, and report what the source lacks."""
        taxels = parse_taxels(self.ignore, source.sensors)
        strict = self.rate is RatePolicy.STRICT
        # It refuses a sensor or a rate that does not fit; what follows are only warnings.
        stream = start.create_stream(model, source, strict=strict, ignore=taxels)
        report_missing_fingers(model, source.name, source.sensors)
        report_other_handling(model, stream.fingers)
        report_blind_features(model, stream.fingers)
        return stream


@dataclass(frozen=True)
class ServerOptions:
    """Group of options: address of a page, and who may open it."""

    host: HostOption
    port: PortOption
    token: Annotated[
        str | None,
        typer.Option(
            help="Secret that clients must send; required for other hosts. Other users of this "
            "machine can read it in the list of processes: prefer --token-file."
        ),
        RARE,
    ] = None
    token_file: Annotated[
        Path | None,
        typer.Option(help="File with the secret in its first line; or set HOLDFAST_TOKEN instead."),
    ] = None

    def find_token(self) -> str | None:
        """Return the token of `--token`, `--token-file` or the environment; None without one.

        Raises:
            ValueError: both options are given, or the file cannot be read as text.
        """
        token, file = self.token, self.token_file
        if token is not None and file is not None:
            raise ValueError("--token and --token-file given; only one of them expected")
        if file is None:
            # An option that is typed outranks a variable of the shell.
            return os.environ.get(TOKEN_VARIABLE) if token is None else token
        try:
            if not file.is_file():
                raise ValueError(f"--token-file {file}: a file expected, there is none")
            with file.open(encoding="utf-8") as opened:
                # The file may be a device or a log without end.
                return opened.readline(MAX_TOKEN_LENGTH + 1).strip()
        except OSError as cause:
            raise ValueError(f"--token-file {file}: cannot be read: {cause.strerror}") from cause
        except UnicodeDecodeError as cause:
            raise ValueError(f"--token-file {file}: text expected, other bytes given") from cause


@dataclass(frozen=True)
class PlotOptions:
    """Group of options: the file of a figure; `plot` is None if none is drawn."""

    plot: Annotated[
        Path | None, typer.Option(help="Write a figure to this .svg, .png or .pdf file.")
    ] = None
    force: ForceOption = False

    def check(self) -> None:
        """Check that the figure can be written.

        Raises:
            ValueError: the suffix is not one of `PLOT_SUFFIXES`.
            OutputError: the file exists and `force` is not given, or its folder does not exist.
            MissingExtra: matplotlib is not installed.
        """
        from holdfast.files import refuse_overwrite

        if self.plot is None:
            return
        if self.plot.suffix.lower() not in PLOT_SUFFIXES:
            raise ValueError(f"a plot ends in {', '.join(PLOT_SUFFIXES)}; {self.plot.name!r} given")
        require_extras("plot")
        refuse_overwrite(self.plot, force=self.force)

    def save(self, draw: "Callable[[], Figure]") -> None:
        """Draw and write the figure if it is wanted, and print its path on stderr."""
        from holdfast.files import whole_file

        if self.plot is None:
            return
        figure = draw()
        with whole_file(self.plot, force=self.force) as part:  # a failure leaves no half figure
            figure.savefig(part)
        print_message(f"{self.plot} written")


def report_missing_fingers(model: "Model", name: str, modules: Mapping[str, object]) -> None:
    """Print the fingers of the model that a source or recording lacks."""
    missing = [finger for finger in model.fingers if finger not in ("*", *modules)]
    if missing:
        print_message(
            f"{name} has {', '.join(modules)}; the model also has {', '.join(missing)}, "
            "which get no estimates"
        )


def report_other_handling(model: "Model", sensors: "Mapping[str, Sensor]") -> None:
    """Print the sensors without own handling, if the model has that of others."""
    if advice := model.handling_advice(sensors):
        print_message(advice)


def report_handling(model: "Model", recordings: "Sequence[Recording]") -> None:
    """Print the sensors of the first recording without own handling, as `report_other_handling`."""
    if model.handled_sensors and recordings:
        sensors = {name: module.sensor for name, module in recordings[0].modules.items()}
        report_other_handling(model, model.fingers_of(sensors))


def report_blind_features(model: "Model", sensors: Mapping[str, "Sensor"]) -> None:
    """Print the features of a model that some sensors have too few taxels for."""
    for finger, sensor in sensors.items():
        if kinds := model.blind_features(finger, sensor):
            n_taxels = sensor.n_taxels
            print_message(
                f"{finger}: {sensor.name} has {n_taxels} taxel{'s' * (n_taxels > 1)}, too few for "
                f"{', '.join(kinds)}, which see nothing there (holdfast train on recordings of "
                "this sensor leaves them out)"
            )


def report_too_few_taxels(model: "Model", recordings: "Sequence[Recording]") -> None:
    """Print the features that sensors of the first recording lack, as `report_blind_features`."""
    sensors = {name: module.sensor for name, module in recordings[0].modules.items()}
    report_blind_features(model, model.fingers_of(sensors))


def report_missing_slip_rules(model: "Model") -> None:
    """Print that the slip probability of a model, or of some of its fingers, is always null."""
    without = [name for name, part in model.fingers.items() if part.slip is None]
    if not without:
        return
    # A model of one hand may have a rule for some of its fingers only.
    only = "" if len(without) == len(model.fingers) else f" for {', '.join(without)}"
    print_message(
        f"{model.name} has no slip rule{only}: slip_probability is null (holdfast train on "
        "recordings with a truth adds one)"
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
    from holdfast.sensors import taxel_index, taxel_number

    taxels: dict[str, tuple[int, ...]] = {}
    for part in filter(None, text.split(",")):
        finger, _, number = part.strip().rpartition(":")
        if not (finger and number.isdecimal()):
            raise ValueError(f"--ignore: FINGER:TAXEL,... expected, {text!r} given")
        if finger in sensors:
            first, last = taxel_number(0), taxel_number(sensors[finger].n_taxels - 1)
            if not first <= int(number) <= last:
                raise ValueError(
                    f"{finger}: taxel {int(number)} to be ignored; it has the taxels {first} to "
                    f"{last}"
                )
        taxels[finger] = (*taxels.get(finger, ()), taxel_index(int(number)))
    return taxels


def check_seconds(seconds: float | None) -> None:
    """Check the value of `--seconds`.

    Raises:
        ValueError: it is not above 0.
    """
    if seconds is not None and not seconds > 0:
        raise ValueError(f"--seconds: more than 0 s expected, {seconds:g} given")


def awaited(source: str) -> str:
    """Return what a command waits for while it opens a source; empty for a recording."""
    if source.startswith("twin:"):
        return f"simulating the first grasp of {source}"
    return f"waiting for the first packet of {source}" if "://" in source else ""


def check_speed(source: str, speed: float) -> None:
    """Check that the source can be played at this speed.

    Raises:
        ValueError: the speed is negative or not finite, or the source is a device and the
            speed is not 1.
    """
    from holdfast.devices.uri import is_uri

    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"--speed: at least 0 expected, {speed:g} given")
    # A device sends at its own pace.
    if speed != 1 and is_uri(source) and not source.startswith("twin:"):
        raise ValueError(f"--speed is for recordings and the twin; {source} is a device")
