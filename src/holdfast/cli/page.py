"""A source on a page: a session, the web service, and a browser where there is one."""

import os
import sys
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from holdfast.live.session import Listener
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.model import Model
    from holdfast.sources import Source
    from holdfast.web.guard import Guard

HOST, PORT = "127.0.0.1", 8080


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
    from holdfast.live.service import Service
    from holdfast.live.session import Session
    from holdfast.live.stream_detector import StreamDetector
    from holdfast.web.guard import Guard
    from holdfast.web.server import run_server

    session = Session(stream or StreamDetector(model, source))
    service = Service(session, model, guard or Guard(host), folder)
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
