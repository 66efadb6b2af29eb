import itertools

import numpy as np
import pytest

from devices.sources.reading import Clock
from holdfast.devices.sources import Arrival, base
from holdfast.devices.sources.base import DeviceSource, notice_arrival

SAMPLE = {"thumb": np.zeros((1, 3))}


class ScriptedDevice(DeviceSource):
    """A device that sends by a script: its times and arrivals; `None` ends the connection."""

    silence_timeout = 1.0

    def __init__(self, clock, script, attempts=()):
        super().__init__()
        self.clock = clock
        self._script = list(script)
        self._attempts = iter(attempts)
        self.attempted_at = []
        self.n_disconnects = 0

    def open(self):
        self.close()
        self.begin_reading(self.clock.now)

    def receive(self, timeout):
        if not self._script or self._script[0][0] > self.clock.now + timeout:
            self.clock.now += timeout
            return False
        self.clock.now = max(self.clock.now, self._script[0][0])
        at, arrivals = self._script.pop(0)
        if arrivals is None:
            self.lose("unplugged")
            return False
        self.queue(arrivals, at)
        return True

    def reconnect(self):
        self.attempted_at.append(self.clock.now)
        return next(self._attempts, False)

    def disconnect(self):
        self.n_disconnects += 1


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(base, "time", clock)
    return clock


def sample(at):
    return at, [Arrival(at, SAMPLE, at)]


def content(source, seconds):
    """Times by the host's clock of what a source gives: "sample" or the notices."""
    end = source.clock.now + seconds
    got = []
    while source.clock.now < end:
        arrival = source.read(min(0.25, end - source.clock.now))
        if arrival is not None:
            got.append((round(arrival.received, 6), *(arrival.notices or ("sample",))))
    return got


def test_silence_is_reported_once(clock):
    with ScriptedDevice(clock, [sample(100.5), sample(103.0), sample(104.9)]) as source:
        assert content(source, 4.5) == [
            (100.5, "sample"),
            (101.5, "no new sample for 1 s"),
            (103.0, "samples again after 2.5 s"),
            (103.0, "sample"),
            (104.0, "no new sample for 1 s"),
        ]


def test_arrivals_without_samples_are_silence(clock):
    script = [(at, [notice_arrival(at, "x")]) for at in (100.4, 100.8, 101.2)]
    with ScriptedDevice(clock, script) as source:
        expected = [(100.4, "x"), (100.8, "x"), (101.0, "no new sample for 1 s"), (101.2, "x")]
        assert content(source, 1.5) == expected


def test_a_lost_device_is_connected_again(clock):
    script = [sample(100.1), (100.2, None), sample(105.0)]
    with ScriptedDevice(clock, script, [False, False, True]) as source:
        assert content(source, 5.5) == [
            (100.1, "sample"),
            (100.2, "connection lost (unplugged)"),
            (103.7, "connected again after 3.5 s"),
            (104.7, "no new sample for 1 s"),
            (105.0, "samples again after 1.3 s"),
            (105.0, "sample"),
        ]


def test_attempts_become_less_frequent(clock):
    with ScriptedDevice(clock, [(100.0, None)]) as source:
        content(source, 10.0)
    waits = np.diff([100.0, *source.attempted_at])
    np.testing.assert_allclose(waits[:5], [0.5, 1.0, 2.0, 2.0, 2.0])


def test_after_a_connection_attempts_begin_again(clock):
    script = [(100.0, None), (110.0, None)]
    with ScriptedDevice(clock, script, itertools.chain([False, False, True])) as source:
        content(source, 12.0)
    assert source.attempted_at == pytest.approx([100.5, 101.5, 103.5, 110.5, 111.5])


def test_a_closed_device_gives_nothing(clock):
    source = ScriptedDevice(clock, [sample(100.1), sample(100.2)])
    assert source.read(1.0) is None
    with source:
        assert source.read(1.0) is not None
        n_before = source.n_disconnects
    assert source.n_disconnects == n_before + 1
    assert source.read(1.0) is None
