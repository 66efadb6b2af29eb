"""`holdfast serve`: what a model says of a source, on a page and for other programs."""

import os
import sys
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from holdfast.cli.options import (
    DebounceOption,
    HysteresisOption,
    IgnoreOption,
    ModelArgument,
    RateOption,
    RateRule,
    SourceArgument,
    check_speed,
    debounced,
    stream_detector_of,
)
from holdfast.cli.terminal.console import print_json, say

if TYPE_CHECKING:
    from holdfast.live.ros_publisher import RosPublisher
    from holdfast.live.session import Listener
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.model import Model
    from holdfast.sources import Source
    from holdfast.web.guard import Guard

HOST, PORT = "127.0.0.1", 8080


def serve(
    model: ModelArgument,
    source: SourceArgument,
    host: Annotated[str, typer.Option(help="Address to listen at.")] = HOST,
    port: Annotated[int, typer.Option(help="Port; 0 finds a free one.")] = PORT,
    token: Annotated[
        str | None, typer.Option(help="Secret that readers must know; needed with --host.")
    ] = None,
    record_to: Annotated[
        Path, typer.Option(help="Folder for the recordings that the page makes.")
    ] = Path("recordings"),
    speed: Annotated[float, typer.Option(help="Of a recording or the twin: 1 is real time.")] = 1.0,
    once: Annotated[
        bool, typer.Option("--once", help="Play a recording once, and end with it.")
    ] = False,
    rate: RateOption = RateRule.RESAMPLE,
    debounce: DebounceOption = None,
    hysteresis: HysteresisOption = None,
    ignore: IgnoreOption = "",
    ros2: Annotated[bool, typer.Option("--ros2", help="Publish on ROS 2 topics too.")] = False,
    ros1: Annotated[bool, typer.Option("--ros1", help="Publish on ROS 1 topics too.")] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print where the page is as JSON.")
    ] = False,
) -> None:
    """Shows what a model says of a source on a page, and tells other programs.

    The page shows every finger's state, force, sigma, probability, taxels and faults; it takes
    the tare and records. Programs read the WebSocket /api/v1/estimates (every sample) or
    /api/v1/live (twenty times a second): docs/live.md. Only this machine reaches it, unless
    --host says otherwise. Ctrl-C ends it.

    SOURCE is the path of a recording, xela://HOST:PORT (or xela://auto), twin:?object=can,
    ros2:///xServTopic, ros1:///xServTopic or serial:///dev/ttyACM0?sensor=anyskin.

    Example:
      holdfast serve builtin:twin twin:?object=can
      holdfast serve model.json xela://auto --ros2
      holdfast serve model.json grasp.parquet --host 0.0.0.0 --token SECRET
    """
    from holdfast.live.stream_detector import compile_kernels
    from holdfast.sources import open_source
    from holdfast.web.guard import Guard

    guard = Guard(host, token)
    check_speed(source, speed)
    wanted = debounced(model, debounce, hysteresis)
    compile_kernels()

    def tell(url: str) -> None:
        page = url if token is None else f"{url}?token={quote(token, safe='')}"
        if as_json:
            print_json({"url": page, "model": wanted.name, "source": source})
            sys.stdout.flush()
        say(f"{page} shows what {wanted.name} says of {source}; Ctrl-C ends it")

    with ExitStack() as stack:
        opened = stack.enter_context(open_source(source, speed=speed, loop=not once))
        stream = stream_detector_of(wanted, opened, rate, ignore)
        publishers = [stack.enter_context(one) for one in _publishers(stream, ros2=ros2, ros1=ros1)]
        show_page(
            wanted, opened, tell,
            stream=stream, host=host, port=port, guard=guard, folder=record_to,
            listeners=[publisher.put for publisher in publishers], stay=not once,
        )  # fmt: skip
        _tell_unpublished(publishers)


def _tell_unpublished(publishers: "Sequence[RosPublisher]") -> None:
    """Tells what ROS did not take: nobody sees it on the topics."""
    for publisher in publishers:
        if publisher.n_failed or publisher.n_dropped:
            say(
                f"{type(publisher).__name__}: ROS refused {publisher.n_failed} estimates, and was "
                f"too slow for {publisher.n_dropped}"
            )


def _publishers(stream: "StreamDetector", *, ros2: bool, ros1: bool) -> "Iterator[RosPublisher]":
    """Those of the estimates on ROS topics that are asked for."""
    units = {name: sensor.unit for name, sensor in stream.fingers.items()}
    if ros2:
        from holdfast.live.ros2_publisher import Ros2Publisher

        yield Ros2Publisher(units)
    if ros1:
        from holdfast.live.ros1_publisher import Ros1Publisher

        yield Ros1Publisher(units)


def show_page(
    model: "Model",
    source: "Source",
    tell: Callable[[str], None],
    *,
    stream: "StreamDetector | None" = None,
    host: str = HOST,
    port: int = PORT,
    guard: "Guard | None" = None,
    folder: Path | None = None,
    listeners: Sequence["Listener"] = (),
    stay: bool = True,
) -> None:
    """Serves the page of a source until Ctrl-C, or until the source ends where not `stay`.

    Args:
        model: that judges.
        source: that is open.
        tell: is given the address once the page can be opened.
        stream: detector of the source; one without options by default.
        host: address to listen at.
        port: 0 for any that is free.
        guard: who may come in; this machine by default.
        folder: where recordings go.
        listeners: what else hears what is said.
        stay: go on when the source has ended.

    Raises:
        OutputError: the address cannot be listened at.
        Exception: that which made the session fail.
    """
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.live.web.service import LiveService
    from holdfast.web.guard import Guard
    from holdfast.web.server import run_server

    session = Session(stream or StreamDetector(model, source))
    service = LiveService(session, model, guard or Guard(host), folder)
    for listener in listeners:
        session.add_listener(listener)
    session.start()
    try:
        run_server(
            service.app, host, port, tell,
            lambda: session.ended and not (stay and session.failure is None),
        )  # fmt: skip
    finally:
        session.stop()
    if session.failure is not None:
        raise session.failure


def open_page(url: str) -> bool:
    """Whether a browser with windows has been told to open a page; text browsers are not."""
    windows = sys.platform in ("win32", "darwin")
    if not (windows or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
