"""Page of the guided protocol, for a phone beside the robot: large words, a countdown, the keys."""

import asyncio
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from threading import Event, Thread

import msgspec
from aiohttp import web

from holdfast.live.teaching.protocol import View
from holdfast.web.body import BodyReader
from holdfast.web.guard import Guard
from holdfast.web.server import STOP_POLL_INTERVAL, listening

MAX_LINE_BYTES, MAX_LINES = 4096, 256
"""Largest body of a request [bytes], and the number of lines that wait to be read."""

_PACKAGE = resources.files("holdfast")
_FILES = Path(str(_PACKAGE / "live" / "teaching" / "page"))
_SHARED = Path(str(_PACKAGE / "web" / "static"))


class KeyRequest(msgspec.Struct, forbid_unknown_fields=True):
    """Body of `POST /api/v1/markers`: a key, or a marker."""

    text: str


class TeachService:
    """Web application that shows the protocol, and takes its keys.

    Args:
        guard: decides which requests are allowed.
    """

    def __init__(self, guard: Guard) -> None:
        self._document = b"{}"
        self._lines: deque[str] = deque(maxlen=MAX_LINES)  # requests append, `pop` takes out
        self._bodies = BodyReader(MAX_LINE_BYTES, MAX_LINES * MAX_LINE_BYTES)
        self.app = web.Application(middlewares=[guard.middleware])
        self.app.add_routes([
            web.get("/", self._page),
            web.static("/page", _FILES),
            web.static("/web", _SHARED),
            web.get("/api/v1/teach", self._view),
            web.post("/api/v1/markers", self._press),
        ])  # fmt: skip

    def show(self, view: View, place: str) -> None:
        """Show what a person sees now; called in the thread of the protocol."""
        self._document = msgspec.json.encode({**view._asdict(), "place": place})

    def pop(self) -> list[str]:
        """Remove and return the lines that arrived."""
        return [self._lines.popleft() for _ in range(len(self._lines))]

    async def _page(self, _: web.Request) -> web.FileResponse:
        return web.FileResponse(_FILES / "index.html")

    async def _view(self, _: web.Request) -> web.Response:
        return web.Response(body=self._document, content_type="application/json")

    async def _press(self, request: web.Request) -> web.Response:
        self._lines.append((await self._bodies.read(request, KeyRequest)).text)
        return await self._view(request)


@contextmanager
def serving(service: TeachService, host: str, port: int) -> Iterator[str]:
    """Serve the page in a thread while the block runs; yield its address.

    Raises:
        OutputError: the address is in use or cannot be bound.
    """
    url: Future[str] = Future()
    over = Event()

    async def serve() -> None:
        async with listening(service.app, host, port) as address:
            url.set_result(address)
            while not over.is_set():
                await asyncio.sleep(STOP_POLL_INTERVAL)

    def run() -> None:
        try:
            asyncio.run(serve())
        except Exception as failure:
            url.set_exception(failure)

    thread = Thread(target=run, name="holdfast-teach-page", daemon=True)
    thread.start()
    try:
        yield url.result()
    finally:
        over.set()
        thread.join()
