import io
import json
import sys
import time
from contextlib import nullcontext, redirect_stdout
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from holdfast.cli import app
from holdfast.cli.terminal import console
from holdfast.cli.terminal.console import (
    message_if_slow,
    print_error,
    print_json,
    print_line,
    print_lines,
    print_message,
    print_table,
    visible,
    visible_json,
)

HOSTILE = "can\x1b]0;title\x07\x1b[2J\x9b31m\r\x7f\u202eevil\ud800"
SHOWN = r"can\x1b]0;title\x07\x1b[2J\x9b31m\r\x7f\u202eevil\ud800"


def test_nothing_that_is_printed_controls_the_terminal_or_begins_a_line(capsys):
    print_line(f"{HOSTILE}\nnext")
    print_message(f"{HOSTILE}\nnext")
    print_error(f"two\nlines {HOSTILE}")
    print_table(("name",), [(f"{HOSTILE}\nnext",)])
    print_lines((f"{HOSTILE}\nnext", "last"))
    out, err = capsys.readouterr()
    assert out == f"{SHOWN}\\nnext\nname\n{SHOWN}\\nnext\n{SHOWN}\\nnext\nlast\n"
    words = SHOWN.replace(r"\r", " ")
    assert err == f"{SHOWN}\\nnext\nholdfast: two lines {words}\n"


def test_json_has_no_control_characters(capsys):
    name = HOSTILE.removesuffix("\ud800") + "Möhre\U000e0001"
    print_json({"name": name})
    out = capsys.readouterr().out
    assert out.removesuffix("\n").isprintable()
    assert "Möhre" in out
    assert json.loads(out) == {"name": name}


@given(st.text())
def test_visible_text_is_printable_and_json_keeps_its_value(text):
    assert visible(text).isprintable()
    assert visible(visible(text)) == visible(text)
    encoded = json.dumps(text, ensure_ascii=False)
    assert visible_json(encoded).isprintable()
    assert json.loads(visible_json(encoded)) == text


def test_an_error_message_is_limited(capsys):
    print_error("x" * 100_000)
    assert len(capsys.readouterr().err) == len("holdfast: ...\n") + 2000


def test_json_converts_numpy_values_and_paths(capsys, tmp_path):
    numbers = np.float64(2.5), np.int64(3), np.bool_(True), float("inf")
    print_json([np.array([1.0, np.nan]), *numbers, tmp_path])
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert json.loads(out) == [[1.0, None], 2.5, 3, True, None, str(tmp_path)]
    with pytest.raises(TypeError, match="object"):
        print_json({"a": object()})


def test_table(capsys):
    print_table(("name", "rate"), [("a", 5), ("long", "-"), ("b", "12.5")])
    print_table(("name", "rate"), [])
    table = "name  rate\na        5\nlong     -\nb     12.5\n"
    assert capsys.readouterr().out == table + "name  rate\n"


@given(
    st.lists(st.text("ab-_/. ", max_size=300), min_size=1, max_size=5),
    st.lists(st.integers(0, 10**6), min_size=1, max_size=4),
)
@example(["_" * 25], [0, 0, 0])  # each column is as narrow as it can be
def test_every_table_of_few_columns_fits(names, numbers):
    header = ("name", "notes of a person", *("number of samples",) * len(numbers))
    rows = [(name, name[::-1], *numbers) for name in names]
    with redirect_stdout(io.StringIO()) as out:
        print_table(header, rows)
    lines = out.getvalue().splitlines()
    assert max(map(len, lines)) <= 80
    cells = "".join(str(cell) for row in (header, *rows) for cell in row)
    assert sorted("".join(lines).replace(" ", "")) == sorted(cells.replace(" ", ""))


@pytest.mark.parametrize(
    ("text", "after", "printed"),
    [("waiting", 0.0, "waiting\n"), ("waiting", 60.0, ""), ("", 0.0, "")],
)
def test_a_message_if_slow(capsys, text, after, printed):
    with message_if_slow(text, after):
        deadline = time.monotonic() + 20
        while printed and time.monotonic() < deadline and not sys.stderr.getvalue():
            time.sleep(0.01)
    assert capsys.readouterr().err == printed


class Terminal(io.StringIO):
    def isatty(self):
        return True


class TestSilence:
    @staticmethod
    def on_terminal(monkeypatch, silence):
        monkeypatch.setattr(sys, "stderr", Terminal())  # here: pytest sets it before each phase
        monkeypatch.setattr(console, "SILENCE", silence)
        return sys.stderr

    def test_a_command_that_prints_nothing_says_that_it_works(self, monkeypatch):
        terminal = self.on_terminal(monkeypatch, 0.1)
        with console.break_silence("tune: working ..."):
            deadline = time.monotonic() + 20
            while time.monotonic() < deadline and not terminal.getvalue():
                time.sleep(0.01)
        assert terminal.getvalue() == "tune: working ...\n"

    @pytest.mark.parametrize("shows", [print_line, print_message, print_json])
    def test_the_first_line_ends_the_silence(self, monkeypatch, shows):
        self.on_terminal(monkeypatch, 60.0)
        calls = []
        timer = SimpleNamespace(
            start=lambda: calls.append("start"), cancel=lambda: calls.append("cancel")
        )
        monkeypatch.setattr(console, "Timer", lambda *_: timer)
        with console.break_silence("tune: working ..."):
            shows("done")
            assert calls == ["start", "cancel"]

    def test_a_pipe_gets_no_such_line(self, monkeypatch):
        monkeypatch.setattr(console, "Timer", None)
        with console.break_silence("tune: working ..."):
            pass

    def test_every_verb_is_watched(self, monkeypatch):
        seen = []
        monkeypatch.setattr(app, "break_silence", lambda text: seen.append(text) or nullcontext())
        assert app.main(["sensors"]) == 0
        assert seen == ["sensors: working ..."]
