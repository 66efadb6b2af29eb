"""Web service of a session: a page, WebSockets and REST. It never delays the session."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from typing import Annotated

import msgspec
from aiohttp import WSMsgType, web

from holdfast.errors import HoldfastError
from holdfast.live.documents import finger_document
from holdfast.live.recorder import SessionRecorder
from holdfast.live.session import Session
from holdfast.live.status import StatusPublisher, hello_document, recording_info
from holdfast.live.stream_detector import StreamUpdate
from holdfast.live.web import schema
from holdfast.web.body import json_error, read_body
from holdfast.web.guard import Guard

LIVE_DOCUMENT_RATE = 20.0
"""Number of live documents per second [Hz]."""
HEARTBEAT_INTERVAL = 6.0
"""Time between two pings; a client that does not answer within half of it is disconnected [s]."""
MAX_WEBSOCKETS = 64
"""Maximum number of WebSockets at a time."""
MAX_WEBSOCKETS_PER_ADDRESS = 32
"""Limit for one address, so that one client leaves room for the others."""
MAX_BODY_BYTES = 1 << 16
"""Largest body of a request: a name or the text of a marker [bytes]."""

PAGE_FOLDER = Path(str(resources.files("holdfast.live.web") / "page"))
"""Files of the page."""
SHARED_FOLDER = Path(str(resources.files("holdfast.web") / "static"))
"""Files that all pages share."""

_encode = msgspec.json.Encoder().encode


class LiveService:
    """Serve the page and the interfaces of a session.

    Args:
        session: to publish; the service neither starts nor stops it.
        guard: check of every request.
        folder: for recordings; None if the service may not record.
        report: called with the text of each notice about a fault or by the service.

    Attributes:
        app: the web application.
    """

    def __init__(
        self,
        session: Session,
        guard: Guard,
        folder: Path | None = None,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._session = session
        self._recorder = SessionRecorder(session, folder)
        self._status = StatusPublisher(session, report)
        self._started = time.time()
        self._addresses: list[str | None] = []  # of the WebSockets
        # Set at the next document of a kind, and then replaced by a new one. Every client sends by
        # itself what is new to it: a slow one misses documents, and delays no other.
        self._news = {"live": asyncio.Event(), "estimates": asyncio.Event()}
        self._newest_document = b"{}"  # for GET, made for the WebSockets anyway
        self._encoded: tuple[StreamUpdate | None, list[str]] = (None, [])  # once for all clients
        self.app = web.Application(middlewares=[guard.middleware], client_max_size=MAX_BODY_BYTES)
        routes: list[web.AbstractRouteDef] = [
            web.get("/", self.get_page),
            web.static("/page", PAGE_FOLDER),
            web.static("/web", SHARED_FOLDER),
            web.get("/api/v1/live", partial(self._serve_socket, kind="live")),
            web.get("/api/v1/estimates", partial(self._serve_socket, kind="estimates")),
            web.get("/api/v1/info", self.get_info),
            web.get("/api/v1/state", self.get_state),
            web.get("/api/v1/schema", self.get_schema),
            web.post("/api/v1/tare", self.post_tare),
            web.post("/api/v1/threshold", self.set_threshold),
            web.delete("/api/v1/threshold", self.set_threshold),
            web.post("/api/v1/recording", self.post_recording),
            web.delete("/api/v1/recording", self.delete_recording),
            web.post("/api/v1/markers", self.post_marker),
        ]
        self.app.add_routes(routes)
        self.app.cleanup_ctx.append(self._publish)

    async def _publish(self, _: web.Application) -> AsyncIterator[None]:
        """Publish the session while the application runs."""
        loop = asyncio.get_running_loop()

        def wake(_: StreamUpdate) -> None:
            if self._addresses:
                with suppress(RuntimeError):  # the service has ended before the session
                    loop.call_soon_threadsafe(self._announce, "estimates")

        self._session.add_listener(wake)
        sending = asyncio.ensure_future(self._send_live())
        yield
        sending.cancel()
        with suppress(asyncio.CancelledError):
            await sending
        self._session.remove_listener(wake)
        if self._recorder.current is not None:
            with suppress(HoldfastError):  # no client is left; the file contains what was written
                await asyncio.to_thread(self._recorder.stop)

    async def _send_live(self) -> None:
        """Send the live documents; each is encoded once for all clients."""
        while True:
            await asyncio.sleep(1 / LIVE_DOCUMENT_RATE)
            recorder = self._recorder.current
            if recorder is not None and recorder.failed:
                try:
                    await asyncio.to_thread(self._recorder.stop)
                except HoldfastError as failure:
                    self._status.add_notice(f"the recording has ended: {failure}")
            document = self._status.live_document(self._recorder.current)
            self._newest_document = _encode(document)
            self._announce("live")

    def _announce(self, kind: str) -> None:
        news, self._news[kind] = self._news[kind], asyncio.Event()
        news.set()

    async def _live_documents(self) -> AsyncIterator[str]:
        while True:
            await self._news["live"].wait()
            yield self._newest_document.decode()

    async def _estimate_documents(self, n_read: int) -> AsyncIterator[str]:
        while True:
            news = self._news["estimates"]  # before the look: what comes after it sets this one
            updates, n_read = self._session.updates_since(n_read)
            for _, update in updates:
                for text in self._estimate_texts(update):
                    yield text
            if not updates:
                await news.wait()

    def _estimate_texts(self, update: StreamUpdate) -> list[str]:
        if self._encoded[0] is not update:
            documents = [
                schema.EstimateDocument(
                    time=estimate.time,
                    hand=estimate.state,
                    fingers={name: finger_document(estimate.fingers[name]) for name in updated},
                )
                for estimate, updated in update.estimates
            ]
            self._encoded = update, [_encode(document).decode() for document in documents]
        return self._encoded[1]

    async def _serve_socket(self, request: web.Request, kind: str) -> web.WebSocketResponse:
        # The total first: with it full, the address does not matter.
        if len(self._addresses) >= MAX_WEBSOCKETS:
            text = f"{MAX_WEBSOCKETS} WebSockets are open; close one of them"
            raise json_error(web.HTTPServiceUnavailable, text)
        n_own = self._addresses.count(request.remote)
        if n_own >= MAX_WEBSOCKETS_PER_ADDRESS:
            text = f"{n_own} WebSockets of {request.remote} are open; close one of them"
            raise json_error(web.HTTPServiceUnavailable, text)
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_INTERVAL, compress=False, max_msg_size=1024
        )
        await socket.prepare(request)
        documents = (
            self._live_documents()
            if kind == "live"
            else self._estimate_documents(self._session.n_updates)
        )
        self._addresses.append(request.remote)
        sending = asyncio.ensure_future(self._send(socket, documents))
        try:
            # Reading is needed too: it answers pings, and ends when the client disconnects.
            async for message in socket:
                if message.type is WSMsgType.ERROR:
                    break
        finally:
            self._addresses.remove(request.remote)
            sending.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return socket

    async def _send(self, socket: web.WebSocketResponse, documents: AsyncIterator[str]) -> None:
        await socket.send_str(_encode(self._hello()).decode())
        async for text in documents:
            await socket.send_str(text)

    def _hello(self) -> schema.HelloDocument:
        return hello_document(self._session, self._started, self._recorder.enabled)

    async def get_page(self, _: web.Request) -> web.FileResponse:
        """Return the page."""
        return web.FileResponse(PAGE_FOLDER / "index.html")

    async def get_schema(self, _: web.Request) -> web.Response:
        """Return the JSON Schema of all documents of the WebSockets."""
        documents = (schema.HelloDocument, schema.LiveDocument, schema.EstimateDocument)
        schemas, components = msgspec.json.schema_components(documents)
        return _json({"anyOf": schemas, "$defs": components})

    async def get_info(self, _: web.Request) -> web.Response:
        """Return the constants of the session, as the first document of a WebSocket."""
        return _json(self._hello())

    async def get_state(self, _: web.Request) -> web.Response:
        """Return the newest live document."""
        return web.Response(body=self._newest_document, content_type="application/json")

    async def post_tare(self, _: web.Request) -> web.Response:
        """Take a new tare; the hand must be open."""
        session = self._session
        work = partial(session.change, session.stream.restart_tare, "no tare can be taken")
        return await _answer(work)

    async def set_threshold(self, request: web.Request) -> web.Response:
        """Set the threshold of a POST; at a DELETE, restore the threshold of the model."""
        value: float | None = None
        notice = "threshold of the model restored"
        if request.method == "POST":
            value = (await read_body(request, _ThresholdRequest)).value
            notice = f"threshold set to {value:.2f}"
        work = partial(self._session.stream.set_threshold, value)
        change = partial(self._session.change, work, "the threshold was not changed")
        answer = await _answer(change)
        if answer.status == HTTPStatus.OK:
            self._status.add_notice(notice)
        return answer

    async def post_recording(self, request: web.Request) -> web.Response:
        """Begin to record."""
        name = (await read_body(request, _FileRequest)).name
        return await _answer(lambda: {"path": str(self._recorder.start(name))})

    async def delete_recording(self, _: web.Request) -> web.Response:
        """End the recording, and return its progress."""
        return await _answer(lambda: recording_info(self._recorder.stop()))

    async def post_marker(self, request: web.Request) -> web.Response:
        """Add a marker to the recording."""
        text = (await read_body(request, _MarkerRequest)).text
        return await _answer(lambda: self._recorder.add_marker(text))


class _ThresholdRequest(msgspec.Struct, forbid_unknown_fields=True):
    value: Annotated[float, msgspec.Meta(ge=0, le=1)]


class _FileRequest(msgspec.Struct, forbid_unknown_fields=True):
    name: str = ""


class _MarkerRequest(msgspec.Struct, forbid_unknown_fields=True):
    text: str


async def _answer(work: Callable[[], object]) -> web.Response:
    """Run `work` in a thread, and return its result; 409 and the error message if it fails."""
    try:
        return _json(await asyncio.to_thread(work) or {})
    except HoldfastError as refusal:
        return _json({"error": str(refusal)}, status=409)


def _json(value: object, status: int = 200) -> web.Response:
    return web.Response(body=_encode(value), content_type="application/json", status=status)
