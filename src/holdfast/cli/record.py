"""`holdfast record`: what a source sends, to a file, with markers."""

import math
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import check_speed
from holdfast.cli.terminal.console import print_json, say, show
from holdfast.cli.terminal.stopping import Stop, stopping

if TYPE_CHECKING:
    from holdfast.live.recorder import Recorder, RecorderStatus
    from holdfast.sources import Arrival, Source

PATIENCE = 0.1
"""How long the source is waited for before keys and signals are looked at [s]."""
GRACE = 1.0
"""A source that falls silent is given up so long after the time asked for [s]."""

_SUFFIX = ".mcap"


def record(
    source: Annotated[
        str, typer.Argument(help="A URI such as xela://HOST:PORT or twin:, or a recording's path.")
    ],
    out: Annotated[
        Path, typer.Argument(help="NAME.mcap, or a folder; a folder is made if missing.")
    ],
    seconds: Annotated[
        float | None, typer.Option(help="Stop after so long [s]; else by q, Ctrl-C or SIGTERM.")
    ] = None,
    speed: Annotated[
        float, typer.Option(help="Of a recording or the twin: 1 real time, 0 as fast as it goes.")
    ] = 1.0,
    thing: Annotated[str, typer.Option("--object", help="What is grasped.")] = "",
    case: Annotated[str, typer.Option(help="Of the experiment.")] = "",
    note: Annotated[str, typer.Option(help="Anything worth knowing.")] = "",
    given: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="More metadata; may be repeated."),
    ] = None,
    fingers_only: Annotated[
        bool, typer.Option("--fingers-only", help="Leave out pads and palm.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Records a source, and loses at most half a second whatever happens.

    Writes MCAP, of all modules with their own times. What was killed or cut stays readable
    (holdfast info, import). Keys set markers: c closing, l locked, d disturbance,
    r released, space or 1-9 a mark; q stops. Where stdin is a pipe, each line is a marker. Faults
    and notices of the source become markers too. A device that goes away is waited for.

    Example:
      holdfast record xela://192.168.1.10:5000 grasps/can_1.mcap --object can --case 2
      holdfast record twin:?object=can can.mcap --seconds 10
      (sleep 5; echo disturbance) | holdfast record xela://auto grasps/ --set operator=Ann
    """
    if seconds is not None and not seconds > 0:
        raise ValueError(f"--seconds: more than 0 s expected, {seconds:g} given")
    check_speed(source, speed)
    own = _metadata(thing, case, note, given or [])
    path = _target(source, out, thing, force=force)
    from holdfast.sources import open_source

    with stopping() as stop, open_source(source, speed=speed) as opened:
        stop.gently = True
        recorder = _recorder(opened, path, own, fingers_only=fingers_only, force=force)
        _record(opened, recorder, stop, _arrivals(opened, seconds, speed))
    _tell(recorder.path, recorder.status, as_json)


def _arrivals(source: "Source", seconds: float | None, speed: float) -> "Iterator[Arrival | None]":
    """What arrives, or None where nothing does for a while, until it is over."""
    span = math.inf if seconds is None else seconds
    end = time.monotonic() + (span / speed + GRACE if speed else math.inf)
    first = math.nan
    while not source.ended and time.monotonic() < end:
        arrival = source.read(PATIENCE)
        if arrival is not None and arrival.samples:
            first = arrival.time if math.isnan(first) else first
            if arrival.time - first >= span:
                return
        yield arrival


def _record(
    source: "Source", recorder: "Recorder", stop: Stop, arrivals: "Iterator[Arrival | None]"
) -> None:
    """Records until the source or somebody ends it; the file is whole then.

    Raises:
        OutputError: the disk refused.
        SourceError: no sample came; no file is left.
    """
    from holdfast.cli.terminal.keys import LEGEND, Keys
    from holdfast.cli.terminal.record_line import RecordLine
    from holdfast.errors import OutputError, SourceError
    from holdfast.live.recording_buffer import marker_text

    say(f"recording {source.name} to {recorder.path}")
    try:
        with recorder, Keys() as keys, RecordLine(recorder) as line:
            line.say(LEGEND if keys.live else "Ctrl-C stops")
            for arrival in arrivals:
                if arrival is not None:
                    recorder.put(arrival, wait=not source.paced)
                    line.say(*map(marker_text, arrival.notices))
                for text in keys.poll():
                    recorder.add_marker(text)
                line.update()
                if stop.asked or keys.stopped or recorder.failed:
                    break
    except OutputError as refusal:
        kept = not _is_empty(recorder) and recorder.path.exists()
        hint = f"; for what was kept: holdfast info {recorder.path}" if kept else ""
        raise OutputError(f"{refusal}{hint}") from refusal
    if _is_empty(recorder):
        raise SourceError(f"{source.name} sent no samples: nothing was recorded")


def _is_empty(recorder: "Recorder") -> bool:
    """Whether it got no samples; its file goes away then."""
    if recorder.status.n_samples:
        return False
    recorder.path.unlink(missing_ok=True)
    return True


def _target(source: str, out: Path, thing: str, *, force: bool) -> Path:
    """The file to write; it may be written."""
    from holdfast.files import refuse_overwrite

    path = out
    if out.is_dir() or not out.suffix:
        path = out / f"{_name(source, thing)}{_SUFFIX}"
    elif out.suffix != _SUFFIX:
        raise ValueError(
            f"{out}: a recording is captured to NAME{_SUFFIX}; holdfast import makes others of it"
        )
    if path.exists() and Path(source).exists() and path.samefile(source):
        raise ValueError(f"{path} is the source itself: choose another name")
    if path == out or out.exists():
        refuse_overwrite(path, force=force)
    return path


def _name(source: str, thing: str) -> str:
    """Of a recording: that of the one that is played, or the object or device, and when."""
    from holdfast.sources.uri import is_uri

    if not is_uri(source):
        return Path(source).stem
    what = re.sub(r"[^\w.-]+", "_", thing or source.partition(":")[0]).strip("._")
    return f"{what or 'grasp'}-{time.strftime('%Y%m%d-%H%M%S')}"


def _recorder(
    source: "Source", path: Path, own: dict[str, Any], *, fingers_only: bool, force: bool
) -> "Recorder":
    """Begins the file."""
    from holdfast.errors import OutputError, SourceError
    from holdfast.live.recorder import Recorder

    chosen = {
        name: sensor
        for name, sensor in source.sensors.items()
        if not (fingers_only and "/" in name)
    }
    if not chosen:
        raise SourceError(f"no fingers: {source.name} has {', '.join(source.sensors)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as cause:
        raise OutputError(f"cannot write to {path.parent}: {cause.strerror}") from cause
    recorded_at = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
    metadata = {**source.metadata, "recorded_at": recorded_at, **own}
    return Recorder(path, chosen, metadata=metadata, force=force)


def _metadata(thing: str, case: str, note: str, given: list[str]) -> dict[str, Any]:
    """What the user says of the recording; numbers become numbers."""
    pairs: dict[str, Any] = {"object": thing, "case": case, "note": note}
    pairs = {key: text for key, text in pairs.items() if text}
    for pair in given:
        key, equals, text = pair.partition("=")
        if not (key and equals):
            raise ValueError(f"--set KEY=VALUE expected, {pair!r} given")
        if key in pairs:
            raise ValueError(f"--set: {key} is given twice")
        pairs[key] = _value(text)
    return pairs


def _value(text: str) -> float | str:
    """A number, where it is one.

    Example:
        >>> _value("3"), _value("0.25"), _value("can")
        (3, 0.25, 'can')
    """
    if re.fullmatch(r"-?\d{1,15}", text, re.ASCII):
        return int(text)
    if re.fullmatch(r"-?\d+\.\d+", text, re.ASCII):
        return float(text)
    return text


def _tell(path: Path, status: "RecorderStatus", as_json: bool) -> None:
    """What was recorded, and how to go on."""
    if as_json:
        print_json(_document(path, status))
        return
    from holdfast.cli.terminal.record_line import size

    show(
        f"{status.seconds:.2f} s, {status.n_samples} samples of {len(status.modules)} modules "
        f"in {path} ({size(status.n_bytes)})"
    )
    if status.n_dropped:
        say(f"{status.n_dropped} samples were dropped: the disk is too slow, or they were unfit")
    say(f"go on with: holdfast info {path}")


def _document(path: Path, status: "RecorderStatus") -> dict[str, Any]:
    mean = (status.n_samples - 1) / status.seconds if status.seconds else math.nan
    return {
        "path": path,
        "seconds": status.seconds,
        "n_samples": status.modules,
        "rate": mean,
        "n_gaps": status.n_gaps,
        "n_lost": status.n_lost,
        "n_refused": status.n_refused,
        "n_dropped": status.n_dropped,
        "n_bytes": status.n_bytes,
        "n_markers": status.n_markers,
        "faults": status.faults,
        "complete": True,
    }
