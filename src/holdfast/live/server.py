"""Serving a web application until somebody has enough."""

import asyncio
import signal
from collections.abc import Callable
from contextlib import suppress

from aiohttp import web

from holdfast.errors import OutputError
from holdfast.live.session import Session

LOOK_EVERY = 0.2
"""How often the session is looked after [s]."""
SHUTDOWN = 1.0
"""How long readers have to leave [s]."""


def run_server(
    app: web.Application,
    session: Session,
    host: str,
    port: int,
    tell: Callable[[str], None],
    *,
    stay: bool = True,
) -> None:
    """Serves until Ctrl-C or SIGTERM, and then ends in order.

    Args:
        app: what is served.
        session: behind it.
        host: address to listen at.
        port: 0 for any that is free.
        tell: is given the address of the page once it can be opened.
        stay: go on serving when the session has ended well.

    Raises:
        OutputError: the address cannot be listened at.
        Exception: that which made the session fail.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(app, session, host, port, tell, stay))
    if session.failure is not None:
        raise session.failure


async def _serve(
    app: web.Application,
    session: Session,
    host: str,
    port: int,
    tell: Callable[[str], None],
    stay: bool,
) -> None:
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=SHUTDOWN)
    await runner.setup()
    try:
        await _listen(runner, host, port)
        tell(_address(runner, host))
        stopped = asyncio.Event()
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stopped.set)
        while not stopped.is_set() and (stay or not session.ended):
            if session.failure is not None:
                break
            with suppress(TimeoutError):
                await asyncio.wait_for(stopped.wait(), LOOK_EVERY)
    finally:
        await runner.cleanup()


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
