import time
from contextlib import contextmanager

import numpy as np
import pytest

import holdfast.devices.sources.serial as module
from devices.sources.board import Board, packet, some
from devices.sources.reading import some_of, until
from holdfast.contact import Fault
from holdfast.devices.sources import base, open_source
from holdfast.errors import SourceError


@pytest.fixture
def board(tmp_path):
    board = Board(tmp_path)
    yield board
    if board.path.exists():
        board.unplug()


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(module, "SERIAL_OPEN_TIMEOUT", 0.3)
    monkeypatch.setattr(base, "MIN_RETRY_DELAY", 0.02)
    monkeypatch.setattr(base, "MAX_RETRY_DELAY", 0.05)


@contextmanager
def started(board, text="", n_mags=5):
    """An open source; what the board sent while it opened is taken."""
    board.keep_sending([b"\n"] + [packet(some(1, n_mags, 99)[0])] * 10_000, 0.002)
    try:
        source = open_source(f"serial://{board.path}{text}").__enter__()
    finally:
        board.hush()
    try:
        while source.read(0.1) is not None:
            pass
        yield source
    finally:
        source.close()


def test_values_are_exact(board):
    given = some(20)
    with started(board) as source:
        board.send(*map(packet, given))
        arrivals = some_of(source, 20)
    np.testing.assert_array_equal([arrival.samples["finger1"] for arrival in arrivals], given)
    times = [arrival.time for arrival in arrivals]
    assert (np.diff(times) > 0).all()
    assert all(arrival.time <= arrival.received <= time.monotonic() for arrival in arrivals)
    assert not any(arrival.notices or arrival.n_refused for arrival in arrivals)


def test_a_board_may_carry_several_sensors(board):
    given = some(1, 10)
    with started(board, "?mags=10&fingers=2:thumb&baud=9600", n_mags=10) as source:
        board.send(packet(given[0]))
        (arrival,) = some_of(source, 1)
    np.testing.assert_array_equal(arrival.samples["finger1"], given[0, :5])
    np.testing.assert_array_equal(arrival.samples["thumb"], given[0, 5:])


def test_another_number_of_magnetometers_gives_a_fault_and_no_sample(board):
    given = some(1)
    with started(board) as source:
        board.send(*map(packet, some(9, 4)))
        arrivals = until(source, lambda a: a.faults)
        assert not any(arrival.samples for arrival in arrivals)
        assert arrivals[-1].faults == {"finger1": (Fault.TAXEL_COUNT,)}
        assert np.isnan(arrivals[-1].time)
        notices = [notice for arrival in arrivals for notice in arrival.notices]
        assert "mags=" in notices[-1]
        board.send(packet(given[0]))
        (arrival,) = some_of(source, 1)
    np.testing.assert_array_equal(arrival.samples["finger1"], given[0])
    assert arrival.faults == {}


def test_an_unplugged_board_is_connected_again(board, impatient):
    given = some(3)
    with started(board) as source:
        before = time.monotonic()
        board.unplug()
        arrivals = until(source, lambda a: a.notices)
        assert not arrivals[-1].samples
        assert arrivals[-1].notices[0].startswith("connection lost (")
        assert source.read(0.2) is None
        assert not source.ended
        board.plug()
        arrivals = until(source, lambda a: a.notices)
        assert arrivals[-1].notices[0].startswith("connected again after 0.")
        board.send(b"half a packet\r\n", *map(packet, given))
        after = some_of(source, 3)
    np.testing.assert_array_equal([arrival.samples["finger1"] for arrival in after], given)
    assert after[0].time > before


def test_a_port_that_is_missing_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "comports", lambda: [_Port("/dev/ttyS1"), _Port("/dev/ttyACM7")])
    source = open_source(f"serial://{tmp_path}/none")
    with pytest.raises(SourceError, match="/dev/ttyACM7, /dev/ttyS1"):
        source.open()


class _Port:
    def __init__(self, device):
        self.device = device


def test_a_port_without_permission_is_an_error(board, monkeypatch):
    def refuse(*args, **others):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(module, "Serial", refuse)
    monkeypatch.setattr(module, "comports", list)
    with pytest.raises(SourceError, match="dialout"):
        open_source(f"serial://{board.path}").open()


def test_silence_after_opening_is_an_error(board, impatient):
    source = open_source(f"serial://{board.path}")
    with pytest.raises(SourceError, match="nothing came"), source:
        pass
    with started(board):  # it was closed
        pass


@pytest.mark.parametrize(
    ("sent", "message"),
    [(b"\xff" * 82, "invalid packets"), (packet(some(1, 4)[0]), "4 magnetometers")],
)
def test_other_data_after_opening_are_an_error(board, impatient, sent, message):
    source = open_source(f"serial://{board.path}")
    board.keep_sending([sent] * 10_000)
    try:
        with pytest.raises(SourceError, match=message):
            source.__enter__()
    finally:
        board.hush()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("serial:", "a port expected"),
        ("serial:COM3?speed=1", "there are sensor, fingers, baud, mags"),
        ("serial:COM3?baud=fast", "'fast'"),
        ("serial:COM3?baud=0", "'0'"),
        ("serial:COM3?mags=-5", "'-5'"),
        ("serial:COM3?sensor=skin", "uskin-curved"),
        ("serial:COM3?sensor=none.json", "none.json"),
        ("serial:COM3?mags=7", "mags=7"),
        ("serial:COM3?fingers=1:index,3:thumb", "finger 3"),
        ("serial:COM3?mags=10&fingers=1:finger2", "finger2"),
    ],
)
def test_invalid_parameters(text, message):
    with pytest.raises(ValueError, match=message):
        open_source(text)
