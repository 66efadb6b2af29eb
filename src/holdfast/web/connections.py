"""Connections of a server: their log, and the origin of a request."""

import asyncio
import logging
import os
import re
import time
from ipaddress import ip_address
from typing import Any

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
