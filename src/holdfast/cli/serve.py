"""`holdfast serve`: the estimates of a source on a web page and for other programs."""

import os
import sys
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import quote

import typer

from holdfast.cli.extensions import PanelOptions, PublisherOptions
from holdfast.cli.options import (
    LOCALHOST,
    RARE,
    DetectorOptions,
    JsonOption,
    ModelArgument,
    OnceOption,
    ServerOptions,
    SourceArgument,
    SpeedOption,
    StartOptions,
    awaited,
    check_speed,
    report_missing_slip_rules,
)
from holdfast.cli.terminal.console import message_if_slow, print_json, print_message

if TYPE_CHECKING:
    from holdfast.devices.sources import Source
    from holdfast.live.panels import Panel, PanelOpener
    from holdfast.live.session import Session
    from holdfast.model import Model
    from holdfast.web.guard import Guard

ADDRESS = ServerOptions(LOCALHOST, port=8080)


def serve(
    model: ModelArgument,
    source: SourceArgument,
    *,
    access: ServerOptions = ADDRESS,
    record_to: Annotated[
        Path, typer.Option(help="Folder for recordings that are started on the page.")
    ] = Path("recordings"),
    speed: SpeedOption = 1.0,
    once: OnceOption = False,
    options: DetectorOptions,
    start: StartOptions,
    panels: Annotated[PanelOptions, RARE],
    publishers: PublisherOptions,
    as_json: JsonOption = False,
) -> None:
    r"""Show the estimates of a source on a web page, and publish them.

    The page shows the state, force, sigma, probability, taxels and faults of every finger. It
    can also take the tare and record. Other programs read the WebSocket /api/v1/estimates (every
    sample) or /api/v1/live (twenty times per second), see docs/live-page.md. Without --host, only
    this machine can connect. With --json, the address is printed as JSON. Stop it with Ctrl-C.

    With --hand, it also controls the grip force of a hand, as holdfast hold does, and the page
    has an emergency stop. Without --armed nothing is sent. Read docs/grip.md first; --help-all has
    the options.

    SOURCE is the path of a recording, xela://HOST:PORT (or xela://auto), twin:?object=can,
    ros2:///xServTopic, ros1:///xServTopic or serial:///dev/ttyACM0?sensor=anyskin.

    Example:
      holdfast serve builtin:any twin:?object=can
      holdfast serve model.json xela://auto --ros2
      holdfast serve builtin:any twin:?object=can --hand twin: --armed
      holdfast serve model.json grasp.parquet --host 0.0.0.0 \
        --token-file secret.txt
    """
    from holdfast.devices.sources import open_source
    from holdfast.web.guard import Guard

    openers = [
        plugin.panel(chosen, source, speed=speed, loop=not once)
        for _, plugin, chosen in panels.chosen()
    ]
    token = access.find_token()  # a wrong token is refused before anything is loaded
    guard = Guard(access.host, token)
    check_speed(source, speed)
    with message_if_slow(f"loading the detector for {source}" if awaited(source) else ""):
        loaded = options.load_model(model)

    def announce(url: str) -> None:
        report_missing_slip_rules(loaded)
        page = page_url(url, token)
        if as_json:
            print_json({"url": page, "model": loaded.name, "source": source})
            sys.stdout.flush()  # a program that reads the pipe waits for the address
        print_message(f"{page} shows the estimates of {loaded.name} for {source}; Ctrl-C stops it")

    # A panel may make the source, as the twin whose hand it commands.
    made = [opener.source() for opener in openers]
    own = next((one for one in made if one is not None), None)
    unopened = own or open_source(source, speed=speed, loop=not once)
    with (
        _open_session(options, start, loaded, unopened, openers) as (session, shown),
        _publish(session, shown, publishers),
    ):
        run_page(
            session, announce, host=access.host, port=access.port,
            guard=guard, folder=record_to, panels=shown, stay=not once,
        )  # fmt: skip


@contextmanager
def _open_session(
    options: DetectorOptions,
    start: StartOptions,
    model: "Model",
    source: "Source",
    openers: "Sequence[PanelOpener]",
) -> "Iterator[tuple[Session, Sequence[Panel]]]":
    """Yield the session of a source, and the panels that run beside it."""
    from holdfast.live.session import Session

    with ExitStack() as stack:
        for opener in openers:
            opener.connect(stack)
        with message_if_slow(awaited(source.name)):
            stack.enter_context(source)
        session = stack.enter_context(Session(options.create_stream(model, source, start)))
        yield session, [stack.enter_context(opener.open(session)) for opener in openers]


@contextmanager
def _publish(
    session: "Session", shown: "Sequence[Panel]", options: PublisherOptions
) -> "Iterator[None]":
    """Publish the estimates of a session; at the end, print how many are missing."""
    panels = {panel.name: panel for panel in shown}
    with ExitStack() as stack:
        publishers = [
            stack.enter_context(plugin.publisher(session.stream, panels, chosen))
            for _, plugin, chosen in options.chosen()
        ]
        for publisher in publishers:
            session.add_listener(publisher.put)
        yield
        for publisher in publishers:
            if publisher.n_failed or publisher.n_dropped:
                print_message(
                    f"{type(publisher).__name__}: {publisher.n_failed} estimates were refused, "
                    f"{publisher.n_dropped} were dropped because it was too slow"
                )


def run_page(
    session: "Session",
    announce: Callable[[str], None],
    *,
    host: str = LOCALHOST,
    port: int,
    guard: "Guard | None" = None,
    folder: Path,
    panels: "Sequence[Panel]" = (),
    stay: bool,
) -> None:
    """Run the live page of a session until Ctrl-C, or until the source ends if not `stay`.

    Args:
        session: it is started here; the caller stops it.
        announce: function that is called with the URL when the page can be opened.
        host: address to listen on.
        port: port to listen on; 0 selects a free one.
        guard: access control; by default only this machine can connect.
        folder: folder for recordings.
        panels: that run beside the session.
        stay: continue when the source has ended.

    Raises:
        OutputError: the address is not available.
        Exception: the failure of the session.
    """
    from holdfast.live.web.service import LiveService
    from holdfast.web.guard import Guard
    from holdfast.web.server import run_server

    service = LiveService(session, guard or Guard(host), folder, print_message, panels)
    session.start()
    run_server(
        service.app, host, port, announce,
        # A page that stays still ends when the session fails.
        lambda: session.ended and not (stay and session.failure is None),
    )  # fmt: skip
    if session.failure is not None:
        raise session.failure


def page_url(url: str, token: str | None) -> str:
    """Return the URL of a page with the token that it requires."""
    return url if token is None else f"{url}?token={quote(token, safe='')}"


def has_browser() -> bool:
    """Return whether this machine may have a graphical browser."""
    desktop = sys.platform in ("win32", "darwin")
    return bool(desktop or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def open_browser(url: str) -> bool:
    """Open a page in a graphical browser; return False if there is none."""
    if not has_browser():
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
