"""Access control of the web services: by host, origin and token."""

import hmac
from collections.abc import Awaitable, Callable

from aiohttp import web

from holdfast.web.connections import is_local, refusal

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

MIN_TOKEN_LENGTH = 8
"""Minimum length of a token [characters]; a shorter one could be guessed."""

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Guard:
    """Refuse requests with another host name, from another origin, or without the token.

    Args:
        host: address that the service listens at.
        token: secret of every request, as `Authorization: Bearer TOKEN` or `?token=TOKEN`;
            None if no token is needed.

    Raises:
        ValueError: the host can be reached from the network but there is no token, or the
            token is too short.
    """

    def __init__(self, host: str, token: str | None = None) -> None:
        if token is not None and not token.strip():
            raise ValueError("--token: some text expected, none given")
        if token is not None and len(token) < MIN_TOKEN_LENGTH:
            raise ValueError(
                f"--token: at least {MIN_TOKEN_LENGTH} characters expected, {len(token)} given"
            )
        self._local = is_local(host)
        if not self._local and token is None:
            raise ValueError(
                f"--host {host} opens the service to the network: give --token SECRET as well "
                "(or --token-file FILE, or HOLDFAST_TOKEN in the environment)"
            )
        self._token = token

    @web.middleware
    async def middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Check a request, and add the security headers to its response or error."""
        try:
            # Host and origin first: a page of another site learns nothing about the token.
            why = refusal(request.host, request.headers.get("Origin"), only_local=self._local)
            if why is not None:
                raise web.HTTPForbidden(text=why)
            if request.path.startswith(TOKEN_PATHS) and not self._has_token(request):
                raise web.HTTPUnauthorized(
                    text="token expected: Authorization: Bearer TOKEN, or ?token=TOKEN",
                    headers={"WWW-Authenticate": "Bearer"},
                )
            response = await handler(request)
        except web.HTTPException as error:
            error.headers.update(SECURITY_HEADERS)
            raise
        if not response.prepared:
            response.headers.update(SECURITY_HEADERS)
        return response

    def _has_token(self, request: web.Request) -> bool:
        if self._token is None:
            return True
        bearer = request.headers.get("Authorization", "").removeprefix("Bearer ")
        # A browser sends no header of ours with a video or a WebSocket: they have it in the query.
        token = bearer or request.query.get("token", "")
        return hmac.compare_digest(_bytes(token), _bytes(self._token))


def _bytes(token: str) -> bytes:
    """Return the bytes of a token; a header may contain bytes that are not UTF-8."""
    return token.encode("utf-8", "surrogatepass")
