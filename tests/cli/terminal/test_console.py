import json

import numpy as np
import pytest

from holdfast.cli.terminal.console import print_json, print_table


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
