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
from holdfast.web.body import BodyReader, json_error
from holdfast.web.guard import Guard

LIVE_DOCUMENT_RATE = 20.0
"""Number of live documents per second [Hz]."""
MAX_QUEUED_DOCUMENTS = {"live": 32, "estimates": 1024}
"""Maximum number of documents that wait for a slow client: more than a second. The oldest is
dropped first."""
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


class WebSocketClient:
    """One WebSocket with a queue of documents, so that a slow client delays no other.

    Args:
        socket: that is connected.
        max_queued: maximum number of documents in the queue.
        address: of the client.
    """

    def __init__(
        self, socket: web.WebSocketResponse, max_queued: int, address: str | None = None
    ) -> None:
        self._socket = socket
        self.address = address
        self._queue: asyncio.Queue[str] = asyncio.Queue(max_queued)

    def put(self, text: str) -> None:
        """Append a document to the queue; drop the oldest if the queue is full."""
        # The oldest goes: for a page and for control, the newest state counts.
        if self._queue.full():
            self._queue.get_nowait()
        self._queue.put_nowait(text)

    async def run(self) -> None:
        """Send documents until the client disconnects."""
        # Reading is needed too: it answers pings, and ends when the client disconnects.
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
            await self._socket.send_str(await self._queue.get())


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
        self._clients: dict[str, set[WebSocketClient]] = {"live": set(), "estimates": set()}
        self._newest_document = b"{}"  # for GET, made for the WebSockets anyway
        self._bodies = BodyReader(MAX_BODY_BYTES, MAX_WEBSOCKETS * MAX_BODY_BYTES)
        self.app = web.Application(middlewares=[guard.middleware])
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

        def put(update: StreamUpdate) -> None:
            self._status.put(update)
            if self._clients["estimates"]:
                with suppress(RuntimeError):  # the service has ended before the session
                    loop.call_soon_threadsafe(self._send_estimates, update)

        self._session.add_listener(put)
        sending = asyncio.ensure_future(self._send_live())
        yield
        sending.cancel()
        with suppress(asyncio.CancelledError):
            await sending
        self._session.remove_listener(put)
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
            for client in self._clients["live"]:
                client.put(self._newest_document.decode())

    def _send_estimates(self, update: StreamUpdate) -> None:
        for estimate, updated in update.estimates:
            fingers = {name: finger_document(estimate.fingers[name]) for name in updated}
            document = schema.EstimateDocument(
                time=estimate.time, hand=estimate.state, fingers=fingers
            )
            text = _encode(document).decode()
            for client in self._clients["estimates"]:
                client.put(text)

    async def _serve_socket(self, request: web.Request, kind: str) -> web.WebSocketResponse:
        # The total first: with it full, the address does not matter.
        if sum(map(len, self._clients.values())) >= MAX_WEBSOCKETS:
            text = f"{MAX_WEBSOCKETS} WebSockets are open; close one of them"
            raise json_error(web.HTTPServiceUnavailable, text)
        n_own = sum(
            client.address == request.remote for each in self._clients.values() for client in each
        )
        if n_own >= MAX_WEBSOCKETS_PER_ADDRESS:
            text = f"{n_own} WebSockets of {request.remote} are open; close one of them"
            raise json_error(web.HTTPServiceUnavailable, text)
        socket = web.WebSocketResponse(
            heartbeat=HEARTBEAT_INTERVAL, compress=False, max_msg_size=1024
        )
        await socket.prepare(request)
        # The constants go first, and only then is the client one of those that get documents.
        client = WebSocketClient(socket, MAX_QUEUED_DOCUMENTS[kind], request.remote)
        client.put(_encode(self._hello()).decode())
        clients = self._clients[kind]
        clients.add(client)
        try:
            await client.run()
        finally:
            clients.discard(client)
        return socket

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
        """Set the threshold of a POST; a DELETE restores that of the model."""
        value: float | None = None
        notice = "threshold of the model restored"
        if request.method == "POST":
            value = (await self._bodies.read(request, _ThresholdRequest)).value
            notice = f"threshold set to {value:.2f}"
        work = partial(self._session.stream.set_threshold, value)
        change = partial(self._session.change, work, "the threshold was not changed")
        answer = await _answer(change)
        if answer.status == HTTPStatus.OK:
            self._status.add_notice(notice)
        return answer

    async def post_recording(self, request: web.Request) -> web.Response:
        """Begin to record."""
        name = (await self._bodies.read(request, _FileRequest)).name
        return await _answer(lambda: {"path": str(self._recorder.start(name))})

    async def delete_recording(self, _: web.Request) -> web.Response:
        """End the recording, and return its progress."""
        return await _answer(lambda: recording_info(self._recorder.stop()))

    async def post_marker(self, request: web.Request) -> web.Response:
        """Add a marker to the recording."""
        text = (await self._bodies.read(request, _MarkerRequest)).text
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
