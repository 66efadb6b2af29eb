"""The web service: a page, a WebSocket and REST, beside a session that it never holds up."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import TypeVar

import msgspec
from aiohttp import WSMsgType, web

from holdfast.errors import HoldfastError
from holdfast.live.recordings import SessionRecorder
from holdfast.live.session import Session
from holdfast.live.status import StatusPublisher, finger_of, hello, recording_info
from holdfast.live.stream_detector import StreamUpdate
from holdfast.live.web import schema
from holdfast.model import Model
from holdfast.web.guard import Guard

DOCUMENTS_PER_SECOND = 20.0
"""How often readers are told how things stand [Hz]."""
WAITING = {"live": 32, "estimates": 1024}
"""So many documents wait for a slow reader, a second or more; then it misses the oldest."""
HEARTBEAT = 10.0
"""A reader that does not answer within half of it is let go [s]."""

PAGE = Path(str(resources.files("holdfast.live.web") / "page"))
"""The page's files."""
SHARED = Path(str(resources.files("holdfast.web") / "static"))
"""Files that all pages share."""

T = TypeVar("T")

_encode = msgspec.json.Encoder().encode


class Reader:
    """One WebSocket: documents wait in a short queue, so that a slow one holds nobody up."""

    def __init__(self, socket: web.WebSocketResponse, waiting: int) -> None:
        self._socket = socket
        self._waiting: asyncio.Queue[str] = asyncio.Queue(waiting)

    def put(self, text: str) -> None:
        """Takes a document; the oldest goes where there are too many."""
        if self._waiting.full():
            self._waiting.get_nowait()
        self._waiting.put_nowait(text)

    async def run(self) -> None:
        """Sends until the reader leaves."""
        sending = asyncio.ensure_future(self._send())
        try:
            async for message in self._socket:
                if message.type is WSMsgType.ERROR:
                    break
        finally:
            sending.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sending

    async def _send(self) -> None:
        while True:
            await self._socket.send_str(await self._waiting.get())


