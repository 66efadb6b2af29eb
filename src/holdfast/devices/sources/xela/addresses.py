"""Network addresses at which XELA's server may be."""

import socket
from typing import NamedTuple
from urllib.parse import urlsplit

from holdfast.devices.uri import Address

HOST, PORT = "127.0.0.1", 5000
AUTO_HOST = "auto"
"""Host that stands for this machine's own addresses."""
_OUTSIDE_ADDRESS = ("192.0.2.1", 9)
"""Address reserved for documentation; nothing is sent to it."""


class ServerAddress(NamedTuple):
    """A host and a port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def server_addresses(address: Address) -> tuple[ServerAddress, ...]:
    """Return the addresses to try, in order.

    xela_server binds the address of the network card, even if it is configured otherwise.
    Therefore `auto` tries 127.0.0.1, then the address of the default route.

    Raises:
        ValueError: the URI has no valid host and port.

    Example:
        >>> from holdfast.devices.uri import parse
        >>> [str(address) for address in server_addresses(parse("xela://hand.local")[1])]
        ['hand.local:5000']
    """
    expected = f"{address.text}: xela://HOST:PORT or xela://{AUTO_HOST} expected"
    try:
        parts = urlsplit(f"//{address.host}")
        host, port = parts.hostname or HOST, PORT if parts.port is None else parts.port
    except ValueError as cause:
        raise ValueError(f"{expected} ({cause})") from cause
    if address.path not in ("", "/") or "@" in address.host or not port:
        raise ValueError(expected)
    if host != AUTO_HOST:
        return (ServerAddress(host, port),)
    hosts = dict.fromkeys((HOST, own_address()))
    return tuple(ServerAddress(name, port) for name in hosts if name)


def own_address() -> str | None:
    """Return this machine's address on the default route, or None. Send nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_OUTSIDE_ADDRESS)
        except OSError:
            return None
        host: str = probe.getsockname()[0]
        return host
