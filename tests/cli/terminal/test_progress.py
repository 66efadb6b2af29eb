import sys
import time

import pytest

from holdfast.cli.terminal import progress as module
from holdfast.cli.terminal.progress import ProgressBar, progress


@pytest.fixture
def no_progress_messages():
    """Keep the messages, which are tested here."""


@pytest.fixture
def clock(monkeypatch):
    """Replace the clock; return a function that advances it."""
    now = [1000.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    return wait


def on_terminal(monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)


def test_without_a_terminal_one_line_per_minute(capsys, clock):
    with ProgressBar("working", 100.0) as bar:
        for _ in range(4):
            clock(50.0)
            bar.advance(10.0)
    assert capsys.readouterr().err.splitlines() == [
        "working: 20%, about 7 min left",
        "working: 40%, about 5 min left",
    ]


def test_without_a_total_nothing_is_printed(capsys, clock):
    with ProgressBar("working") as bar:
        clock(100.0)
        bar.advance()
    assert capsys.readouterr() == ("", "")


def test_costs_weigh_the_progress(capsys, clock):
    for _ in progress(iter((30.0, 70.0)), "working", 100.0, cost=lambda item: item):
        clock(90.0)
    assert capsys.readouterr().err.splitlines() == [
        "working: 30%, about 4 min left",
        "working: 100%, about 0 min left",
    ]


def test_no_remaining_time_before_three_percent(capsys, clock):
    """The first steps of a long work include its start, such as imports."""
    with ProgressBar("reading", 4000.0) as bar:
        clock(61.0)
        bar.advance()
        clock(61.0)
        bar.advance(118.0)
        clock(61.0)
        bar.advance()
    assert capsys.readouterr().err.splitlines() == [
        "reading: 0%",
        "reading: 3%",
        "reading: 3%, about 99 min left",
    ]


def test_a_bar_appears_before_the_first_step_is_done(capsys, monkeypatch):
    on_terminal(monkeypatch)
    monkeypatch.setattr(module, "DISPLAY_DELAY", 0.01)
    with ProgressBar("working", 3):
        ends = time.monotonic() + 20
        while not sys.stderr.getvalue() and time.monotonic() < ends:
            time.sleep(0.01)
    err = capsys.readouterr().err
    assert "working" in err
    assert "-:--:--" in err


def test_a_bar_shows_the_share(capsys, monkeypatch, clock):
    on_terminal(monkeypatch)
    with ProgressBar("working", 10) as bar:
        bar.advance()
        clock(60.0)
        bar.advance(0.0)
    assert " 10%" in capsys.readouterr().err


class PlayedServer:
    """Server that has another number of clients at each look, then ends."""

    port, n_packets = 5000, 0

    def __init__(self, *numbers):
        self.left = list(numbers)
        self.n_clients = None

    def wait(self, timeout):
        if self.left:
            self.n_clients = self.left.pop(0)
            return False
        return True


def test_each_number_of_clients_is_a_line(capsys):
    module.show_clients(PlayedServer(0, 0, 1, 1, 2, 0))
    assert capsys.readouterr().err.splitlines() == [
        "waiting for a client on port 5000", "1 client", "2 clients",
        "waiting for a client on port 5000",
    ]  # fmt: skip


def test_on_a_terminal_one_line_of_clients_is_rewritten(capsys, monkeypatch):
    on_terminal(monkeypatch)
    monkeypatch.setattr(module, "PLAY_REFRESH_INTERVAL", 0.0)
    module.show_clients(PlayedServer(0, 1))
    waiting, one = capsys.readouterr().err.split("\r")[1:]
    assert "waiting for a client on port 5000" in waiting
    assert one.startswith("1 client, 0.0 packets/s")
