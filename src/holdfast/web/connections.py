"""Connections of a server: their limits, so that no client blocks the others, and their origin."""

import asyncio
import logging
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import IntEnum
from ipaddress import ip_address
from typing import Any

MAX_CONNECTIONS = 256
"""Maximum number of connections of a server."""
MAX_CONNECTIONS_PER_ADDRESS = 128
"""Maximum number of connections from one network address."""
MIN_CONNECTIONS = 8
"""Number of connections even if the process may open few files."""
RESERVED_DESCRIPTORS = 64
"""File descriptors that are kept for everything but connections: the sensor, files, the log."""
HEADER_TIMEOUT = 10.0
"""Time within which the header of a request must arrive, and after which a connection without a
request is closed [s]."""
BACKLOG = 32
"""Connections that the system accepts before the server does."""
LOG_INTERVAL = 10.0
"""Minimum time between two log lines of the same location in the code [s]."""

_HOST = re.compile(r"(\[(?P<ipv6>[0-9A-Fa-f:.]+)]|(?P<name>[^]\s:/?#@[]*))(:[0-9]{1,5})?")
"""Header `Host` of a request (RFC 3986, 3.2.2), without the forms that browsers do not send."""

LOGGER = logging.getLogger("holdfast.web")


class Use(IntEnum):
    """Use of a connection; those with the lowest one are closed first."""

    IDLE = 0
    REQUEST = 1
    STREAM = 2


@dataclass(eq=False)
class _Connection:
    address: str
    use: Use = Use.IDLE


class ConnectionLimit:
    """Limit of the number of connections, in all and by network address.

    A new connection that exceeds the limit replaces another one: the oldest that waits for a
    request, or else the oldest with a request in progress. Streams are not replaced; if there
    are only streams, the new connection is refused. So connections that a client only holds
    open never block another client.

    Args:
        max_total: maximum number of connections.
        max_per_address: maximum number of connections from one network address.
    """

    def __init__(
        self, max_total: int = MAX_CONNECTIONS, max_per_address: int = MAX_CONNECTIONS_PER_ADDRESS
    ) -> None:
        self._max_total = max_total
        self._max_per_address = max_per_address
        self._open: dict[asyncio.BaseTransport, _Connection] = {}

    @classmethod
    def of_process(cls) -> "ConnectionLimit":
        """Return limits that leave the process enough file descriptors."""
        total = min(MAX_CONNECTIONS, (max_descriptors() - RESERVED_DESCRIPTORS) // 2)
        total = max(total, MIN_CONNECTIONS)
        return cls(total, min(MAX_CONNECTIONS_PER_ADDRESS, max(total // 2, MIN_CONNECTIONS)))

    def __len__(self) -> int:
        """Return the number of connections."""
        return len(self._open)

    def add(self, transport: asyncio.BaseTransport) -> None:
        """Add a new connection, and close another one if there are too many."""
        peer = transport.get_extra_info("peername")
        address = str(peer[0]) if isinstance(peer, tuple) else ""
        self._open[transport] = _Connection(address)
        same = [one for one, known in self._open.items() if known.address == address]
        # The limit of an address first: one client then loses its own connections, not others'.
        if len(same) > self._max_per_address:
            self._replace(same)
        elif len(self._open) > self._max_total:
            self._replace(list(self._open))

    def remove(self, transport: asyncio.BaseTransport | None) -> None:
        """Remove a connection that is closed. It has no effect on one that is not known."""
        if transport is not None:
            self._open.pop(transport, None)

    def mark_stream(self, transport: asyncio.BaseTransport | None) -> None:
        """Keep a connection: its client receives a stream."""
        if transport in self._open:
            self._open[transport].use = Use.STREAM

    @contextmanager
    def request(self, transport: asyncio.BaseTransport | None) -> Iterator[None]:
        """Mark a connection as in use by a request."""
        known = self._open.get(transport) if transport is not None else None
        if known is None:
            yield
            return
        known.use = Use.REQUEST
        try:
            yield
        finally:
            known.use = Use.IDLE

    def _replace(self, transports: list[asyncio.BaseTransport]) -> None:
        """Close one of these connections, of which the last is the new one."""
        # Of equal use the oldest: `min` returns the first.
        *others, new = transports
        oldest = min(others, key=lambda one: self._open[one].use, default=new)
        chosen = new if self._open[oldest].use is Use.STREAM else oldest
        self.remove(chosen)
        if isinstance(chosen, asyncio.WriteTransport):
            chosen.abort()


class BriefLog(logging.Filter):
    """Filter that shortens log records to one line, and limits how many there are.

    Each location in the code logs at most once in `LOG_INTERVAL`. With HOLDFAST_DEBUG in the
    environment, records are kept as they are.
    """

    def __init__(self) -> None:
        super().__init__()
        self._logged_at: dict[tuple[str, int], float] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is logged; shorten it to one line."""
        if os.environ.get("HOLDFAST_DEBUG"):
            return True
        location, now = (record.pathname, record.lineno), time.monotonic()
        if now - self._logged_at.get(location, -LOG_INTERVAL) < LOG_INTERVAL:
            return False
        self._logged_at[location] = now
        cause = record.exc_info[1] if record.exc_info else None
        text = record.getMessage() + (f": {cause!r}" if cause else "")
        record.msg, record.args = " ".join(text.split())[:300], ()
        record.exc_info = record.exc_text = None
        return True


LOGGER.addFilter(BriefLog())


def log_exceptions_briefly(loop: asyncio.AbstractEventLoop) -> None:
    """Log unhandled exceptions of an event loop as single lines, and not too often."""

    def log(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        cause = context.get("exception")
        LOGGER.error(
            "%s", context.get("message", ""), exc_info=cause if cause is not None else False
        )

    loop.set_exception_handler(log)


def max_descriptors() -> int:
    """Return how many files the process may open."""
    with suppress(ImportError, OSError, ValueError):  # Windows has no such limit
        from resource import RLIM_INFINITY, RLIMIT_NOFILE, getrlimit

        soft, _ = getrlimit(RLIMIT_NOFILE)
        if soft != RLIM_INFINITY:
            return soft
    return 1 << 16


def is_local(host: str) -> bool:
    """Return whether a host name can only be reached from this machine."""
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def refusal(host: str, origin: str | None, *, only_local: bool) -> str | None:
    """Return why a request is refused, or None if it is accepted.

    Args:
        host: header `Host` of the request, with or without a port.
        origin: header `Origin`: the page that made the request; None if no page made it.
        only_local: whether the server can only be reached from this machine.

    Example:
        >>> refusal("127.0.0.1:8080", "http://127.0.0.1:8080", only_local=True)
        >>> refusal("evil.example", None, only_local=True)
        "host 'evil.example' refused: this machine expected"
    """
    parts = _HOST.fullmatch(host)
    if parts is None:
        return f"host {host!r} refused: NAME, NAME:PORT or [IPv6]:PORT expected"
    # Another name, though it leads here: DNS rebinding.
    if only_local and not is_local(parts["ipv6"] or parts["name"]):
        return f"host {host!r} refused: this machine expected"
    if origin is not None and origin.partition("://")[2] != host:
        return f"origin {origin!r} refused: {host!r} expected"
    return None
