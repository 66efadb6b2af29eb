"""Run a web application until it is interrupted, and open its page in a browser."""

import asyncio
import os
import signal
import sys
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any
from urllib.parse import quote

from aiohttp import web

from holdfast.errors import listen_error
from holdfast.web.connections import (
    BACKLOG,
    HEADER_TIMEOUT,
    LOGGER,
    ConnectionLimit,
    log_exceptions_briefly,
)
from holdfast.web.guard import SECURITY_HEADERS, Handler

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
    """Serve a web application in the running event loop, with limited connections.

    Yields:
        The address of the page.

    Raises:
        OutputError: the address is in use or cannot be bound.
    """
    limit = ConnectionLimit.of_process()

    @web.middleware
    async def mark(request: web.Request, handler: Handler) -> web.StreamResponse:
        with limit.request(request.transport):
            return await handler(request)

    app.middlewares.insert(0, mark)  # the first: a request that is refused is one too
    runner = web.AppRunner(app, shutdown_timeout=SHUTDOWN_TIMEOUT)
    await runner.setup()
    try:
        server = await _listen(runner, limit, host, port)
        try:
            shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
            shown = f"[{shown}]" if ":" in shown else shown
            yield f"http://{shown}:{server.sockets[0].getsockname()[1]}/"
        finally:
            server.close()
    finally:
        await runner.cleanup()


class _LimitedConnection(web.RequestHandler):
    """Connection of a client, which counts for a limit.

    aiohttp closes a connection whose header does not arrive within the keep-alive timeout.
    """

    __slots__ = ("_limit", "_own_transport")

    def __init__(self, server: web.Server, limit: ConnectionLimit) -> None:
        super().__init__(
            server,
            loop=asyncio.get_running_loop(),
            keepalive_timeout=HEADER_TIMEOUT,
            lingering_time=LINGERING_TIME,
            auto_decompress=False,
            logger=LOGGER,
            access_log=None,  # type: ignore[arg-type]  # aiohttp accepts it
        )
        self._limit = limit
        self._own_transport: asyncio.BaseTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._own_transport = transport
        self._limit.add(transport)

    def connection_lost(self, error: BaseException | None) -> None:
        self._limit.remove(self._own_transport)
        super().connection_lost(error)

    def set_parser(self, *parts: Any, **named: Any) -> None:  # noqa: ANN401 (of aiohttp)
        """Keep the connection: it is a WebSocket from here on."""
        super().set_parser(*parts, **named)
        self._limit.mark_stream(self._own_transport)

    def handle_error(self, *parts: Any, **named: Any) -> web.StreamResponse:  # noqa: ANN401
        """Return the response to a request that is not valid, or that failed."""
        response = super().handle_error(*parts, **named)
        response.headers.update(SECURITY_HEADERS)
        return response


async def _listen(
    runner: web.AppRunner, limit: ConnectionLimit, host: str, port: int
) -> asyncio.Server:
    application = runner.server
    if application is None:
        raise RuntimeError("the application is not set up")
    try:
        return await asyncio.get_running_loop().create_server(
            lambda: _LimitedConnection(application, limit), host, port, backlog=BACKLOG
        )
    except (OSError, OverflowError) as cause:
        raise listen_error(host, port, cause) from cause


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
