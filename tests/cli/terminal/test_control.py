import io
import os
import pty
import sys

import pytest

from holdfast.cli.terminal.control import MarkerKeys


class Stdin:
    def __init__(self, number):
        self.number = number

    def fileno(self):
        return self.number


@pytest.fixture
def pipe(monkeypatch):
    """Replace stdin by a pipe; yield its end for writing."""
    read, write = os.pipe()
    monkeypatch.setattr(sys, "stdin", Stdin(read))
    with os.fdopen(write, "wb", buffering=0) as file:
        yield file
    os.close(read)


def test_each_line_of_a_pipe_is_a_marker(pipe):
    with MarkerKeys() as keys:
        assert keys.poll() == []
        pipe.write(b"one\ntwo thr")
        assert keys.poll() == ["one"]
        pipe.write(b"ee\r\n\n  q \nend")
        assert keys.poll() == ["two three", "q"]
        pipe.close()
        assert keys.poll() == ["end"]
        assert keys.poll() == []
        assert (keys.interactive, keys.stop_pressed) == (False, False)


def test_a_line_without_end_does_not_fill_the_memory(pipe):
    with MarkerKeys() as keys:
        pipe.write(b"x" * 10_000)
        texts = [text for _ in range(5) for text in keys.poll()]
    assert [set(text) for text in texts] == [{"x"}]
    assert 4096 < len(texts[0]) < 9000


@pytest.mark.parametrize("stdin", [None, io.StringIO("a\n"), Stdin(-1), Stdin(10**6)])
def test_without_stdin_there_are_no_markers(stdin, monkeypatch):
    monkeypatch.setattr(sys, "stdin", stdin)
    with MarkerKeys() as keys:
        assert keys.poll() == []


def test_in_the_background_a_terminal_is_left_alone(monkeypatch):
    master, terminal = pty.openpty()
    monkeypatch.setattr(sys, "stdin", Stdin(terminal))
    os.write(master, b"mark\n")
    with MarkerKeys() as keys:
        assert keys.poll() == []
        assert not keys.interactive
    os.close(master)
    os.close(terminal)
