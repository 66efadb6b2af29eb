"""`holdfast record`: record a source to a file, with markers."""

from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import (
    RARE,
    CameraOption,
    ForceOption,
    JsonOption,
    SecondsOption,
    SourceArgument,
    SpeedOption,
    check_seconds,
    check_speed,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message
from holdfast.cli.terminal.control import KEY_HELP, MarkerKeys, handle_stop_signals


def record(
    source: SourceArgument,
    out: Annotated[
        Path, typer.Argument(help="NAME.mcap, or a folder, which is created if missing.")
    ],
    seconds: SecondsOption = None,
    speed: Annotated[SpeedOption, RARE] = 1.0,
    object_name: Annotated[str, typer.Option("--object", help="Name of the object.")] = "",
    case: Annotated[str, typer.Option(help="Case of the experiment.")] = "",
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Other metadata; may be repeated."),
    ] = None,
    fsync: Annotated[
        bool,
        typer.Option(
            "--fsync", help="Wait for the disk: a power failure loses at most the last second."
        ),
        RARE,
    ] = False,
    camera: CameraOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Record a source; a crash loses at most the last half second.

    Write an MCAP file with all modules, each with its own times. The file of a process that was
    killed can still be read (holdfast info, import). SOURCE is a URI such as xela://HOST:PORT or
    twin:, or the path of a recording. It is recorded for --seconds, or until q, Ctrl-C or SIGTERM.
    These keys set markers: c closing, l locked, d disturbance, r released, space or 1-9 a mark;
    q stops. If stdin is a pipe, each line is a marker. Faults and notices of the source become
    markers too. If a device disconnects, the recording continues when it reconnects. --camera
    keeps a video on the same clock.

    Example:
      holdfast record xela://192.168.1.10:5000 grasps/ --object can --case 2
      holdfast record twin:?object=can can.mcap --seconds 10
      holdfast record xela://auto pulls.mcap --camera 0
      (sleep 5; echo push) | holdfast record xela://auto grasps/ --set by=Ann
    """
    from holdfast.cli.terminal.progress import StatusLine, format_size
    from holdfast.devices.sources import open_source
    from holdfast.live import recorder_setup as library
    from holdfast.live.arrival_buffer import marker_text
    from holdfast.live.camera import camera_of

    check_seconds(seconds)
    check_speed(source, speed)
    metadata = library.typed_metadata(object_name, case, settings or [])
    # Before a device is awaited.
    path = library.recording_path(source, out, object_name, force=force)
    with (
        handle_stop_signals() as stop,
        camera_of(camera, path, force=force) as film,
        open_source(source, speed=speed) as opened,
    ):
        stop.graceful = True  # Ctrl-C from here on closes the file; before, it ends the wait
        recorder = library.create_recorder(opened, path, metadata, force=force, fsync=fsync)
        print_message(f"recording {opened.name} to {path}")
        with (
            library.recording(opened, recorder), MarkerKeys() as keys, StatusLine(recorder) as line
        ):  # fmt: skip
            line.print(KEY_HELP if keys.interactive else "Ctrl-C stops")
            if film is not None:
                film.start(recorder, line.print)
            for arrival in library.arrivals_for(opened, seconds, speed):
                if arrival is not None:
                    # A recording can wait for a slow disk; a device drops samples.
                    recorder.put(arrival, wait=not opened.paced)
                    line.print(*map(marker_text, arrival.notices))
                for text in keys.poll():
                    recorder.add_marker(text)
                line.update()
                if stop.requested or keys.stop_pressed or recorder.failed:
                    break
    status = recorder.status
    if as_json:
        print_json({"path": path, **status.document(), "complete": True})
        return
    print_line(
        f"{status.seconds:.2f} s, {status.n_samples} samples of {len(status.modules)} modules "
        f"in {path} ({format_size(status.n_bytes)})"
    )
    if n := status.n_dropped:
        reason = "the disk is too slow, or the file cannot store them"
        print_message(f"{n} samples were dropped: {reason}")
    print_message(f"next: holdfast info {path}")
