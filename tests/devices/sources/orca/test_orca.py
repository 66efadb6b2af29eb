import time

import numpy as np
import pytest

import holdfast.devices.sources.serial as module
from devices.sources.board import Board
from devices.sources.orca.hand import FINGERS, Hand, some_frames
from devices.sources.reading import some_of, until
from holdfast.devices.sources import open_source
from holdfast.devices.sources import orca_frames as protocol
from holdfast.errors import SourceError

pytestmark = pytest.mark.slow
FRAMES, FORCES = some_frames(400)
FEWER = {"thumb": 51, "middle": 87, "ring": 87}


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(module, "SERIAL_OPEN_TIMEOUT", 0.6)
    monkeypatch.setattr(protocol, "RESPONSE_TIMEOUT", 0.1)


def made(hand):
    return open_source(f"orca://{hand.path}")


@pytest.mark.parametrize("fingers", [FINGERS, FEWER])
def test_every_frame_of_the_connected_fingers_arrives(fingers):
    frames, forces = some_frames(200, fingers)
    hand = Hand(frames, fingers)
    try:
        with made(hand) as source:
            assert {name: one.n_taxels for name, one in source.sensors.items()} == fingers
            names = [one.name for one in source.sensors.values()]
            assert set(names) <= {"orca-finger", "orca-thumb", "orca-pinky"}
            arrivals = some_of(source, 100)
    finally:
        hand.close()
    samples = [np.concatenate(list(arrival.samples.values())) for arrival in arrivals]
    first = next(k for k, one in enumerate(forces) if np.array_equal(one, samples[0]))
    np.testing.assert_array_equal(samples, forces[first : first + 100])  # nothing is lost
    assert not any(arrival.n_lost or arrival.n_refused for arrival in arrivals)
    steps = np.diff([arrival.time for arrival in arrivals])
    assert np.mean(steps) == pytest.approx(0.005, rel=0.2)


def test_a_hand_with_other_fingertips_has_flat_grids():
    hand = Hand(some_frames(400, {"index": 60})[0], {"index": 60})
    try:
        with made(hand) as source:
            one = source.sensors["index"]
    finally:
        hand.close()
    assert (one.name, one.unit, one.step, np.ptp(one.positions[:, 2])) == ("orca-60", "N", 0.1, 0)


@pytest.mark.parametrize("fingers", [FINGERS, FEWER])
def test_a_hand_that_resets_is_armed_again(monkeypatch, fingers):
    """Without two fingers, its frames are refused until the source is opened again."""
    monkeypatch.setattr(protocol, "REARM_SILENCE", 0.3)
    monkeypatch.setattr(protocol, "REARM_INTERVAL", 0.5)
    hand = Hand(FRAMES * 10)
    try:
        with made(hand) as source:
            some_of(source, 20)
            hand.streams, hand.fingers = False, fingers
            hand.frames = iter(some_frames(400, fingers)[0])
            end, arrivals = time.monotonic() + 5, []
            while hand.n_armed < 2 and time.monotonic() < end:
                arrivals.append(source.read(0.02))
            arrivals += until(source, lambda arrival: arrival.samples or arrival.faults)
    finally:
        hand.close()
    assert hand.n_armed == 2
    if fingers == FINGERS:
        assert set(arrivals[-1].samples) == set(FINGERS)
    else:
        assert set(arrivals[-1].faults) == set(FINGERS)
        notices = [text for arrival in arrivals if arrival for text in arrival.notices]
        assert any("(thumb, middle, ring): open the source again" in text for text in notices)


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        (None, "this port sends nothing; an ORCA Touch hand at 921600 baud"),
        (b"\xff\x00hello\r\n" * 20, "this port sends something, but no ORCA frames; .*2000000"),
    ],
)
def test_a_port_that_is_no_hand(tmp_path, impatient, sent, message):
    board = Board(tmp_path)
    if sent:
        board.keep_sending([sent] * 1000)
    try:
        with pytest.raises(SourceError, match=message):
            open_source(f"orca://{board.path}").open()
    finally:
        board.unplug()


@pytest.mark.parametrize(
    ("fingers", "message"), [({}, "no finger with a sensor"), (FINGERS, "sends no taxels")]
)
def test_a_hand_without_samples(impatient, fingers, message):
    hand = Hand([], fingers)
    try:
        with pytest.raises(SourceError, match=message):
            made(hand).open()
    finally:
        hand.close()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("orca:", "orca:///dev/tty"),
        ("orca:COM3?fingers=1:index", "baud"),
        ("orca:COM3?baud=x", "x"),
    ],
)
def test_invalid_parameters(text, message):
    with pytest.raises(ValueError, match=message):
        open_source(text)


def test_a_missing_port_is_one_line(tmp_path):
    with pytest.raises(SourceError, match="there is no such port"):
        open_source(f"orca://{tmp_path}/none").open()


def test_closing_ends_the_reading():
    hand = Hand(FRAMES * 10)
    try:
        source = made(hand)
        source.open()
        source.close()
        began = time.monotonic()
        assert source.read(0.0) is None
        assert time.monotonic() - began < 1
    finally:
        hand.close()
