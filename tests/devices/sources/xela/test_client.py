import socket
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
import pytest

from holdfast.devices.sources import base, open_source
from holdfast.devices.sources.xela import client as module
from holdfast.errors import SourceError

from .build import NEW, PERIOD, START, WELCOME, counts, patch, sensor, text
from .servers import HANG_UP, free_port, server

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


def until(source, wanted):
    """Arrivals up to the first of which `wanted` is true."""
    arrivals = []
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        arrival = source.read(0.05)
        if arrival is not None:
            arrivals.append(arrival)
            if wanted(arrival):
                return arrivals
    raise AssertionError(f"not among {arrivals}")


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

    def test_notices_about_a_sensor_come_first(self):
        with server([NEW]) as (port, _), open_source(f"xela://127.0.0.1:{port}") as source:
            first = source.read(PATIENCE)
        assert list(first.samples) == ["finger1"]
        assert "uSPa11" in first.notices[0]
        assert source.metadata["server_version"] == "1.8.0b_200801"

    def test_it_can_be_opened_again(self):
        with server([patch(1)]) as (port, _):
            source = open_source(f"xela://127.0.0.1:{port}")
            for _ in range(2):
                with source:
                    assert source.read(PATIENCE).time == START + PERIOD

    def test_nothing_listens(self):
        port = free_port()
        with pytest.raises(SourceError, match=f":{port}; .*xela://auto; .*`holdfast play`"):
            open_source(f"xela://127.0.0.1:{port}").open()

    def test_a_host_that_cannot_be_reached(self, monkeypatch):
        def refuse(*_, **__):
            raise OSError("No route to host")

        monkeypatch.setattr(socket, "create_connection", refuse)
        with pytest.raises(SourceError, match="No route to host"):
            open_source("xela://10.0.0.7").open()

    @pytest.mark.parametrize("first", [[], [WELCOME]])
    def test_no_samples_come(self, first, monkeypatch):
        monkeypatch.setattr(module, "XELA_OPEN_TIMEOUT", 0.3)
        with server(first) as (port, _), pytest.raises(SourceError, match="no samples"):
            open_source(f"xela://127.0.0.1:{port}").__enter__()

    def test_only_invalid_packets_come(self, monkeypatch):
        monkeypatch.setattr(module, "XELA_OPEN_TIMEOUT", 0.3)
        broken = text(1, [sensor(counts(16), data="?")])
        with server([WELCOME, broken]) as (port, _), pytest.raises(SourceError, match="sensor 1"):
            open_source(f"xela://127.0.0.1:{port}").__enter__()

    def test_the_server_closes_the_connection(self):
        with (
            server(broken=True) as (port, _),
            pytest.raises(SourceError, match="closed the connection"),
        ):
            open_source(f"xela://127.0.0.1:{port}").__enter__()

    @pytest.mark.parametrize(
        ("query", "message"),
        [("values=calibrated", "has no calibrated values"), ("fingers=4:ring", "fingers= names 4")],
    )
    def test_it_does_not_fit_the_parameters(self, query, message):
        with server([patch(1)]) as (port, _), pytest.raises(SourceError, match=message):
            open_source(f"xela://127.0.0.1:{port}?{query}").__enter__()


class TestReading:
    def test_nothing_comes(self):
        with server([patch(1)]) as (port, _), open_source(f"xela://127.0.0.1:{port}") as source:
            assert source.read(PATIENCE) is not None
            assert source.read(0.0) is None
            assert source.read(0.01) is None
            assert not source.ended

    def test_garbage_is_refused_and_good_packets_follow(self):
        with server([patch(1)]) as (port, said), open_source(f"xela://127.0.0.1:{port}") as source:
            for packet in ("?", b"\xff\xfe", "[" * 2000, WELCOME, patch(2)):
                said.put(packet)
            arrivals = until(source, lambda a: a.time == START + 2 * PERIOD)
        assert sum(a.n_refused for a in arrivals) == 3
        notices = [notice for a in arrivals for notice in a.notices]
        assert len(notices) == 2
        assert notices[1].startswith("invalid packet: ")

    def test_repeats_are_silence_too(self, quick):
        with server([patch(1)]) as (port, said), open_source(f"xela://127.0.0.1:{port}") as source:
            deadline = time.monotonic() + PATIENCE
            notices = []
            while len(notices) < 2 and time.monotonic() < deadline:
                said.put(patch(1))
                arrival = source.read(0.01)
                if arrival is not None:
                    notices += arrival.notices
        assert notices[1:] == ["no new sample for 0.05 s"]

    def test_stamps_of_another_time_give_a_notice(self):
        first = patch(1, time=time.time() - 3600 * 24)
        with server([first]) as (port, _), open_source(f"xela://127.0.0.1:{port}") as source:
            (notice,) = source.read(1.0).notices
        assert "24 h behind" in notice


def test_a_source_that_is_closed_gives_nothing():
    with server([patch(1), patch(2)]) as (port, _):
        source = open_source(f"xela://127.0.0.1:{port}")
        assert source.read(0.01) is None
        with source:
            assert source.read(PATIENCE) is not None
        assert source.read(0.01) is None


def test_closing_while_packets_wait():
    words = [text(k, [sensor(counts(368, k), "XR23AHRCPP")]) for k in range(20)] * 50
    with server(words) as (port, _), open_source(f"xela://127.0.0.1:{port}") as source:
        assert source.read(PATIENCE) is not None
        time.sleep(0.3)  # the queue fills, and the sockets' buffers
        source.close()
        source.close()


class TestReconnecting:
    def test_the_connection_is_made_again(self, quick):
        with server([patch(1)]) as (port, said), open_source(f"xela://127.0.0.1:{port}") as source:
            said.put(HANG_UP)
            arrivals = until(source, says("connected again after "))
            (lost,) = [a for a in arrivals if says("connection lost")(a)]
            assert lost.notices == ("connection lost (the server closed it)",)
            again = until(source, lambda a: a.samples or says("no new")(a))
            assert not again[-1].samples  # the packet that was there before is no new sample
            said.put(patch(5))
            (*_, sample) = until(source, lambda a: a.samples)
        assert (sample.time, sample.n_lost) == (START + 5 * PERIOD, 0)

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

    def test_garbage_that_ends_a_connection(self, quick):
        with server([patch(1)]) as (port, said), open_source(f"xela://127.0.0.1:{port}") as source:
            said.put("x" * (module.MAX_PACKET_SIZE + 1))
            until(source, says("connection lost"))
            until(source, says("connected again"))
            said.put(patch(7))
            assert until(source, lambda a: a.samples)[-1].time == START + 7 * PERIOD


@pytest.mark.parametrize("n_headers", [0, 200_000])
def test_a_server_that_answers_before_the_request(n_headers):
    """The library's own check of its state fails then, by chance."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        ended = threading.Event()

        def answer():
            for _ in range(5):
                connection, _ = listener.accept()
                with connection:
                    head = b"HTTP/1.1 101 OK\r\n" + b"A: b\r\n" * n_headers + b"\r\n"
                    with suppress(OSError):
                        connection.sendall(head)
                    ended.wait(0.05)

        thread = threading.Thread(target=answer)
        thread.start()
        for _ in range(5):
            with pytest.raises(SourceError, match="no XELA server"):
                open_source(f"xela://127.0.0.1:{port}").open()
        thread.join()


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
