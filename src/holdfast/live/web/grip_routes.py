"""REST calls of the grip loop: its state, the emergency stop and the reset."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from http import HTTPStatus

import msgspec
from aiohttp import web

from holdfast.errors import HoldfastError
from holdfast.live.loop.live_grip import LiveGrip
from holdfast.web.body import json_error

ANSWER_TIMEOUT = 1.0
"""Longest wait for the loop after a request [s]."""


class GripRoutes:
    """Routes of the grip loop. A stop waits for nothing: no socket, no sample, no other request.

    Args:
        grip: the loop; None if no hand is controlled.
        report: is called with the text of a notice.
    """

    def __init__(self, grip: LiveGrip | None, report: Callable[[str], None]) -> None:
        self._found = grip
        self._report = report

    def routes(self) -> list[web.AbstractRouteDef]:
        """Return the routes."""
        return [
            web.get("/api/v1/grip", self._get),
            web.post("/api/v1/grip/stop", self._post_stop),
            web.post("/api/v1/grip/reset", self._post_reset),
        ]

    @property
    def _grip(self) -> LiveGrip:
        if self._found is None:
            text = "no hand is controlled: start with holdfast serve ... --hand URI"
            raise json_error(web.HTTPNotFound, text)
        return self._found

    async def _get(self, _: web.Request) -> web.Response:
        return self._answer()

    async def _post_stop(self, request: web.Request) -> web.Response:
        stopped = self._grip.stop()
        self._report(f"emergency stop by {request.remote}")
        return await self._wait(
            stopped,
            "the stop is set, but the loop does not answer: use the emergency stop of the hand",
        )

    async def _post_reset(self, request: web.Request) -> web.Response:
        reset = self._grip.reset()
        self._report(f"stop or fault of the grip reset by {request.remote}")
        return await self._wait(reset, "the loop does not answer")

    async def _wait(self, request: "Future[None]", late: str) -> web.Response:
        """Return the state when a request has been carried out; 409 if it was not."""
        try:
            await asyncio.wait_for(asyncio.wrap_future(request), ANSWER_TIMEOUT)
        except TimeoutError:
            return self._answer(late)
        except HoldfastError as failure:
            return self._answer(str(failure))
        return self._answer()

    def _answer(self, error: str = "") -> web.Response:
        value = {"error": error} if error else self._grip.document()
        status = HTTPStatus.CONFLICT if error else HTTPStatus.OK
        body = msgspec.json.encode(value)
        return web.Response(body=body, content_type="application/json", status=status)
