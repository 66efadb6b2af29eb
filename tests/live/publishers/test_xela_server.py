import json
import socket
import threading
import time
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest
from websockets.sync.client import connect

from holdfast.devices.sources import Arrival, Source, base, open_source
from holdfast.errors import OutputError
from holdfast.live.publishers import xela_server as module
from holdfast.live.publishers.xela_server import XelaServer
from holdfast.sensors import hand, sensor
from live.build import wait_for

TIPS = dict.fromkeys(("thumb", "index", "middle", "ring"), sensor("uskin-curved"))
WHOLE = {name: one.sensor for name, one in hand("allegro-uskin").modules.items()}
PERIOD = 1 / 500
PATIENCE = 20.0
"""Time after which a waiting test fails [s]."""


def time_of(k):
    return 3.0 + k * PERIOD


def samples_of(sensors, k):
    dice = np.random.default_rng(k)
    return {
        name: dice.integers(0, 65536, (one.n_taxels, 3), dtype=np.uint16)
        for name, one in sensors.items()
    }


class Made(Source):
    """Source of random samples every 2 ms; `n` of them, or without end."""

    def __init__(self, sensors=TIPS, n=None, first=0, samples=samples_of):
        self.sensors = sensors
        self.samples = samples
        self.n = n
        self.k = first

    def open(self):
        self.sensors = dict(self.sensors)

    @property
    def ended(self):
        return self.n is not None and self.k >= self.n

    def read(self, timeout):
        if self.ended:
            return None
        time.sleep(PERIOD)
        self.k += 1
        samples = self.samples(self.sensors, self.k - 1)
        return Arrival(time_of(self.k - 1), samples, time.monotonic())

    def close(self):
        pass


@pytest.fixture(autouse=True)
def tidy():
    """Check that no thread is left."""
    before = set(threading.enumerate())
    yield
    left = [thread for thread in threading.enumerate() if thread not in before]
    for thread in left:
        thread.join(PATIENCE)
    assert not [thread for thread in left if thread.is_alive()]


@contextmanager
def played(source, **options):
    with source, XelaServer(source, port=options.pop("port", 0), **options) as server:
        yield server


def taken(source, n):
    """The next `n` arrivals with samples."""
    arrivals = []
    deadline = time.monotonic() + PATIENCE
    while len(arrivals) < n and time.monotonic() < deadline:
        arrival = source.read(0.1)
        if arrival is not None and arrival.samples:
            arrivals.append(arrival)
    assert len(arrivals) == n
    return arrivals


@pytest.mark.parametrize("version", ["1.7", "1.8"])
@pytest.mark.parametrize("sensors", [TIPS, WHOLE], ids=["tips", "hand"])
def test_a_client_receives_everything_in_order(version, sensors):
    n = 200
    with played(Made(sensors, n), version=version, wait=True) as server:
        with open_source(server.uri) as source:
            assert source.sensors == sensors
            arrivals = taken(source, n)
        assert server.wait(PATIENCE)
    assert (server.n_packets, server.failure) == (n, None)
    shift = arrivals[0].time - time_of(0)
    assert abs(arrivals[0].time - time.time()) < 3600
    for k, arrival in enumerate(arrivals):
        assert arrival.time - shift == pytest.approx(time_of(k), abs=1e-6)
        assert arrival.n_lost == arrival.n_refused == 0
        expected = samples_of(sensors, k)
        assert arrival.samples.keys() == expected.keys()
        for name, readings in expected.items():
            np.testing.assert_array_equal(arrival.samples[name], readings)
    assert (np.diff([a.time for a in arrivals]) > 0).all()


class InTurn(Made):
    """Source whose modules have their samples one after the other, half a millisecond apart."""

    def read(self, timeout):
        if self.ended:
            return None
        names = list(self.sensors)
        k, index = divmod(self.k, len(names))
        time.sleep(PERIOD / len(names))
        self.k += 1
        name = names[index]
        samples = {name: samples_of(self.sensors, k)[name]}
        return Arrival(time_of(k) + index * PERIOD / len(names), samples, time.monotonic())


