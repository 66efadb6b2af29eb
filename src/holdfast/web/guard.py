"""Who may talk to the web service: this machine, or who knows the token; no foreign pages."""

import hmac
from collections.abc import Awaitable, Callable
from ipaddress import ip_address

from aiohttp import web

POLICY = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
"""What every answer says: nothing from elsewhere, nothing inside another page."""

GUARDED = ("/api/", "/media/")
"""Where the token is needed; a page itself holds no secret."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """Refuses requests from other origins, by other names, or without the token.

    Args:
        host: that the service is bound to.
        token: that requests must show, as `Authorization: Bearer TOKEN` or `?token=TOKEN`;
            None for none.

    Raises:
        ValueError: another host than this machine without a token, or an empty token.
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
        """Passes on what may pass, and marks the answer."""
        self._check(request)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(POLICY)
        return response

    def _check(self, request: web.Request) -> None:
        if self._local and not is_local(_name(request.host)):
            raise web.HTTPForbidden(text=f"host {request.host!r} refused: this machine expected")
        origin = request.headers.get("Origin")
        if origin is not None and origin.partition("://")[2] != request.host:
            raise web.HTTPForbidden(text=f"origin {origin!r} refused: {request.host} expected")
        if request.path.startswith(GUARDED) and not self._knows_token(request):
            raise web.HTTPUnauthorized(
                text="token expected: Authorization: Bearer TOKEN, or ?token=TOKEN",
                headers={"WWW-Authenticate": "Bearer"},
            )

    def _knows_token(self, request: web.Request) -> bool:
        if self._token is None:
            return True
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        given = bearer or request.query.get("token", "")
        return hmac.compare_digest(given.encode(), self._token.encode())


def is_local(host: str) -> bool:
    """Whether it is a name of this machine that only this machine reaches."""
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def _name(host: str) -> str:
    """A host without its port."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]
