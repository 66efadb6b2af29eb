"""`holdfast record`: record a source to a file, with markers."""

import math
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import (
    RARE,
    ForceOption,
    JsonOption,
    SecondsOption,
    SourceArgument,
    SpeedOption,
    check_seconds,
    check_speed,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.control import StopRequest, handle_stop_signals

if TYPE_CHECKING:
    from holdfast.devices.sources import Arrival, Source
    from holdfast.live.camera import CameraRecorder
    from holdfast.live.recorder import Recorder

READ_TIMEOUT = 0.1
"""Time to wait for the source before keys and signals are checked [s]."""
EXTRA_TIME = 1.0
"""Time after `--seconds` at which recording stops, also without samples [s]."""

_SUFFIX = ".mcap"


def record(
    source: SourceArgument,
    out: Annotated[
        Path, typer.Argument(help="NAME.mcap, or a folder, which is created if missing.")
    ],
    seconds: SecondsOption = None,
    speed: Annotated[SpeedOption, RARE] = 1.0,
    object_name: Annotated[str, typer.Option("--object", help="Name of the object.")] = "",
    case: Annotated[str, typer.Option(help="Case of the experiment.")] = "",
    note: Annotated[str, typer.Option(help="Note about the recording.")] = "",
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Other metadata; may be repeated."),
        RARE,
    ] = None,
    fingers_only: Annotated[
        bool, typer.Option("--fingers-only", help="Leave out pads and palm."), RARE
    ] = False,
    fsync: Annotated[
        bool,
        typer.Option(
            "--fsync", help="Wait for the disk: a power failure loses at most the last second."
        ),
        RARE,
    ] = False,
    camera: Annotated[
        str | None,
        typer.Option(
            help="Number of a camera (0 is the first), or a video file that stands for one; its "
            "video is written beside the recording."
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Record a source; a crash loses at most the last half second.

    Write an MCAP file with all modules, each with its own times. The file of a process that was
    killed can still be read (holdfast info, import). SOURCE is a URI such as xela://HOST:PORT or
    twin:, or the path of a recording. It is recorded for --seconds, or until q, Ctrl-C or SIGTERM.
    These keys set markers: c closing, l locked,
    d disturbance, r released, space or 1-9 a mark; q stops. If stdin is a pipe, each line is a
    marker. Faults and notices of the source become markers too. If a device disconnects, the
    recording continues when it reconnects. --camera keeps a video on the same clock.

    Example:
      holdfast record xela://192.168.1.10:5000 grasps/ --object can --case 2
      holdfast record twin:?object=can can.mcap --seconds 10
      holdfast record xela://auto pulls.mcap --camera 0
      (sleep 5; echo push) | holdfast record xela://auto grasps/ --set by=Ann
    """
    from holdfast.cli.terminal.progress import format_size
    from holdfast.devices.sources import open_source
    from holdfast.live.camera import camera_of

    check_seconds(seconds)
    check_speed(source, speed)
    metadata = _metadata(object_name, case, note, settings or [])
    path = _output_path(source, out, object_name, force=force)  # before a device is awaited
    with (
        handle_stop_signals() as stop,
        camera_of(camera, path, force=force) as film,
        open_source(source, speed=speed) as opened,
    ):
        stop.graceful = True  # Ctrl-C from here on closes the file; before, it ends the wait
        recorder = _create_recorder(
            opened, path, metadata, fingers_only=fingers_only, force=force, fsync=fsync
        )
        _record(opened, recorder, stop, _read(opened, seconds, speed), film)
    path, status = recorder.path, recorder.status
    if as_json:
        mean = (status.n_samples - 1) / status.seconds if status.seconds else math.nan
        fields = ("n_gaps", "n_lost", "n_refused", "n_dropped", "n_bytes", "n_markers", "faults")
        counts = {field: getattr(status, field) for field in fields}
        known = {"path": path, "seconds": status.seconds, "n_samples": status.modules}
        print_json({**known, "rate": mean, **counts, "complete": True})
        return
    print_line(
        f"{status.seconds:.2f} s, {status.n_samples} samples of {len(status.modules)} modules "
        f"in {path} ({format_size(status.n_bytes)})"
    )
    if status.n_dropped:
        print_message(
            f"{status.n_dropped} samples were dropped: the disk is too slow, "
            "or the file cannot store them"
        )
    print_message(f"next: holdfast info {path}")


def _read(source: "Source", seconds: float | None, speed: float) -> "Iterator[Arrival | None]":
    """Yield arrivals until `seconds` are over; None if nothing arrives for a while."""
    duration = math.inf if seconds is None else seconds
    end = time.monotonic() + (duration / speed + EXTRA_TIME if speed else math.inf)
    first = math.nan
    while not source.ended and time.monotonic() < end:
        arrival = source.read(READ_TIMEOUT)
        if arrival is not None and arrival.samples:
            first = arrival.time if math.isnan(first) else first
            # The source's own clock counts; the other one only if it falls silent.
            if arrival.time - first >= duration:
                return
        yield arrival


def _record(
    source: "Source",
    recorder: "Recorder",
    stop: StopRequest,
    arrivals: "Iterator[Arrival | None]",
    film: "CameraRecorder | None",
) -> None:
    """Record until the source ends or the user stops it, and close the file.

    Raises:
        OutputError: the file cannot be written.
        SourceError: no samples arrived; the file is removed.
    """
    from holdfast.cli.terminal.control import KEY_HELP, MarkerKeys
    from holdfast.cli.terminal.progress import StatusLine
    from holdfast.errors import OutputError, SourceError
    from holdfast.live.recording_buffer import marker_text

    print_message(f"recording {source.name} to {recorder.path}")
    try:
        with recorder, MarkerKeys() as keys, StatusLine(recorder) as line:
            line.print(KEY_HELP if keys.interactive else "Ctrl-C stops")
            if film is not None:
                film.start(recorder, line.print)
            for arrival in arrivals:
                if arrival is not None:
                    # A recording can wait for a slow disk; a device drops samples.
                    recorder.put(arrival, wait=not source.paced)
                    line.print(*map(marker_text, arrival.notices))
                for text in keys.poll():
                    recorder.add_marker(text)
                line.update()
                if stop.requested or keys.stop_pressed or recorder.failed:
                    break
    except OutputError as failure:
        if not recorder.status.n_samples:  # a file without samples is of no use
            recorder.path.unlink(missing_ok=True)
        kept = recorder.path.exists()
        hint = f"; see the recorded part with: holdfast info {recorder.path}" if kept else ""
        raise OutputError(f"{failure}{hint}") from failure
    if not recorder.status.n_samples:
        recorder.path.unlink(missing_ok=True)
        raise SourceError(f"{source.name} sent no samples: nothing was recorded")


def _output_path(source: str, out: Path, object_name: str, *, force: bool) -> Path:
    """Return the file to write, and check that it can be written.

    In a folder, it is named as the source recording, or as the object or device with the time.
    """
    from holdfast.devices.uri import is_uri
    from holdfast.files import file_stem, refuse_overwrite

    path = out
    if out.is_dir() or not out.suffix:
        name = file_stem(Path(source).stem)
        if is_uri(source):
            # The name of an object becomes part of the file name, which does not begin with a dot.
            what = re.sub(r"[^\w.-]+", "_", object_name or source.partition(":")[0]).strip("._")
            name = f"{file_stem(what or 'grasp')}-{time.strftime('%Y%m%d-%H%M%S')}"
        path = out / f"{name}{_SUFFIX}"
    elif out.suffix != _SUFFIX:
        raise ValueError(
            f"{out}: NAME{_SUFFIX} expected (holdfast import converts recordings to .parquet)"
        )
    if path.exists() and Path(source).exists() and path.samefile(source):
        raise ValueError(f"{path} is the source: choose another name")
    if path == out or out.exists():
        refuse_overwrite(path, force=force)
    return path


def _create_recorder(
    source: "Source",
    path: Path,
    metadata: dict[str, Any],
    *,
    fingers_only: bool,
    force: bool,
    fsync: bool,
) -> "Recorder":
    """Create the file and its recorder."""
    from holdfast.errors import OutputError, SourceError
    from holdfast.live.recorder import Recorder

    sensors = {
        name: sensor
        for name, sensor in source.sensors.items()
        if not (fingers_only and "/" in name)
    }
    if not sensors:
        raise SourceError(f"no fingers to record: {source.name} has {', '.join(source.sensors)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {path.parent}: {cause.strerror}") from cause
    recorded_at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    # What was typed outranks what the source says of itself.
    metadata = {**source.metadata, "recorded_at": recorded_at, **metadata}
    return Recorder(path, sensors, metadata=metadata, force=force, fsync=fsync)


def _metadata(object_name: str, case: str, note: str, settings: list[str]) -> dict[str, Any]:
    """Return the metadata of the options; texts of numbers become numbers."""
    pairs: dict[str, Any] = {"object": object_name, "case": case, "note": note}
    pairs = {key: text for key, text in pairs.items() if text}
    for pair in settings:
        key, equals, text = pair.partition("=")
        if not (key and equals):
            raise ValueError(f"--set KEY=VALUE expected, {pair!r} given")
        if key in pairs:
            raise ValueError(f"--set: {key} is given twice")
        pairs[key] = _value(text)
    return pairs


def _value(text: str) -> float | str:
    """Convert the text of a number.

    Example:
        >>> _value("3"), _value("0.25"), _value("can")
        (3, 0.25, 'can')
    """
    # `re.ASCII`, because `\d` matches digits of other scripts as well.
    if re.fullmatch(r"-?\d{1,15}", text, re.ASCII):
        return int(text)
    if re.fullmatch(r"-?\d+\.\d+", text, re.ASCII):
        return float(text)
    return text
