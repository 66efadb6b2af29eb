import asyncio
import os
import signal
import socket
import threading
import time
import urllib.request
from contextlib import asynccontextmanager

import pytest
from aiohttp import web

from holdfast.errors import OutputError
from holdfast.web import server
from holdfast.web.guard import SECURITY_HEADERS, Guard
from holdfast.web.server import open_browser, run_server


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
        threading.Thread(target=send_once_handled).start()

    default = signal.getsignal(number)

    def send_once_handled():
        while signal.getsignal(number) is default:
            time.sleep(0.01)
        os.kill(os.getpid(), number)

    run_server(app(), "127.0.0.1", 0, announce)
    assert urls[0].startswith("http://127.0.0.1:")


def test_a_port_in_use():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(OutputError, match=f"{port} .*--port 0"):
            run_server(app(), "127.0.0.1", port, print)


@pytest.mark.parametrize("port", [70000, -1])
def test_an_invalid_port(port):
    with pytest.raises(OutputError, match=r"127\.0\.0\.1:"):
        run_server(app(), "127.0.0.1", port, print)


@asynccontextmanager
async def opened(application):
    """A function that opens a raw connection to a server."""
    async with server.listening(application, "127.0.0.1", 0) as url:
        port = int(url.rstrip("/").rpartition(":")[2])

        async def connect(data=b""):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(data)
            held.append(writer)
            return reader, writer

        held = []
        try:
            yield connect
        finally:
            for writer in held:
                writer.close()


async def rest(reader):
    """What a server sends until it closes the connection."""
    try:
        return await reader.read()
    except ConnectionResetError:
        return b""


def run(work):
    return asyncio.run(asyncio.wait_for(work, 30))


@pytest.mark.parametrize(
    "data", [b"", b"GET / HTTP/1.1\r\nHost: x\r\n", b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"]
)
def test_connections_without_a_complete_request_are_closed(monkeypatch, data):
    monkeypatch.setattr(server, "HEADER_TIMEOUT", 0.05)

    async def work():
        async with opened(app()) as connect:
            reader, _ = await connect(data)
            return await rest(reader)

    assert (b"hello" in run(work())) == data.endswith(b"\r\n\r\n")


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /none HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n", b"404"),
        (b"GET / HTTP/1.1\r\nHost: evil\r\n\r\n", b"403"),
    ],
)
def test_errors_have_the_security_headers(request_, status):
    application = app()
    application.middlewares.append(Guard("127.0.0.1").middleware)

    async def work():
        async with opened(application) as connect:
            reader, _ = await connect(request_)
            return await reader.readuntil(b"\r\n\r\n")

    head = run(work())
    assert head.split()[1] == status
    for name, value in SECURITY_HEADERS.items():
        assert f"{name}: {value}".encode() in head


def test_no_text_browser_is_opened(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("holdfast.web.server.sys.platform", "linux")
    assert open_browser("http://127.0.0.1:1/") is False
