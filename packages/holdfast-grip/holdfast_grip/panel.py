"""Panel of `holdfast serve`: the loop of a hand, with its emergency stop."""

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from aiohttp import web

from holdfast.errors import HoldfastError
from holdfast_grip.documents import GripDocument
from holdfast_grip.loop.live_grip import EventLog, GripListener, LiveGrip
from holdfast_grip.options import (
    NO_HAND,
    GripSettings,
    check_armed,
    connect_hand,
    find_source_and_hand,
    open_loop,
)

if TYPE_CHECKING:
    from holdfast.devices.sources import Source
    from holdfast.live.session import Session
    from holdfast_grip.hands import HandDevice
    from holdfast_grip.loop.watchdog import Watchdog

ANSWER_TIMEOUT = 1.0
"""Longest wait for the loop after a request [s]."""


class GripPanel:
    """Document and routes of a loop. A stop waits for nothing: no socket, no other request.

    Args:
        grip: the loop.
    """

    name = "grip"
    folder = Path(str(resources.files("holdfast_grip") / "page"))
    document_type = GripDocument

    def __init__(self, grip: LiveGrip) -> None:
        self._grip = grip
        self._report: Callable[[str], None] = lambda _: None

    def document(self) -> GripDocument:
        """Return the state and the newest command."""
        return self._grip.document()

    def summary(self) -> str:
        """Return the state in a line."""
        grip = self._grip.document()
        armed = "armed" if grip.armed else "dry run"
        return f"grip {grip.state} ({grip.law}, {grip.hand}, {armed})"

    def add_listener(self, listener: GripListener) -> None:
        """Call `listener` with every event from now on."""
        self._grip.add_listener(listener)

    def routes(self, report: Callable[[str], None]) -> list[web.AbstractRouteDef]:
        """Return the routes."""
        self._report = report
        return [
            web.get("/api/v1/grip", self._get),
            web.post("/api/v1/grip/stop", self._post_stop),
            web.post("/api/v1/grip/reset", self._post_reset),
        ]

    async def _get(self, _: web.Request) -> web.Response:
        return self._answer()

    async def _post_stop(self, request: web.Request) -> web.Response:
        # Before the report, so that nothing delays it.
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


class HandOpener:
    """Opens the loop of a hand.

    Args:
        settings: of the hand.
        source: path or URI of the source.
        speed: of a recording or the twin.
        loop: whether a recording starts again at its end.

    Raises:
        ValueError: the settings contradict each other.
    """

    def __init__(self, settings: GripSettings, source: str, *, speed: float, loop: bool) -> None:
        settings.check()
        self._settings, self._uri = settings, source
        self._speed, self._loops = speed, loop
        self._hand: HandDevice
        self._watchdog: Watchdog | None = None

    def source(self) -> "Source":
        """Return the source: the same object as the hand if both are the twin.

        Raises:
            ValueError: the hand was not confirmed, or a URI is not valid.
        """
        source, self._hand = find_source_and_hand(
            self._uri, self._settings.hand, speed=self._speed, loop=self._loops
        )
        check_armed(self._settings)
        return source

    def connect(self, stack: ExitStack) -> None:
        """Connect to the hand and start its watchdog, before any sample waits."""
        self._watchdog = connect_hand(stack, self._settings, self._hand)

    @contextmanager
    def open(self, session: "Session") -> Iterator[GripPanel]:
        """Run the loop in a thread. Without `--armed` nothing is sent."""
        log = EventLog()
        with (
            open_loop(self._settings, self._hand, session.stream, self._watchdog, log) as loop,
            LiveGrip(self._settings.law, loop, session, log) as grip,
        ):
            yield GripPanel(grip)


class HandPanel:
    """Options of `holdfast serve` for a hand."""

    OPTIONS = NO_HAND
    panel = HandOpener
