import os
import signal
import socket
import threading
import urllib.request

import pytest
from aiohttp import web

from holdfast.errors import OutputError
from holdfast.web.server import run_server


def app():
    async def hello(_):
        return web.Response(text="hello")

    made = web.Application()
    made.router.add_get("/", hello)
    return made


def test_the_server_runs_until_is_over_returns_true():
    found = []

    def announce(url):
        def ask():
            with urllib.request.urlopen(url) as answer:
                found.append(answer.read())

        threading.Thread(target=ask).start()

    run_server(app(), "127.0.0.1", 0, announce, lambda: bool(found))
    assert found == [b"hello"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_the_server_in_order(number):
    urls = []

    def announce(url):
        urls.append(url)
        threading.Timer(0.1, os.kill, (os.getpid(), number)).start()

    run_server(app(), "127.0.0.1", 0, announce)
    assert urls[0].startswith("http://127.0.0.1:")


def test_a_port_in_use():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        text = rf"^cannot listen at 127\.0\.0\.1:{port} \(it is in use\); --port 0 finds"
        with pytest.raises(OutputError, match=text):
            run_server(app(), "127.0.0.1", port, print)


@pytest.mark.parametrize("port", [70000, -1])
def test_an_invalid_port(port):
    with pytest.raises(OutputError, match=r"^cannot listen at 127\.0\.0\.1:"):
        run_server(app(), "127.0.0.1", port, print)