@pytest.mark.parametrize(
    ("version", "sensors", "whole_hand"),
    [("1.8", TIPS, False), ("1.7", TIPS, False), ("1.8", TIPS, True), ("1.8", WHOLE, False)],
)
def test_modules_with_separate_times(version, sensors, whole_hand):
    """A client receives the list of all modules, and every sample of each once."""
    n, seen = 50, {name: [] for name in sensors}
    made = InTurn(sensors, n * len(sensors))
    with (
        played(made, version=version, whole_hand=whole_hand, wait=True) as server,
        open_source(server.uri) as source,
    ):
        assert set(sensors) <= set(source.sensors)
        while len(seen["ring"]) < n:
            (arrival,) = taken(source, 1)
            for name in seen.keys() & arrival.samples.keys():
                seen[name].append((arrival.time, arrival.samples[name]))
    shift = seen["thumb"][0][0] - time_of(0)
    for index, (name, got) in enumerate(seen.items()):
        assert len(got) == n
        for k, (when, readings) in enumerate(got):
            np.testing.assert_array_equal(readings, samples_of(sensors, k)[name])
            if server.encoder.has_own_stamps:
                expected = time_of(k) + index * PERIOD / len(sensors)
                assert when - shift == pytest.approx(expected, abs=2e-6)


def test_the_first_message_is_welcome_and_commands_are_ignored():
    with played(Made()) as server:
        with connect(server.uri.replace("xela", "ws").split("?")[0], compression=None) as one:
            assert json.loads(one.recv())["message"] == "Welcome"
            one.send("anything")
            assert isinstance(json.loads(one.recv())["message"], int)
        wait_for(lambda: server.n_clients == 0)
        assert server.failure is None


def test_waiting_for_the_first_client():
    made = Made(n=10)
    with played(made, wait=True) as server:
        assert not server.wait(0.2)
        assert made.k == 0
        with open_source(server.uri) as source:
            taken(source, 10)
        assert server.wait(PATIENCE)


def test_an_arrival_without_samples_is_not_sent():
    with played(Made(n=5, samples=lambda sensors, k: {})) as server:
        assert server.wait(PATIENCE)  # which ends without clients
    assert (server.ended, server.n_packets) == (True, 0)


HANDSHAKE = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
)


def port_of(server):
    return int(server.uri.split("?")[0].rsplit(":", maxsplit=1)[1])


def raw_client(stack, server, data=HANDSHAKE + b"\r\n"):
    """A client that sent these bytes, and reads nothing."""
    lazy = stack.enter_context(socket.socket())
    lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    lazy.settimeout(PATIENCE)
    lazy.connect(("127.0.0.1", port_of(server)))
    lazy.sendall(data)
    return lazy


def test_a_client_that_does_not_read_is_disconnected_and_delays_no_other(monkeypatch):
    monkeypatch.setattr(module, "MAX_BACKLOG", 100_000)
    with ExitStack() as stack:
        server = stack.enter_context(played(Made(WHOLE)))
        raw_client(stack, server)
        source = stack.enter_context(open_source(server.uri))
        wait_for(lambda: server.n_clients == 2)
        while server.n_clients == 2:
            assert all(a.n_lost == 0 for a in taken(source, 10))


@pytest.mark.parametrize(
    ("backlogs", "slow"),
    [
        ({"a": 10, "b": 0}, []),
        ({"a": 10, "b": 101}, ["b"]),
        ({"a": 90, "b": 80, "c": 100}, ["c"]),
        ({"a": 100, "b": 100, "c": 100, "d": 1}, ["a", "b"]),
    ],
)
def test_the_slowest_clients_are_disconnected_first(monkeypatch, backlogs, slow):
    monkeypatch.setattr(module, "MAX_BACKLOG", 100)
    monkeypatch.setattr(module, "MAX_TOTAL_BACKLOG", 180)
    assert module._too_slow(backlogs) == slow


@pytest.mark.parametrize(
    ("head", "status"),
    [
        (HANDSHAKE.replace(b"127.0.0.1", b"evil.example"), 403),
        (HANDSHAKE + b"Origin: http://evil.example\r\n", 403),
        (HANDSHAKE + b"Origin: null\r\n", 403),
        (HANDSHAKE + b"Origin: http://127.0.0.1\r\n", 101),
        (HANDSHAKE + b"Host: 127.0.0.1\r\n", 400),
        (HANDSHAKE.replace(b"Host: 127.0.0.1\r\n", b""), 400),
    ],
)
def test_pages_of_other_origins_are_refused(head, status):
    with ExitStack() as stack:
        server = stack.enter_context(played(Made()))
        client = raw_client(stack, server, head + b"\r\n")
        assert client.recv(1 << 16).split()[1] == str(status).encode()


