import socket
import threading
import time
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest

from devices.sources.reading import until
from holdfast.devices.sources import base, open_source
from holdfast.devices.sources.xela import client as module
from holdfast.errors import SourceError

from .build import PERIOD, START, WELCOME, counts, patch, sensor, text
from .servers import free_port, server

PATIENCE = 20.0
"""So long a test waits before it fails [s]."""


@pytest.fixture(autouse=True)
def tidy():
    """No thread is left behind."""
    before = set(threading.enumerate())
    yield
    left = [thread for thread in threading.enumerate() if thread not in before]
    for thread in left:
        thread.join(PATIENCE)
    assert not [thread for thread in left if thread.is_alive()]


@pytest.fixture
def quick(monkeypatch):
    """Connects again soon, and finds silence soon."""
    monkeypatch.setattr(base, "MIN_RETRY_DELAY", 0.01)
    monkeypatch.setattr(base, "MAX_RETRY_DELAY", 0.02)
    monkeypatch.setattr(module.XelaSource, "silence_timeout", 0.05)


def says(what):
    return lambda arrival: any(notice.startswith(what) for notice in arrival.notices)


class TestOpening:
    def test_modules_are_known_and_no_packet_is_lost(self):
        packets = [patch(k) for k in range(50)]
        with server([WELCOME, *packets]) as (port, _):
            name = f"xela://127.0.0.1:{port}?fingers=1:thumb"
            with open_source(name) as source:
                assert list(source.sensors) == ["thumb"]
                assert source.metadata == {"source": name, "models": {"1": "uSPa44"}}
                arrivals = until(source, lambda a: a.time == START + 49 * PERIOD)
        assert len(arrivals) == 50
        for k, arrival in enumerate(arrivals):
            np.testing.assert_array_equal(arrival.samples["thumb"], counts(16, k))
            assert arrival.received <= time.monotonic()

    def test_nothing_listens(self):
        port = free_port()
        with pytest.raises(SourceError, match=f":{port}; .*xela://auto; .*`holdfast play`"):
            open_source(f"xela://127.0.0.1:{port}").open()

    @pytest.mark.parametrize("first", [[], [WELCOME]])
    def test_no_samples_come(self, first, monkeypatch):
        monkeypatch.setattr(module, "XELA_OPEN_TIMEOUT", 0.3)
        with server(first) as (port, _), pytest.raises(SourceError, match="no samples"):
            open_source(f"xela://127.0.0.1:{port}").__enter__()

    def test_the_server_closes_the_connection(self):
        with (
            server(broken=True) as (port, _),
            pytest.raises(SourceError, match="closed the connection"),
        ):
            open_source(f"xela://127.0.0.1:{port}").__enter__()


class TestReading:
    def test_garbage_is_refused_and_good_packets_follow(self):
        with server([patch(1)]) as (port, said), open_source(f"xela://127.0.0.1:{port}") as source:
            for packet in ("?", b"\xff\xfe", "[" * 2000, WELCOME, patch(2)):
                said.put(packet)
            arrivals = until(source, lambda a: a.time == START + 2 * PERIOD)
        assert sum(a.n_refused for a in arrivals) == 3
        notices = [notice for a in arrivals for notice in a.notices]
        assert len(notices) == 2
        assert notices[1].startswith("invalid packet: ")


def test_closing_while_packets_wait():
    words = [text(k, [sensor(counts(368, k), "XR23AHRCPP")]) for k in range(20)] * 50
    with server(words) as (port, _), open_source(f"xela://127.0.0.1:{port}") as source:
        assert source.read(PATIENCE) is not None
        time.sleep(0.3)  # the queue fills, and the sockets' buffers
        source.close()
        source.close()


class TestReconnecting:
    def test_a_restarted_server(self, quick):
        port = free_port()
        with ExitStack() as stack:
            with server([patch(k, message=90 + k) for k in range(10)], port=port):
                source = stack.enter_context(open_source(f"xela://127.0.0.1:{port}"))
                arrivals = until(source, lambda a: a.time == START + 9 * PERIOD)
            arrivals += until(source, says("connection lost"))
            assert source.read(0.05) is None
            with server([WELCOME, *(patch(k, message=k) for k in range(20, 30))], port=port):
                arrivals += until(source, lambda a: a.time > START + 28.5 * PERIOD)
        samples = [a for a in arrivals if a.samples]
        assert len(samples) == 20
        assert (np.diff([a.time for a in samples]) > 0).all()
        assert not any(a.n_lost for a in samples)
        source.close()


@contextmanager
def answering(head):
    """The port of a server that answers its first request."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def answer():
            connection, _ = listener.accept()
            with connection:
                connection.recv(1 << 16)
                connection.sendall(f"HTTP/1.1 {head}\r\nContent-Length: 0\r\n\r\n".encode())

        thread = threading.Thread(target=answer)
        thread.start()
        yield listener.getsockname()[1]
        thread.join()


@pytest.mark.parametrize(
    "head", ["404 Not Found", "302 Found\r\nLocation: /b", "302 Found\r\nLocation: ws://{other}/"]
)
def test_another_server_is_no_xela_server_and_redirects_are_not_followed(head):
    with (
        server([patch(1)]) as (other, _),
        answering(head.format(other=f"127.0.0.1:{other}")) as port,
        pytest.raises(SourceError, match=f"127.0.0.1:{port} is no XELA server"),
    ):
        open_source(f"xela://127.0.0.1:{port}").open()
