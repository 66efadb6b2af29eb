"""Access control of the web services: by host, origin and token."""

import hmac
from collections.abc import Awaitable, Callable
from ipaddress import ip_address

from aiohttp import web

SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
"""Headers of every response: the page loads nothing from other servers, and no other page may
embed it."""

TOKEN_PATHS = ("/api/", "/media/")
"""Paths that need the token; the page itself contains no secret."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """Refuse requests with another host name, from another origin, or without the token.

    Args:
        host: address that the service listens at.
        token: secret of every request, as `Authorization: Bearer TOKEN` or `?token=TOKEN`;
            None if no token is needed.

    Raises:
        ValueError: the host can be reached from the network but there is no token, or the
            token is empty.
    """

    def __init__(self, host: str, token: str | None = None) -> None:
        if token is not None and not token.strip():
            raise ValueError("--token: some text expected, none given")
        self._local = is_local(host)
        if not self._local and token is None:
            raise ValueError(
                f"--host {host} opens the service to the network: give --token SECRET as well"
            )
        self._token = token

    @web.middleware
    async def middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Check a request, and add the security headers to its response."""
        self._check(request)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    def _check(self, request: web.Request) -> None:
        if self._local and not is_local(_without_port(request.host)):
            raise web.HTTPForbidden(text=f"host {request.host!r} refused: this machine expected")
        origin = request.headers.get("Origin")
        if origin is not None and origin.partition("://")[2] != request.host:
            raise web.HTTPForbidden(text=f"origin {origin!r} refused: {request.host} expected")
        if request.path.startswith(TOKEN_PATHS) and not self._has_token(request):
            raise web.HTTPUnauthorized(
                text="token expected: Authorization: Bearer TOKEN, or ?token=TOKEN",
                headers={"WWW-Authenticate": "Bearer"},
            )

    def _has_token(self, request: web.Request) -> bool:
        if self._token is None:
            return True
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        given = bearer or request.query.get("token", "")
        return hmac.compare_digest(given.encode(), self._token.encode())


def is_local(host: str) -> bool:
    """Return whether a host name can only be reached from this machine."""
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def _without_port(host: str) -> str:
    """Return a host without its port."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]
