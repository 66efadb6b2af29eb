import asyncio

import pytest
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from holdfast.web.guard import Guard, is_local


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "::1", "[::1]", "localhost"])
def test_local_host_names(host):
    assert is_local(host)
    Guard(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org", "localhost.evil"])
def test_other_hosts_need_a_token(host):
    assert not is_local(host)
    with pytest.raises(ValueError, match="opens the service to the network: give --token SECRET"):
        Guard(host)
    Guard(host, "secret")


def test_an_empty_token_is_refused():
    with pytest.raises(ValueError, match=r"^--token: some text expected, none given$"):
        Guard("127.0.0.1", " ")


@pytest.mark.parametrize(
    ("path", "status"), [("/", 200), ("/page/a.js", 200), ("/api/x", 401), ("/media/0/0", 401)]
)
def test_which_paths_need_the_token(path, status):
    async def work():
        async def answer(_):
            return web.Response(text="here")

        app = web.Application(middlewares=[Guard("127.0.0.1", "secret").middleware])
        app.router.add_get("/{any:.*}", answer)
        async with TestClient(TestServer(app)) as client:
            found = []
            for query in ("", "?token=secret"):
                async with client.get(path + query) as one:
                    found.append(one.status)
            return found

    assert asyncio.run(work()) == [status, 200]
