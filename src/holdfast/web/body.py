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


async def read_body(
    request: web.Request,
    kind: type[T],
    invalid_error: type[web.HTTPException] = web.HTTPBadRequest,
) -> T:
    """Return the JSON document of a request; an empty body is an empty object.

    Args:
        request: of an application, whose `client_max_size` limits the body.
        kind: schema of the document.
        invalid_error: response to a body that is no JSON document of its schema.

    Raises:
        HTTPException: it does not arrive in time, is too large, or is no document of `kind`.
    """
    try:
        async with asyncio.timeout(BODY_TIMEOUT):
            data = await request.read() or b"{}"
        return msgspec.json.decode(data, type=kind)
    except TimeoutError as cause:
        text = f"{request.path}: a body within {BODY_TIMEOUT:g} s expected"
        raise json_error(web.HTTPRequestTimeout, text) from cause
    except web.HTTPRequestEntityTooLarge as cause:
        most = request.client_max_size
        text = f"{request.path}: a body of at most {most} bytes expected"
        too_large = partial(web.HTTPRequestEntityTooLarge, most, most)
        raise json_error(too_large, text) from cause
    except (msgspec.DecodeError, UnicodeError) as cause:
        raise json_error(invalid_error, f"{request.path}: {cause}") from cause
    except RecursionError as cause:
        text = f"{request.path}: the document is nested too deeply"
        raise json_error(web.HTTPBadRequest, text) from cause


def json_error(kind: Callable[..., web.HTTPException], text: str) -> web.HTTPException:
    """Return an exception whose response is `{"error": text}`, on one line."""
    line = " ".join(text.split())[:MAX_BODY_ERROR_LENGTH]
    return kind(text=msgspec.json.encode({"error": line}).decode(), content_type="application/json")
