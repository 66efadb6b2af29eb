"""Every source, ready to be opened, for the contract in `test_contract.py`."""

from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from socket import create_server
from threading import Event

import numpy as np

import holdfast.devices.sources.serial
import holdfast.devices.sources.twin
from devices.sources.board import Board, packet, some
from devices.sources.orca.hand import Hand, some_frames
from holdfast.devices.sources import Source, open_source
from holdfast.io import save_recording
from holdfast.live.publishers.xela_server import XelaServer
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor
from holdfast.twin.simulation import simulate

N_SOON = 40
"""Number of samples of every source before it may become silent."""
NEVER = 1e4
"""A sample this much later is never due [s]."""


@dataclass
class Ready:
    """A source that is not open yet.

    Attributes:
        source: to be tested.
        hush: makes it silent after some samples.
    """

    source: Source
    hush: Callable[[], None] = lambda: None


def recording(n=N_SOON, last=NEVER):
    """Three modules of two kinds at 100 and 50 Hz; a last sample is much later."""
    times = np.append(np.arange(n) / 100, last)
    rng = np.random.default_rng(0)
    pads = {
        name: Tactile(sensor("uskin-4x4"), times, rng.integers(0, 65536, (n + 1, 16, 3), "u2"))
        for name in ("thumb", "index")
    }
    skin = Tactile(sensor("anyskin"), times[::2] + 1e-3, rng.normal(size=(len(times[::2]), 5, 3)))
    return Recording("grasp", {**pads, "middle": skin}, {"hand": "allegro", "object": "can"})


@cache
def _simulated(grasp):
    return simulate(grasp)


@contextmanager
def _replay(folder, suffix, speed):
    save_recording(recording(), folder / f"grasp.{suffix}", force=True)
    yield Ready(open_source(str(folder / f"grasp.{suffix}"), speed=speed))


@contextmanager
def parquet(folder, monkeypatch):
    with _replay(folder, "parquet", 1.0) as ready:
        yield ready


@contextmanager
def mcap(folder, monkeypatch):
    with _replay(folder, "mcap", 1.0) as ready:
        yield ready


@contextmanager
def parquet_at_once(folder, monkeypatch):
    with _replay(folder, "parquet", 0.0) as ready:
        yield ready


@contextmanager
def mcap_at_once(folder, monkeypatch):
    with _replay(folder, "mcap", 0.0) as ready:
        yield ready


@contextmanager
def _twin(monkeypatch, speed):
    monkeypatch.setattr(holdfast.devices.sources.twin, "simulate", _simulated)
    yield Ready(open_source("twin:?object=ball&case=1", speed=speed))


@contextmanager
def twin(folder, monkeypatch):
    with _twin(monkeypatch, 1.0) as ready:
        yield ready


@contextmanager
def twin_at_once(folder, monkeypatch):
    with _twin(monkeypatch, 0.0) as ready:
        yield ready


@contextmanager
def twin_slow(folder, monkeypatch):
    """After the first sample, no sample comes for a long time."""
    with _twin(monkeypatch, 1e-3) as ready:
        yield ready


@contextmanager
def serial(folder, monkeypatch):
    board = Board(folder)
    board.keep_sending([b"\n", *map(packet, some(10_000))])
    try:
        yield Ready(open_source(f"serial://{board.path}?fingers=1:index"), board.hush)
    finally:
        board.unplug()


@contextmanager
def xela(folder, monkeypatch):
    save_recording(recording(1000), folder / "played.parquet")
    with open_source(str(folder / "played.parquet")) as played:
        pads = _Pads(played)
        with XelaServer(pads, port=0) as server:
            yield Ready(open_source(server.uri), pads.hush)


@contextmanager
def orca(folder, monkeypatch):
    frames, _ = some_frames(N_SOON)
    hand = Hand(frames * 100)
    try:
        yield Ready(open_source(f"orca://{hand.path}"), hand.hush)
    finally:
        hand.close()


class _Pads(Source):
    """Source without the module that a XELA server cannot have; `hush` makes it silent."""

    def __init__(self, source):
        self._source = source
        self.sensors = {n: s for n, s in source.sensors.items() if s.name.startswith("uskin")}
        self._hushed = Event()

    def hush(self):
        self._hushed.set()

    def open(self):
        pass

    def close(self):
        pass

    @property
    def ended(self):
        return self._source.ended

    def read(self, timeout):
        arrival = self._source.read(timeout)
        if arrival is None or self._hushed.wait(0):
            return None
        samples = {n: v for n, v in arrival.samples.items() if n in self.sensors}
        return arrival._replace(samples=samples)


EVERY = {
    make.__name__: make
    for make in (
        parquet,
        mcap,
        parquet_at_once,
        mcap_at_once,
        twin,
        twin_at_once,
        serial,
        orca,
        xela,
    )
}
ENDING = {make.__name__: make for make in (parquet_at_once, mcap_at_once, twin_at_once)}
"""Sources that end."""
LASTING = {make.__name__: make for make in (parquet, mcap, twin_slow, serial, orca, xela)}
"""Sources that become silent, and do not end."""


@contextmanager
def no_parquet(folder, monkeypatch):
    yield open_source(str(folder / "none.parquet"))


@contextmanager
def no_twin(folder, monkeypatch):
    def fail(grasp):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(holdfast.devices.sources.twin, "simulate", fail)
    yield open_source("twin:")


@contextmanager
def no_serial(folder, monkeypatch):
    monkeypatch.setattr(holdfast.devices.sources.serial, "SERIAL_OPEN_TIMEOUT", 0.1)
    board = Board(folder)
    yield open_source(f"serial://{board.path}")
    board.unplug()


@contextmanager
def no_xela(folder, monkeypatch):
    with create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    yield open_source(f"xela://127.0.0.1:{port}")


BROKEN = {make.__name__: make for make in (no_parquet, no_twin, no_serial, no_xela)}
"""Sources that cannot be opened."""
