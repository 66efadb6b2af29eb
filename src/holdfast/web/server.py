"""Run a web application until it is interrupted."""

import asyncio
import signal
from collections.abc import Callable
from contextlib import suppress

from aiohttp import web

from holdfast.errors import listen_error

POLL_INTERVAL = 0.2
"""Time between two calls of `is_over` [s]."""
SHUTDOWN_TIMEOUT = 1.0
"""Time that clients have to disconnect [s]."""


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
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN_TIMEOUT)
    await runner.setup()
    try:
        await _listen(runner, host, port)
        announce(_address(runner, host))
        stopped = asyncio.Event()
        _stop_by_signal(stopped)
        while not stopped.is_set() and not is_over():
            with suppress(TimeoutError):
                await asyncio.wait_for(stopped.wait(), POLL_INTERVAL)
    finally:
        await runner.cleanup()


def _stop_by_signal(stopped: asyncio.Event) -> None:
    """Set `stopped` on SIGTERM, and on SIGHUP unless the process ignores it."""
    loop = asyncio.get_running_loop()
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            with suppress(NotImplementedError):  # Windows has no signal handlers in event loops
                loop.add_signal_handler(number, stopped.set)


async def _listen(runner: web.AppRunner, host: str, port: int) -> None:
    try:
        await web.TCPSite(runner, host, port).start()
    except (OSError, OverflowError) as cause:
        raise listen_error(host, port, cause) from cause


def _address(runner: web.AppRunner, host: str) -> str:
    port = runner.addresses[0][1]
    shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    return f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"
