"""CSV files that `detect` and `evaluate` read without an import."""

import json
import shlex

import numpy as np
import pytest

from cases import COMMAND
from holdfast.cli import main
from holdfast.sensors import flat_sensor

N, PUSH = 1200, slice(500, 560)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def sensor(folder):
    """The file of a 3 x 3 sensor."""
    fields = flat_sensor("press", 3, 3, 0.005).to_dict()
    (folder / "sensor.json").write_text(json.dumps(fields))
    return "sensor.json"


def write_press(path, columns="F{axis}{taxel}", labelled=False):
    """A grasp from 2 s to 9 s with a push, as another logger writes it."""
    times = np.arange(N) / 100
    grip = np.interp(times, [1.5, 2.0, 9.0, 9.4], [0, 1, 1, 0])
    push = np.zeros(N)
    push[PUSH] = np.sin(2 * np.pi * times[PUSH] / 0.3) / 2
    force = np.stack([push, 0.1 * grip, grip + push / 2], axis=1)
    noise = np.random.default_rng(0).normal(0, 2, (N, 9, 3))
    readings = (1000 + 400 * force[:, None, :] + noise).reshape(N, 27).round(1).astype(str)
    names = [columns.format(axis=axis, taxel=taxel) for taxel in range(9) for axis in "xyz"]
    rows = np.column_stack([(1000 * times).astype(str), readings])
    if labelled:
        names, states = [*names, "label"], np.full(N, "no_contact", dtype="<U10")
        states[200:900], states[PUSH] = "stable", "unstable"
        rows = np.column_stack([rows, states])
    lines = [",".join(["timestamp", *names]), *(",".join(row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def run(capsys, *words, code=0):
    capsys.readouterr()
    assert main([*map(str, words)]) == code
    return capsys.readouterr()


def test_detect_gives_what_it_gives_after_an_import(folder, sensor, capsys):
    write_press(folder / "press.csv")
    words = ("--sensor", sensor, "--columns", "time=timestamp:ms")
    out, _ = run(capsys, "detect", "builtin:any", "press.csv", *words)
    assert {path.name for path in folder.iterdir()} == {"press.csv", "sensor.json"}
    run(capsys, "import", "press.csv", "out", *words)
    assert run(capsys, "detect", "builtin:any", "out/press.parquet").out == out


def test_columns_are_named_and_any_suffix_is_read(folder, sensor, capsys):
    write_press(folder / "press.log", "m{taxel}{axis}")
    columns = "time=timestamp:ms,taxels=m0x..m8z"
    words = ("press.log", "--sensor", sensor, "--columns", columns, "--summary", "--json")
    out, _ = run(capsys, "detect", "builtin:any", *words)
    assert json.loads(out)["fingers"]["finger1"]["n_samples"] == N


def test_evaluate_takes_the_labels_of_a_column(folder, sensor, capsys):
    (folder / "in").mkdir()
    for name in ("a", "b"):
        write_press(folder / "in" / f"{name}.csv", labelled=True)
    words = ("--sensor", sensor, "--columns", "time=timestamp:ms", "--json")
    out, _ = run(capsys, "evaluate", "builtin:any", "in", *words)
    report = json.loads(out)
    assert [recording["name"] for recording in report["recordings"]] == ["a", "b"]
    assert report["events"]["hand"]["n_events"] == 4  # pushes and releases
    assert report["pooled"]["accuracy"] > 90
    one = run(capsys, "evaluate", "builtin:any", "in/a.csv", *words).out
    assert json.loads(one)["pooled"]["n"] == report["pooled"]["n"] / 2


def pasted(err):
    """Return the words of the command of a proposal."""
    command = COMMAND.search(err)[1].replace("\\\n", "")
    return [shlex.split(part)[1:] for part in command.split("&&")]


def test_detect_proposes_its_own_command(folder, sensor, capsys):
    write_press(folder / "press log.csv")
    _, err = run(capsys, "detect", "builtin:any", "press log.csv", "--sensor", sensor, code=2)
    (words,) = pasted(err)
    assert words[:3] == ["detect", "builtin:any", "press log.csv"]
    assert words[3:] == ["--sensor", sensor, "--columns", "time=timestamp:ms"]
    run(capsys, *words)


@pytest.mark.parametrize("verb", [["info"], ["label"]])
def test_verbs_of_recordings_propose_the_import_before_themselves(folder, capsys, verb):
    write_press(folder / "press.csv")
    _, err = run(capsys, *verb, "press.csv", code=2)
    first, second = pasted(err)
    assert first[:3] == ["import", "press.csv", "recordings"]
    assert second == [*verb, "recordings"]
    run(capsys, *first)
    assert (folder / "recordings" / "press.parquet").is_file()
