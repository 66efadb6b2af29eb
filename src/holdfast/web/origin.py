"""Checks of host names and origins, the same for every server of holdfast."""

from ipaddress import ip_address


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
    if only_local and not is_local(_without_port(host)):
        return f"host {host!r} refused: this machine expected"
    if origin is not None and origin.partition("://")[2] != host:
        return f"origin {origin!r} refused: {host!r} expected"
    return None


def _without_port(host: str) -> str:
    """Return a host without its port."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]
