"""Bodies of requests: JSON documents, with bounds on their size and time."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import msgspec
from aiohttp import web

BODY_TIMEOUT = 60.0
"""Time within which the body of a request must arrive [s]."""
MAX_BODY_ERROR_LENGTH = 300
"""Longest description of an error of a document [characters]."""

T = TypeVar("T")


class BodyReader:
    """Reader of the JSON bodies of requests.

    Bodies that have not arrived completely are kept in memory. Their sum is limited too: if many
    clients send large bodies at a time, some of them get the status 503.

    Args:
        max_bytes: size of the largest body [bytes].
        max_total_bytes: largest sum of all bodies that are being read [bytes].
        invalid_error: response to a body that is no JSON document of its schema.
    """

    def __init__(
        self,
        max_bytes: int,
        max_total_bytes: int,
        invalid_error: type[web.HTTPException] = web.HTTPBadRequest,
    ) -> None:
        self._max_bytes = max_bytes
        self._max_total_bytes = max_total_bytes
        self._invalid_error = invalid_error
        self._n_bytes = 0

    async def read(self, request: web.Request, kind: type[T]) -> T:
        """Return the JSON document of a request; an empty body is an empty object.

        Raises:
            HTTPException: it does not arrive in time, is too large, or is no document of `kind`.
        """
        data = await self._bytes(request) or b"{}"
        try:
            return msgspec.json.decode(data, type=kind)
        except (msgspec.DecodeError, UnicodeError) as cause:
            raise json_error(self._invalid_error, f"{request.path}: {cause}") from cause
        except RecursionError as cause:
            text = f"{request.path}: the document is nested too deeply"
            raise json_error(web.HTTPBadRequest, text) from cause

    async def _bytes(self, request: web.Request) -> bytes:
        # By its stated length first, so that nothing is read of a body that is too large; a body
        # without one is checked as it arrives.
        data = bytearray()
        self._check(request, request.content_length or 0)
        try:
            async with asyncio.timeout(BODY_TIMEOUT):
                async for chunk in request.content.iter_any():
                    # What has arrived, not what was announced: that costs a client nothing.
                    self._n_bytes += len(chunk)
                    data += chunk
                    self._check(request, len(data))
        except TimeoutError as cause:
            text = f"{request.path}: a body within {BODY_TIMEOUT:g} s expected"
            raise json_error(web.HTTPRequestTimeout, text) from cause
        finally:
            self._n_bytes -= len(data)
        return bytes(data)

    def _check(self, request: web.Request, n_bytes: int) -> None:
        if n_bytes > self._max_bytes:
            too_large = partial(web.HTTPRequestEntityTooLarge, self._max_bytes, n_bytes)
            text = f"{request.path}: a body of at most {self._max_bytes} bytes expected"
            raise json_error(too_large, text)
        if self._n_bytes > self._max_total_bytes:
            text = f"{request.path}: too many large requests at a time; try again"
            raise json_error(web.HTTPServiceUnavailable, text)


def json_error(kind: Callable[..., web.HTTPException], text: str) -> web.HTTPException:
    """Return an exception whose response is `{"error": text}`, on one line."""
    line = " ".join(text.split())[:MAX_BODY_ERROR_LENGTH]
    return kind(text=msgspec.json.encode({"error": line}).decode(), content_type="application/json")
