import asyncio
import logging

import pytest

from holdfast.web import connections
from holdfast.web.connections import BriefLog, ConnectionLimit


class Wire(asyncio.Transport):
    """Transport that only has an address."""

    def __init__(self, address="10.0.0.1"):
        super().__init__({"peername": (address, 1234)})
        self.aborted = False

    def abort(self):
        self.aborted = True


def filled(limit, n, address="10.0.0.1"):
    wires = [Wire(address) for _ in range(n)]
    for wire in wires:
        limit.add(wire)
    return wires


def test_the_oldest_idle_connection_is_replaced():
    limit = ConnectionLimit(3, 3)
    first, second, third = filled(limit, 3)
    with limit.request(first):
        (new,) = filled(limit, 1)
    assert [one.aborted for one in (first, second, third, new)] == [False, True, False, False]
    assert len(limit) == 3


def test_a_request_in_progress_is_replaced_only_if_no_connection_is_idle():
    limit = ConnectionLimit(2, 2)
    first, second = filled(limit, 2)
    with limit.request(first), limit.request(second):
        (new,) = filled(limit, 1)
    assert (first.aborted, second.aborted, new.aborted) == (True, False, False)


def test_streams_stay():
    limit = ConnectionLimit(2, 2)
    wires = filled(limit, 2)
    for wire in wires:
        limit.mark_stream(wire)
    (new,) = filled(limit, 1)
    assert (new.aborted, len(limit)) == (True, 2)
    assert not any(wire.aborted for wire in wires)
    limit.remove(wires[0])
    (late,) = filled(limit, 1)
    assert not late.aborted


def test_an_address_replaces_only_its_own_connections():
    limit = ConnectionLimit(10, 2)
    (other,) = filled(limit, 1, "10.0.0.2")
    wires = filled(limit, 20)
    assert not other.aborted
    assert [wire.aborted for wire in wires] == [True] * 18 + [False] * 2


def test_connections_that_are_not_known():
    limit = ConnectionLimit(2, 2)
    limit.remove(None)
    limit.remove(Wire())
    limit.mark_stream(Wire())
    with limit.request(None), limit.request(Wire()):
        assert len(limit) == 0


@pytest.mark.parametrize(
    ("descriptors", "total", "each"), [(20_000, 256, 128), (256, 96, 48), (40, 8, 8)]
)
def test_the_limit_leaves_the_process_descriptors(monkeypatch, descriptors, total, each):
    monkeypatch.setattr(connections, "max_descriptors", lambda: descriptors)
    limit = ConnectionLimit.of_process()
    assert sum(not wire.aborted for wire in filled(limit, total + 3)) == each
    assert len(limit) == each
    filled(limit, total, "10.0.0.2")
    assert len(limit) == total


def record(line=1, text="broken", error=None):
    info = (type(error), error, error.__traceback__) if error else None
    return logging.LogRecord("x", logging.ERROR, "file.py", line, "%s\nhere", (text,), info)


def test_a_place_logs_one_line_and_not_again_at_once():
    brief = BriefLog()
    first, second, other = record(error=ValueError("bad\nthing")), record(), record(line=2)
    assert [brief.filter(one) for one in (first, second, other)] == [True, False, True]
    assert logging.Formatter().format(first) == "broken here: ValueError('bad\\nthing')"


def test_the_whole_log_for_debugging(monkeypatch):
    monkeypatch.setenv("HOLDFAST_DEBUG", "1")
    brief, one = BriefLog(), record(error=ValueError("bad"))
    assert brief.filter(one)
    assert brief.filter(one)
    assert one.exc_info is not None
