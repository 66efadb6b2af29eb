"""The web service of the label page: recordings to a browser, labels back to the disk."""

import asyncio
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import TypeVar

import msgspec
from aiohttp import web

from holdfast.errors import HoldfastError, OutputError
from holdfast.labelling.answers import doubts, labels_data, listing, opened
from holdfast.labelling.page_schema import Asked, Changes, Given, Proposed, Saved
from holdfast.labelling.shelf import Shelf
from holdfast.labelling.signals import POINTS
from holdfast.labelling.store import ConflictError, ReadOnlyError, labels_from
from holdfast.web.guard import Guard, Handler

MOST_BYTES = 64 << 20
"""Of labels that a page sends at a time."""

PAGE = Path(str(resources.files("holdfast.labelling") / "page"))
"""The page's files."""
SHARED = Path(str(resources.files("holdfast.web") / "static"))
"""Files that all pages share."""

T = TypeVar("T")

_encode = msgspec.json.Encoder().encode


class Service:
    """The label page of a shelf of recordings.

    Args:
        shelf: that is labelled.
        guard: who may come in.
    """

    def __init__(self, shelf: Shelf, guard: Guard) -> None:
        self._shelf = shelf
        self.app = web.Application(
            middlewares=[guard.middleware, _told], client_max_size=MOST_BYTES
        )
        self.app.add_routes(self._routes())

    def _routes(self) -> list[web.AbstractRouteDef]:
        one = r"/api/v1/recordings/{id:\d+}"
        return [
            web.get("/", _page),
            web.static("/page", PAGE),
            web.static("/web", SHARED),
            web.get("/api/v1/recordings", self._list),
            web.get(one, self._open),
            web.get(one + "/signals", self._draw),
            web.get(one + "/changes", self._changes),
            web.put(one + "/labels", self._save),
            web.post(one + "/propose", self._propose),
            web.get(r"/media/{id:\d+}/{index:\d+}", self._video),
        ]

    async def _list(self, _: web.Request) -> web.Response:
        return await _done(lambda: listing(self._shelf))

    async def _open(self, request: web.Request) -> web.Response:
        place = self._place(request)
        return await _done(lambda: opened(self._shelf, place))

    async def _draw(self, request: web.Request) -> web.Response:
        place = self._place(request)
        start, end = _number(request, "start"), _number(request, "end")
        points = _number(request, "points") or POINTS
        return await _done(lambda: self._shelf.signals(place).draw(start, end, points))

    async def _changes(self, request: web.Request) -> web.Response:
        place = self._place(request)
        return await _done(lambda: Changes(self._shelf.changes(place)))

    async def _save(self, request: web.Request) -> web.Response:
        place = self._place(request)
        given = await _body(request, Given)

        def save() -> Saved:
            labels = labels_from(given.labels)
            revision, author, note = given.revision, given.author, given.note
            stored = self._shelf.save(place, labels, revision=revision, author=author, note=note)
            return Saved(stored.revision, stored.time)

        return await _done(save)

    async def _propose(self, request: web.Request) -> web.Response:
        place = self._place(request)
        asked = await _body(request, Asked)

        def propose() -> Proposed:
            rule, found = self._shelf.propose(place, asked.rule, asked.parameters)
            doubted = doubts(self._shelf.stored(place).labels, found)
            return Proposed(rule, labels_data(found), doubted)

        return await _done(propose)

    async def _video(self, request: web.Request) -> web.StreamResponse:
        place, index = self._place(request), int(request.match_info["index"])
        file = await asyncio.to_thread(self._shelf.video, place, index)
        if file is None:
            raise _refusal(web.HTTPNotFound, "there is no such video beside the recording")
        return web.FileResponse(file)

    def _place(self, request: web.Request) -> int:
        place = int(request.match_info["id"])
        if place >= len(self._shelf.paths):
            n = len(self._shelf.paths)
            raise _refusal(web.HTTPNotFound, f"recording {place} asked for; there are {n}, from 0")
        return place


@web.middleware
async def _told(request: web.Request, handler: Handler) -> web.StreamResponse:
    """Failures that are foreseen, as JSON with one line."""
    try:
        return await handler(request)
    except ConflictError as conflict:
        return _json({"error": _line(conflict), "revision": conflict.revision}, 409)
    except ReadOnlyError as refusal:
        return _json({"error": _line(refusal)}, 403)
    except (OutputError, OSError, MemoryError) as failure:
        return _json({"error": _line(failure)}, 500)
    except (HoldfastError, ValueError, TypeError) as refusal:
        return _json({"error": _line(refusal)}, 422)


async def _done(work: Callable[[], object]) -> web.Response:
    """What `work` gives, as JSON; from a thread, so that nobody else waits."""
    return await asyncio.to_thread(lambda: _json(work()))


async def _body(request: web.Request, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(await request.read() or b"{}", type=kind)
    except (msgspec.DecodeError, UnicodeError) as cause:
        raise ValueError(f"{request.path}: {cause}") from cause


def _number(request: web.Request, name: str) -> float | None:
    """A number out of the query, where it is given."""
    text = request.query.get(name)
    if text is None:
        return None
    try:
        return float(text)
    except ValueError as cause:
        raise ValueError(f"{name}: a number expected, {text!r} given") from cause


def _line(failure: BaseException) -> str:
    return " ".join(str(failure).split()) or type(failure).__name__


def _refusal(kind: Callable[..., web.HTTPException], text: str) -> web.HTTPException:
    return kind(text=_encode({"error": text}).decode(), content_type="application/json")


def _json(value: object, status: int = 200) -> web.Response:
    return web.Response(body=_encode(value), content_type="application/json", status=status)


async def _page(_: web.Request) -> web.FileResponse:
    return web.FileResponse(PAGE / "index.html")
