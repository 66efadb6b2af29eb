"""Web service of the labelling page: HTTP requests to the workspace, replies as JSON."""

import asyncio
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import msgspec
from aiohttp import web

from holdfast.errors import HoldfastError, OutputError
from holdfast.labelling.server.documents import (
    ChangePoints,
    ProposeReply,
    ProposeRequest,
    SaveReply,
    SaveRequest,
    describe_recording,
    doubtful_labels,
    labels_data,
    list_recordings,
)
from holdfast.labelling.server.signals import DEFAULT_POINTS
from holdfast.labelling.server.store import ConflictError, ReadOnlyError, parse_labels
from holdfast.labelling.server.workspace import Workspace
from holdfast.web.body import json_error, read_body
from holdfast.web.guard import Guard, Handler

MAX_REQUEST_BYTES = 64 << 20
"""Largest request of a page, which sends all labels of a recording: some 500,000 [bytes]. To save
them takes up to eight times as much memory."""

PAGE = Path(str(resources.files("holdfast.labelling") / "page"))
"""Files of the labelling page."""
SHARED = Path(str(resources.files("holdfast.web") / "static"))
"""Files that all pages share."""

_encode = msgspec.json.Encoder().encode


class LabellingService:
    """Web application that serves the labelling page of a workspace.

    Args:
        workspace: recordings to be labelled.
        guard: decides which requests are allowed.
    """

    def __init__(self, workspace: Workspace, guard: Guard) -> None:
        self._workspace = workspace
        self.app = web.Application(
            middlewares=[guard.middleware, _errors_as_json], client_max_size=MAX_REQUEST_BYTES
        )
        recording = r"/api/v1/recordings/{id:\d+}"
        self.app.add_routes(
            [
                web.get("/", _page),
                web.static("/page", PAGE),
                web.static("/web", SHARED),
                web.get("/api/v1/recordings", self._list),
                web.get(recording, self._open),
                web.get(recording + "/signals", self._signals),
                web.get(recording + "/changes", self._changes),
                web.put(recording + "/labels", self._save),
                web.post(recording + "/propose", self._propose),
                web.get(r"/media/{id:\d+}/{index:\d+}", self._video),
            ]
        )

    async def _list(self, _: web.Request) -> web.Response:
        return await _reply(lambda: list_recordings(self._workspace))

    async def _open(self, request: web.Request) -> web.Response:
        index = self._index(request)
        return await _reply(lambda: describe_recording(self._workspace, index))

    async def _signals(self, request: web.Request) -> web.Response:
        index = self._index(request)
        start, end = _query_number(request, "start"), _query_number(request, "end")
        points = _query_number(request, "points") or DEFAULT_POINTS
        return await _reply(lambda: self._workspace.signals(index).part(start, end, points))

    async def _changes(self, request: web.Request) -> web.Response:
        index = self._index(request)
        return await _reply(lambda: ChangePoints(self._workspace.changes(index)))

    async def _save(self, request: web.Request) -> web.Response:
        index = self._index(request)
        body = await read_body(request, SaveRequest, web.HTTPUnprocessableEntity)

        def save() -> SaveReply:
            stored = self._workspace.save(
                index, parse_labels(body.labels),
                revision=body.revision, author=body.author, note=body.note,
            )  # fmt: skip
            return SaveReply(stored.revision, stored.time)

        return await _reply(save)

    async def _propose(self, request: web.Request) -> web.Response:
        index = self._index(request)
        body = await read_body(request, ProposeRequest, web.HTTPUnprocessableEntity)

        def propose() -> ProposeReply:
            rule, proposals = self._workspace.propose(index, body.rule, body.parameters)
            low = doubtful_labels(self._workspace.stored(index).labels, proposals)
            return ProposeReply(rule, labels_data(proposals), low)

        return await _reply(propose)

    async def _video(self, request: web.Request) -> web.StreamResponse:
        index, video = self._index(request), int(request.match_info["index"])
        file = await asyncio.to_thread(self._workspace.video, index, video)
        if file is None:
            raise json_error(web.HTTPNotFound, "there is no such video beside the recording")
        return web.FileResponse(file)

    def _index(self, request: web.Request) -> int:
        index = int(request.match_info["id"])
        n = len(self._workspace.paths)
        if index >= n:
            raise json_error(web.HTTPNotFound, f"recording 0 to {n - 1} expected, {index} given")
        return index


@web.middleware
async def _errors_as_json(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Reply to expected errors with a status and one line of JSON."""
    try:
        return await handler(request)
    except ConflictError as error:
        return _json({"error": _line(error), "revision": error.revision}, 409)
    except ReadOnlyError as error:
        return _json({"error": _line(error)}, 403)
    except (OutputError, OSError, MemoryError) as error:
        return _json({"error": _line(error)}, 500)
    except (HoldfastError, ValueError, TypeError) as error:
        return _json({"error": _line(error)}, 422)


async def _reply(work: Callable[[], object]) -> web.Response:
    """Run `work` in a thread, so that other requests go on, and return its result as JSON."""
    return await asyncio.to_thread(lambda: _json(work()))


def _query_number(request: web.Request, name: str) -> float | None:
    """Return a number of the query; None if it is missing."""
    text = request.query.get(name)
    if text is None:
        return None
    try:
        return float(text)
    except ValueError as cause:
        raise ValueError(f"{name}: a number expected, {text!r} given") from cause


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _json(value: object, status: int = 200) -> web.Response:
    return web.Response(body=_encode(value), content_type="application/json", status=status)


async def _page(_: web.Request) -> web.FileResponse:
    return web.FileResponse(PAGE / "index.html")
