import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holdfast.cli.terminal.console import (
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


@settings(deadline=None)
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
    given = {
        "array": np.array([1.0, np.nan]),
        "number": np.float64(2.5),
        "count": np.int64(3),
        "flag": np.bool_(True),
        "path": tmp_path,
        "infinite": float("inf"),
    }
    print_json(given)
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert json.loads(out) == {
        "array": [1.0, None],
        "number": 2.5,
        "count": 3,
        "flag": True,
        "path": str(tmp_path),
        "infinite": None,
    }


def test_json_refuses_other_objects():
    with pytest.raises(TypeError, match=r"^object cannot be written as JSON$"):
        print_json({"a": object()})


def test_table(capsys):
    print_table(("name", "rate"), [("a", 5), ("long", "-"), ("b", "12.5")])
    assert capsys.readouterr().out == "name  rate\na        5\nlong     -\nb     12.5\n"


def test_empty_table(capsys):
    print_table(("name", "rate"), [])
    assert capsys.readouterr().out == "name  rate\n"
