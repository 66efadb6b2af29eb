from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause
from holdfast.io import labels_path, load_recording, save_labels
from holdfast.recordings import Label

from .helpers import run, run_json, save_manual_labels


def test_agreement_of_a_folder_with_itself_and_with_a_rule(capsys, folder):
    same = run_json(capsys, "--compare", folder, folder)
    assert [each["name"] for each in same["recordings"]] == ["one", "two"]
    for each in same["recordings"]:
        assert {name: one["kappa"] for name, one in each["fingers"].items()} == {
            "thumb": 1.0, "index": 1.0,
        }  # fmt: skip
    assert same["left_out"] == {}
    rule = run_json(capsys, "--compare", folder, "signal")
    kappas = [one["kappa"] for each in rule["recordings"] for one in each["fingers"].values()]
    assert all(0.5 < kappa <= 1 for kappa in kappas)
    assert rule["pooled"]["kappa"] == pytest.approx(sum(kappas) / 4, abs=0.1)
    other = run_json(capsys, "--compare", "signal", folder)
    assert other["pooled"]["kappa"] == rule["pooled"]["kappa"]


def test_agreement_of_label_files(capsys, folder):
    path, eve = folder / "one.parquet", folder.parent / "eve"
    save_manual_labels(path)
    eve.mkdir()
    shifted = {
        name: [
            replace(label, start=label.start + 0.1, end=label.end + 0.1) if label.end < 11 else
            replace(label, start=label.start + 0.1)
            for label in module.labels
        ]
        for name, module in load_recording(path).modules.items()
    }  # fmt: skip
    save_labels(load_recording(path).with_labels(shifted), eve / "one.parquet", author="eve")
    found = run_json(capsys, "--compare", labels_path(path), eve / "one.labels.json")
    thumb = found["recordings"][0]["fingers"]["thumb"]
    assert 0.5 < thumb["kappa"] < 1
    assert thumb["onset_differences"]["median"] == pytest.approx(0.1)
    folders = run_json(capsys, "--compare", folder, eve)
    assert folders["recordings"] == found["recordings"]
    assert list(folders["left_out"]) == ["two"]
    code, out, err = run(capsys, "--compare", eve, folder)
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80
    row = next(line for line in out.splitlines() if line.startswith("one "))
    assert row.split()[:3] == ["one", "thumb", f"{thumb['kappa']:.3f}"]
    assert "-100" in out
    assert err.startswith("two is left out: no labels of 'two' in ")


def test_causes_are_counted_by_sample(capsys, folder):
    """A has a slip within a disturbance; B calls all of it a disturbance."""
    path, eve = folder / "one.parquet", folder.parent / "eve"
    eve.mkdir()
    recording = load_recording(path, labels=False)
    times = recording.modules["thumb"].times
    start, slip, back, end = (float(times[k]) for k in (300, 400, 430, 500))
    whole = [Label(start, end, "UNSTABLE", "disturbance")]
    cut = [
        Label(start, slip, "UNSTABLE", "disturbance"),
        Label(slip, back, "UNSTABLE", "slip"),
        Label(back, end, "UNSTABLE", "disturbance"),
    ]
    save_labels(recording.with_labels({"thumb": cut}), path, force=True)
    save_labels(recording.with_labels({"thumb": whole}), eve / "one.parquet")
    found = run_json(capsys, "--compare", labels_path(path), eve / "one.labels.json")["pooled"]
    expected = np.zeros((len(Cause), len(Cause)), dtype=int)
    disturbance, slip_place = (list(Cause).index(name) for name in ("disturbance", "slip"))
    expected[disturbance, disturbance], expected[slip_place, disturbance] = 170, 30
    assert found["causes"] == expected.tolist()
    assert found["kappa_cause"] == 0.0
    _, out, _ = run(capsys, "--compare", labels_path(path), eve / "one.labels.json")
    rows = [line.split() for line in out.splitlines()]
    at = rows.index(["cause", "disturbance"])
    table = [row for row in rows[at + 1 :] if row and row[0] in ("disturbance", "slip")]
    assert table == [["disturbance", "170"], ["slip", "30"]]
    assert "their kappa is 0.000" in " ".join(out.split())
