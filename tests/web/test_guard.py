import asyncio

import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from holdfast.web.guard import Guard


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org", "localhost.evil"])
def test_other_hosts_need_a_token(host):
    with pytest.raises(ValueError, match=f"--host {host}"):
        Guard(host)
    Guard(host, "long secret")


@pytest.mark.parametrize("token", [" ", "7 bytes"])
def test_an_empty_or_short_token_is_refused(token):
    with pytest.raises(ValueError, match="--token"):
        Guard("127.0.0.1", token)


def guarded(token="long secret"):
    async def answer(_):
        return web.Response(text="here")

    app = web.Application(middlewares=[Guard("127.0.0.1", token).middleware])
    app.router.add_get("/{any:.*}", answer)
    return app


@pytest.mark.parametrize(
    ("path", "status"), [("/", 200), ("/page/a.js", 200), ("/api/x", 401), ("/media/0/0", 401)]
)
def test_which_paths_need_the_token(path, status):
    async def work():
        async with TestClient(TestServer(guarded())) as client:
            found = []
            for query in ("", "?token=long+secret"):
                async with client.get(path + query) as one:
                    found.append(one.status)
            return found

    assert asyncio.run(work()) == [status, 200]


@pytest.mark.parametrize(
    "given", [b"s\xc3\xa9cret-long", b"\xff\xfe", b"long secre\xe9", b"\xed\xa0\x80"]
)
def test_a_token_that_is_not_ascii_is_wrong_and_no_failure(given):
    async def work():
        async with TestServer(guarded()) as server:
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            head = b"GET /api/x HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer "
            writer.write(head + given + b"\r\n\r\n")
            found = await reader.readuntil(b"\r\n\r\n")
            writer.close()
            return found

    found = asyncio.run(work())
    assert found.startswith(b"HTTP/1.1 401")
    assert b"X-Content-Type-Options: nosniff" in found


def test_the_token_itself_may_be_any_text():
    async def work():
        async with (
            TestClient(TestServer(guarded("s\u00e9cret-long"))) as client,
            client.get("/api/x", params={"token": "s\u00e9cret-long"}) as one,
        ):
            return one.status

    assert asyncio.run(work()) == 200