class LiveService:
    """The page and the programs that look at a session.

    Args:
        session: that is looked at; the service neither starts nor stops it.
        model: of the session.
        guard: who may come in.
        folder: where recordings go; None where none can be made.
    """

    def __init__(
        self, session: Session, model: Model, guard: Guard, folder: Path | None = None
    ) -> None:
        self._session = session
        self._model = model
        self._recordings = SessionRecorder(session, folder)
        self._feed = StatusPublisher(session)
        self._started = time.time()
        self._readers: dict[str, set[Reader]] = {"live": set(), "estimates": set()}
        self._state = b"{}"
        self.app = web.Application(middlewares=[guard.middleware])
        self.app.add_routes(self._routes())
        self.app.cleanup_ctx.append(self._running)

    def _routes(self) -> list[web.AbstractRouteDef]:
        return [
            web.get("/", _page),
            web.static("/page", PAGE),
            web.static("/web", SHARED),
            web.get("/api/v1/live", self._read_live),
            web.get("/api/v1/estimates", self._read_estimates),
            web.get("/api/v1/info", self._info),
            web.get("/api/v1/state", self._tell),
            web.get("/api/v1/schema", _schema),
            web.post("/api/v1/tare", self._tare),
            web.post("/api/v1/recording", self._record),
            web.delete("/api/v1/recording", self._stop_recording),
            web.post("/api/v1/markers", self._mark),
        ]

    async def _running(self, _: web.Application) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()

        def put(said: StreamUpdate) -> None:
            self._feed.put(said)
            if self._readers["estimates"]:
                with suppress(RuntimeError):  # the service has ended; the session has not
                    loop.call_soon_threadsafe(self._tell_estimates, said)

        self._session.add_listener(put)
        telling = asyncio.ensure_future(self._tell_live())
        yield
        telling.cancel()
        with suppress(asyncio.CancelledError):
            await telling
        self._session.remove_listener(put)
        if self._recordings.current is not None:
            with suppress(HoldfastError):  # its readers have gone; the file tells what it has
                await asyncio.to_thread(self._recordings.end)

    async def _tell_live(self) -> None:
        """Every reader gets the same text, encoded once."""
        while True:
            await asyncio.sleep(1 / DOCUMENTS_PER_SECOND)
            await self._end_failed_recording()
            self._state = _encode(self._feed.live(self._recordings.current))
            for reader in self._readers["live"]:
                reader.put(self._state.decode())

    async def _end_failed_recording(self) -> None:
        """Ends a recording that the disk refuses, and tells of it."""
        recorder = self._recordings.current
        if recorder is not None and recorder.failed:
            try:
                await asyncio.to_thread(self._recordings.end)
            except HoldfastError as failure:
                self._feed.note(f"the recording has ended: {failure}")

    def _tell_estimates(self, said: StreamUpdate) -> None:
        for estimate, fresh in said.estimates:
            fingers = {name: finger_of(estimate.fingers[name]) for name in fresh}
            told = schema.EstimateDocument(time=estimate.time, hand=estimate.state, fingers=fingers)
            text = _encode(told).decode()
            for reader in self._readers["estimates"]:
                reader.put(text)

    async def _read_live(self, request: web.Request) -> web.WebSocketResponse:
        return await self._read(request, "live")

    async def _read_estimates(self, request: web.Request) -> web.WebSocketResponse:
        return await self._read(request, "estimates")

    async def _read(self, request: web.Request, what: str) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(heartbeat=HEARTBEAT, compress=False, max_msg_size=1024)
        await socket.prepare(request)
        reader = Reader(socket, WAITING[what])
        reader.put(_encode(self._hello()).decode())
        readers = self._readers[what]
        readers.add(reader)
        try:
            await reader.run()
        finally:
            readers.discard(reader)
        return socket

    def _hello(self) -> schema.HelloDocument:
        return hello(self._model, self._session, self._started, self._recordings.possible)

    async def _info(self, _: web.Request) -> web.Response:
        return _json(self._hello())

    async def _tell(self, _: web.Request) -> web.Response:
        return web.Response(body=self._state, content_type="application/json")

    async def _tare(self, _: web.Request) -> web.Response:
        return await _done(self._session.restart_tare)

    async def _record(self, request: web.Request) -> web.Response:
        name = (await _body(request, _Recording)).name
        return await _done(lambda: {"path": str(self._recordings.begin(name))})

    async def _stop_recording(self, _: web.Request) -> web.Response:
        return await _done(lambda: recording_info(self._recordings.end()))

    async def _mark(self, request: web.Request) -> web.Response:
        text = (await _body(request, _Marker)).text
        return await _done(lambda: self._recordings.mark(text))


class _Recording(msgspec.Struct, forbid_unknown_fields=True):
    name: str = ""


class _Marker(msgspec.Struct, forbid_unknown_fields=True):
    text: str


async def _done(work: Callable[[], object]) -> web.Response:
    """What `work` gives, from a thread; 409 with its one line where it cannot be done."""
    try:
        return _json(await asyncio.to_thread(work) or {})
    except HoldfastError as refusal:
        return _json({"error": str(refusal)}, status=409)


async def _body(request: web.Request, kind: type[T]) -> T:
    data = await request.read() or b"{}"
    try:
        return msgspec.json.decode(data, type=kind)
    except msgspec.DecodeError as cause:
        text = _encode({"error": f"{request.path}: {cause}"}).decode()
        raise web.HTTPBadRequest(text=text, content_type="application/json") from cause


def _json(value: object, status: int = 200) -> web.Response:
    return web.Response(body=_encode(value), content_type="application/json", status=status)


async def _page(_: web.Request) -> web.FileResponse:
    return web.FileResponse(PAGE / "index.html")


async def _schema(_: web.Request) -> web.Response:
    """JSON Schema of all that the WebSockets tell."""
    told = (schema.HelloDocument, schema.LiveDocument, schema.EstimateDocument)
    schemas, components = msgspec.json.schema_components(told)
    return _json({"anyOf": schemas, "$defs": components})
