"""Run a web application until it is interrupted, and open its page in a browser."""

import asyncio
import os
import signal
import sys
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from urllib.parse import quote

from aiohttp import web

from holdfast.errors import listen_error
from holdfast.web.connections import (
    BACKLOG,
    HEADER_TIMEOUT,
    LOGGER,
    log_exceptions_briefly,
)

STOP_POLL_INTERVAL = 0.2
"""Time between two calls of `is_over` [s]."""
SHUTDOWN_TIMEOUT = 1.0
"""Time that clients have to disconnect [s]."""
LINGERING_TIME = 1.0
"""Time for which the rest of a refused request is read and dropped [s]."""


def run_server(
    app: web.Application,
    host: str,
    port: int,
    announce: Callable[[str], None],
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """Run a web application until Ctrl-C, SIGTERM or SIGHUP, then shut it down in order.

    Args:
        app: the application.
        host: address to listen at.
        port: 0 for any free port.
        announce: called with the address of the page once the page can be opened.
        is_over: returns whether the server should stop; called a few times a second.

    Raises:
        OutputError: the address is in use or cannot be bound.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(app, host, port, announce, is_over))


async def _serve(
    app: web.Application,
    host: str,
    port: int,
    announce: Callable[[str], None],
    is_over: Callable[[], bool],
) -> None:
    log_exceptions_briefly(asyncio.get_running_loop())
    async with listening(app, host, port) as url:
        announce(url)
        stopped, loop = asyncio.Event(), asyncio.get_running_loop()
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            # A process under nohup ignores SIGHUP, and goes on.
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                with suppress(NotImplementedError):  # Windows has no signal handlers in event loops
                    loop.add_signal_handler(number, stopped.set)
        while not stopped.is_set() and not is_over():
            with suppress(TimeoutError):
                await asyncio.wait_for(stopped.wait(), STOP_POLL_INTERVAL)


@asynccontextmanager
async def listening(app: web.Application, host: str, port: int) -> AsyncIterator[str]:
    """Serve a web application in the running event loop.

    aiohttp closes a connection whose header does not arrive within the keep-alive timeout.

    Yields:
        The address of the page.

    Raises:
        OutputError: the address is in use or cannot be bound.
    """
    runner = web.AppRunner(
        app,
        shutdown_timeout=SHUTDOWN_TIMEOUT,
        keepalive_timeout=HEADER_TIMEOUT,
        lingering_time=LINGERING_TIME,
        auto_decompress=False,
        logger=LOGGER,
        access_log=None,
    )
    await runner.setup()
    try:
        try:
            await web.TCPSite(runner, host, port, backlog=BACKLOG).start()
        except (OSError, OverflowError) as cause:
            raise listen_error(host, port, cause) from cause
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        shown = f"[{shown}]" if ":" in shown else shown
        yield f"http://{shown}:{runner.addresses[0][1]}/"
    finally:
        await runner.cleanup()


def page_url(url: str, token: str | None) -> str:
    """Return the URL of a page with the token that it requires."""
    return url if token is None else f"{url}?token={quote(token, safe='')}"


def has_browser() -> bool:
    """Return whether this machine may have a graphical browser."""
    desktop = sys.platform in ("win32", "darwin")
    return bool(desktop or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def wants_browser(option: bool | None) -> bool:
    """Return whether a page is opened: by default for a person at a terminal with a browser."""
    return has_browser() and sys.stdin.isatty() if option is None else option


def open_browser(url: str) -> bool:
    """Open a page in a graphical browser; return False if there is none."""
    if not has_browser():
        return False
    try:
        return webbrowser.open(url)
    except webbrowser.Error:
        return False
