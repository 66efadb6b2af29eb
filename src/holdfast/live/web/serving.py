"""Run the live page: of a session, or of a recording that is replayed."""

import sys
from collections.abc import Callable
from pathlib import Path

from holdfast.detection import Model
from holdfast.devices.sources import open_source
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector
from holdfast.live.web.service import LiveService
from holdfast.web import server
from holdfast.web.guard import Guard


def run_page(
    session: Session,
    announce: Callable[[str], None],
    *,
    host: str,
    port: int,
    guard: Guard | None = None,
    folder: Path,
    report: Callable[[str], None],
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
        report: called with the text of each notice.
        stay: continue when the source has ended.

    Raises:
        OutputError: the address is not available.
        Exception: the failure of the session.
    """
    service = LiveService(session, guard or Guard(host), folder, report)
    session.start()
    server.run_server(
        service.app, host, port, announce,
        # A page that stays still ends when the session fails.
        lambda: session.ended and not (stay and session.failure is None),
    )  # fmt: skip
    if session.failure is not None:
        raise session.failure


def show_recording(
    model: str, path: Path, folder: Path, speed: float, report: Callable[[str], None]
) -> None:
    """Replay a recording on a web page; at a terminal the page stays open until Ctrl-C.

    Args:
        model: name of the model.
        path: of the recording.
        folder: for recordings that are started on the page.
        speed: 1 is real time.
        report: called with the address of the page, and with each notice.
    """
    stay = sys.stdin.isatty()

    def announce(url: str) -> None:
        report(
            f"     {url} {'has opened' if server.open_browser(url) else '(open it in a browser)'}"
        )
        end = "Ctrl-C stops it" if stay else "it stops at the end of the recording"
        report(f"     {end}")

    with (
        # A page that stays shows the recording again and again.
        open_source(str(path), speed=speed, loop=stay) as source,
        Session(StreamDetector(Model.load(model), source)) as session,
    ):
        # Port 0: a free one, as 8080 may be taken.
        run_page(
            session, announce, host="127.0.0.1", port=0, folder=folder,
            report=report, stay=stay,
        )  # fmt: skip
