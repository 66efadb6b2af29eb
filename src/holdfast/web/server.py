"""Serving a web application until somebody has enough."""

import asyncio
import signal
from collections.abc import Callable
from contextlib import suppress

from aiohttp import web

from holdfast.errors import OutputError

LOOK_EVERY = 0.2
"""How often it is asked whether all is over [s]."""
SHUTDOWN = 1.0
"""How long readers have to leave [s]."""


def run_server(
    app: web.Application,
    host: str,
    port: int,
    tell: Callable[[str], None],
    over: Callable[[], bool] = lambda: False,
) -> None:
    """Serves until Ctrl-C, SIGTERM or SIGHUP, and then ends in order.

    Args:
        app: what is served.
        host: address to listen at.
        port: 0 for any that is free.
        tell: is given the address of the page once it can be opened.
        over: whether there is nothing to serve any more; asked a few times a second.

    Raises:
        OutputError: the address cannot be listened at.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(app, host, port, tell, over))


async def _serve(
    app: web.Application,
    host: str,
    port: int,
    tell: Callable[[str], None],
    over: Callable[[], bool],
) -> None:
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN)
    await runner.setup()
    try:
        await _listen(runner, host, port)
        tell(_address(runner, host))
        stopped = asyncio.Event()
        _end_by_signal(stopped)
        while not stopped.is_set() and not over():
            with suppress(TimeoutError):
                await asyncio.wait_for(stopped.wait(), LOOK_EVERY)
    finally:
        await runner.cleanup()


def _end_by_signal(stopped: asyncio.Event) -> None:
    """SIGTERM, and a terminal that goes away unless that is ignored, end it; so does Ctrl-C."""
    loop = asyncio.get_running_loop()
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            with suppress(NotImplementedError):  # Windows knows no handlers here
                loop.add_signal_handler(number, stopped.set)


async def _listen(runner: web.AppRunner, host: str, port: int) -> None:
    try:
        await web.TCPSite(runner, host, port).start()
    except (OSError, OverflowError) as cause:
        raise OutputError(
            f"cannot listen at {host}:{port} ({_reason(cause)}); --port 0 finds a free port"
        ) from cause


def _reason(cause: Exception) -> str:
    text = getattr(cause, "strerror", None) or str(cause)
    return "it is in use" if "in use" in text else text


def _address(runner: web.AppRunner, host: str) -> str:
    port = runner.addresses[0][1]
    shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
    return f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"
