import asyncio
from types import SimpleNamespace

import msgspec
import pytest
from aiohttp import web

from holdfast.web import body
from holdfast.web.body import read_body


class Pair(msgspec.Struct, forbid_unknown_fields=True):
    a: int = 0
    any: object = None


def read(data=b"", kind=web.HTTPBadRequest, limit=10**6):
    async def body():
        if len(data) > limit:
            raise web.HTTPRequestEntityTooLarge(limit, len(data))
        return data

    request = SimpleNamespace(path="/x", client_max_size=limit, read=body)
    return read_body(request, Pair, kind)


def refused(work):
    with pytest.raises(web.HTTPException) as found:
        asyncio.run(work)
    return found.value.status, msgspec.json.decode(found.value.text)["error"]


def test_a_document():
    assert asyncio.run(read(b'{"a": 3}')) == Pair(3)
    assert asyncio.run(read()) == Pair(0)


@pytest.mark.parametrize(
    ("kind", "status"), [(web.HTTPBadRequest, 400), (web.HTTPUnprocessableEntity, 422)]
)
@pytest.mark.parametrize(
    "data", [b"{", b"\xff", b'{"any": "\xff"}', b"[" * 100_000, b"[]", b'{"a": "x"}', b'{"b": 1}']
)
def test_a_body_that_is_no_document_of_its_schema(kind, status, data):
    found, text = refused(read(data, kind))
    assert found == status
    assert text.startswith("/x: ")
    assert "\n" not in text


@pytest.mark.parametrize("data", [b'{"any": ' + b"[" * 100_000, b'{"any": ' + b'{"a":' * 50_000])
def test_a_document_that_is_nested_too_deeply(data):
    found = refused(read(data, web.HTTPUnprocessableEntity))
    assert found == (400, "/x: the document is nested too deeply")


def test_a_body_that_is_too_large():
    text = "/x: a body of at most 10 bytes expected"
    assert refused(read(b" " * 11, limit=10)) == (413, text)


def test_a_body_that_does_not_arrive(monkeypatch):
    monkeypatch.setattr(body, "BODY_TIMEOUT", 0.05)
    request = SimpleNamespace(path="/x", read=asyncio.Event().wait)
    assert refused(read_body(request, Pair))[0] == 408
