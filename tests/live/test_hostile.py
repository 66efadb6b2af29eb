"""A server that sends invalid packets, disconnects and returns: the session continues."""

import math

import numpy as np
import pytest

from devices.sources.xela.servers import HANG_UP, free_port, server
from holdfast.contact import ContactState
from holdfast.detection import detect
from holdfast.devices.sources import open_source
from holdfast.devices.sources.xela.encoder import XelaEncoder
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamDetector

from . import build
from .build import wait_for

pytestmark = pytest.mark.slow  # servers and sockets

EPOCH = 1.7e9
NAMES = "fingers=1:thumb,2:index,3:middle"


@pytest.fixture(autouse=True)
def any_pace(monkeypatch):
    """Accept bursts: these tests send seconds of packets at once."""
    for name in ("MIN_LATE_DELAY", "MIN_CLOCK_JUMP"):  # a busy machine is late
        monkeypatch.setattr(f"holdfast.devices.sources.timeline.{name}", math.inf)


def packets_of(recording, epoch=EPOCH):
    """One packet of XELA's server for each instant of a recording."""
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    encoder = XelaEncoder(sensors)
    return [
        encoder.packet(one.samples, epoch + one.time, epoch + one.time)
        for one in build.arrivals_of(recording)
    ]


def test_a_restarted_server_keeps_the_tare_and_the_clock():
    recording = build.grasp()
    packets = packets_of(recording)
    port = free_port()
    updates = []
    with server(packets[:300], port=port) as (_, outbox):
        source = open_source(f"xela://127.0.0.1:{port}?{NAMES}")
        source.open()
        session = Session(StreamDetector(build.model(), source))
        session.add_listener(updates.append)
        session.start()
        wait_for(lambda: session.n_packets == 300)
        outbox.put(HANG_UP)
    try:
        wait_for(lambda: session.stream.silent)
        later = packets_of(recording, EPOCH + 2.0)  # its counter restarts
        with server(later[300:900], port=port):
            wait_for(lambda: session.n_packets == 900)
    finally:
        session.stop()
    assert session.failure is None
    updates = [update for update in updates if update.arrival is not None]
    estimates = [one.estimate for update in updates for one in update.estimates]
    assert (np.diff([one.time for one in estimates]) > 0).all()
    assert any("connection lost" in text for x in updates for text in x.arrival.notices)
    # The tare was kept: the force is that of the recording, and no finger waits for a new one.
    expected = detect(build.model(), recording).fingers["thumb"].force[899]
    np.testing.assert_allclose(estimates[-1].fingers["thumb"].force, expected)
    assert any(one.fingers["thumb"].state is not ContactState.UNKNOWN for one in estimates[-100:])
