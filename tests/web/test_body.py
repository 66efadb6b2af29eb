import asyncio
from types import SimpleNamespace

import msgspec
import pytest
from aiohttp import web

from holdfast.web import body
from holdfast.web.body import BodyReader


class Pair(msgspec.Struct, forbid_unknown_fields=True):
    a: int = 0
    any: object = None


class Chunks:
    """Content of a request that arrives in pieces, and may stop to arrive."""

    def __init__(self, *pieces, stalls=False):
        self.pieces = pieces
        self.stalls = stalls

    async def iter_any(self):
        for piece in self.pieces:
            yield piece
        if self.stalls:
            await asyncio.Event().wait()


def read(reader, *pieces, length=None, stalls=False):
    request = SimpleNamespace(
        path="/x", content_length=length, content=Chunks(*pieces, stalls=stalls)
    )
    return reader.read(request, Pair)


def refused(work):
    with pytest.raises(web.HTTPException) as found:
        asyncio.run(work)
    return found.value.status, msgspec.json.decode(found.value.text)["error"]


def test_a_document_in_pieces():
    assert asyncio.run(read(BodyReader(100, 100), b'{"a', b'": 3}')) == Pair(3)
    assert asyncio.run(read(BodyReader(100, 100))) == Pair(0)


@pytest.mark.parametrize(
    ("kind", "status"), [(web.HTTPBadRequest, 400), (web.HTTPUnprocessableEntity, 422)]
)
@pytest.mark.parametrize(
    "data", [b"{", b"\xff", b'{"any": "\xff"}', b"[" * 100_000, b"[]", b'{"a": "x"}', b'{"b": 1}']
)
def test_a_body_that_is_no_document_of_its_schema(kind, status, data):
    found, text = refused(read(BodyReader(10**6, 10**6, kind), data))
    assert found == status
    assert text.startswith("/x: ")
    assert "\n" not in text


@pytest.mark.parametrize("data", [b'{"any": ' + b"[" * 100_000, b'{"any": ' + b'{"a":' * 50_000])
def test_a_document_that_is_nested_too_deeply(data):
    found = refused(read(BodyReader(10**6, 10**6, web.HTTPUnprocessableEntity), data))
    assert found == (400, "/x: the document is nested too deeply")


def test_a_body_that_is_too_large():
    text = "/x: a body of at most 10 bytes expected"
    assert refused(read(BodyReader(10, 100), length=11)) == (413, text)
    assert refused(read(BodyReader(10, 100), b"123456", b"123456")) == (413, text)


def test_bodies_that_never_end_share_a_bound(monkeypatch):
    monkeypatch.setattr(body, "BODY_TIMEOUT", 0.05)
    reader = BodyReader(100, 100)

    async def work():
        held = asyncio.ensure_future(read(reader, b" " * 80, stalls=True))
        await asyncio.sleep(0.001)
        with pytest.raises(web.HTTPServiceUnavailable):
            await read(reader, b" " * 30)
        assert await read(reader, b'{"a": 1}') == Pair(1)
        with pytest.raises(web.HTTPRequestTimeout):
            await held
        return await read(reader, b'{"a": 3}' + b" " * 80)

    assert asyncio.run(work()) == Pair(3)