def test_too_many_clients_are_refused(monkeypatch):
    monkeypatch.setattr(module, "MAX_CLIENTS", 2)
    with ExitStack() as stack:
        server = stack.enter_context(played(Made()))
        for _ in range(2):
            raw_client(stack, server)
        wait_for(lambda: server.n_clients == 2)
        assert raw_client(stack, server).recv(12) == b"HTTP/1.1 503"


def test_a_client_goes_on_after_a_restart(monkeypatch):
    monkeypatch.setattr(base, "MIN_RETRY_DELAY", 0.01)
    monkeypatch.setattr(base, "MAX_RETRY_DELAY", 0.05)
    with ExitStack() as stack:
        with played(Made()) as server:
            source = stack.enter_context(open_source(server.uri))
            port = port_of(server)
            before = taken(source, 50)
        with played(Made(first=1000), port=port):
            after = taken(source, 300)
    times = [a.time for a in before + after]
    assert (np.diff(times) > 0).all()
    assert not any(a.n_lost for a in after)
    newest = after[-1].samples["ring"]
    assert any((samples_of(TIPS, k)["ring"] == newest).all() for k in range(1000, 1600))


def test_an_address_that_cannot_be_used():
    with socket.create_server(("127.0.0.1", 0)) as other:
        used = other.getsockname()[1]
        for host, port in (("127.0.0.1", used), ("127.0.0.1", 70000), ("203.0.113.1", 0)):
            with (
                pytest.raises(OutputError, match=f"cannot listen at {host}:{port} "),
                played(Made(), host=host, port=port),
            ):
                pass


def test_readings_that_are_not_counts_end_the_server():
    readings = {"thumb": np.full((30, 3), -1.5)}
    with played(Made(samples=lambda sensors, k: readings)) as server:
        assert server.wait(PATIENCE)
    assert isinstance(server.failure, ValueError)
    assert str(server.failure).startswith("thumb: ")


@pytest.mark.parametrize("limit", [0.1, 1e6])
def test_the_end_waits_for_a_limited_time_and_closing_for_nobody(monkeypatch, limit):
    monkeypatch.setattr(module, "_unsent_bytes", lambda client: 1)
    monkeypatch.setattr(module, "DRAIN_TIMEOUT", limit)
    with played(Made(n=5), wait=True) as server, open_source(server.uri):
        wait_for(lambda: server.n_packets == 5)
        assert server.wait(PATIENCE if limit < 1 else 0.1) == (limit < 1)
    assert server.ended


class Grasp(Made):
    """Source that can begin again: its samples repeat, its times continue."""

    n_restarts = n_read = 0

    def restart(self):
        self.n_restarts += 1
        self.k = 0

    def read(self, timeout):
        arrival = super().read(timeout)
        self.n_read += 1
        return arrival._replace(time=time_of(self.n_read))


@pytest.mark.parametrize("sensors", [TIPS, WHOLE], ids=["tips", "hand"])
def test_each_client_receives_the_recording_from_its_beginning(sensors):
    made, first = Grasp(sensors), samples_of(sensors, 0)["thumb"]

    def begins(arrival):
        return np.array_equal(arrival.samples["thumb"], first)

    with played(made, restart=True) as server:
        with open_source(server.uri) as one:
            assert begins(taken(one, 100)[0])
            with open_source(server.uri) as other:
                assert begins(taken(other, 50)[0])
            both = taken(one, 300)
            assert any(map(begins, both))
            assert (np.diff([a.time for a in both]) > 0).all()
        wait_for(lambda: server.n_clients == 0)
        server.wait(0.1)  # for the read that is under way
        n_read = made.n_read
        assert not server.wait(0.2)
        assert made.n_read == n_read  # it is not read without clients
        with open_source(server.uri) as late:
            assert begins(taken(late, 10)[0])
        assert (made.n_restarts, server.failure) == (3, None)
