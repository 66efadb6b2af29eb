import json
import re
from dataclasses import replace

import numpy as np
import pytest

from command_line import Verb
from holdfast.cli import main
from holdfast.io import save_labels, save_recording
from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import sensor
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def grasp():
    """A grasp with a marker, truth and metadata."""
    recording = synthetic_recording("grasp", 1, ("thumb", "index"))
    times = recording.modules["thumb"].times
    return replace(
        recording,
        metadata={"object": "can", "notes": "very " * 30 + "long"},
        markers=((1.5, "closing"), (5.3, "shaken")),
        media=(("grasp.mp4", 0.25),),
        truth=Truth(times, {"phase": np.zeros(len(times))}, {"thumb": {"slip_speed": 0 * times}}),
    )


@pytest.fixture
def path(grasp, tmp_path):
    save_recording(grasp, tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


info_json = Verb("info").document


def test_json_of_a_recording(capsys, path, grasp):
    document = info_json(capsys, path)
    thumb = document["modules"]["thumb"]
    assert list(document["modules"]) == ["thumb", "index"]
    for field in ("name", "start", "duration", "complete", "metadata", "digest"):
        assert document[field] == getattr(grasp, field)
    assert document["markers"][1] == {"time": 5.3, "text": "shaken"}
    assert document["media"] == [{"path": "grasp.mp4", "offset": 0.25}]
    n = grasp.modules["thumb"].n_samples
    assert document["truth"] == {
        "n_samples": n, "hand": ["phase"], "fingers": {"thumb": ["slip_speed"]}
    }  # fmt: skip
    labels = {"stable": 0.0, "unstable": 0.0, "no_contact": 0.0}
    for label in grasp.modules["thumb"].labels:
        labels[label.state.lower()] += label.end - label.start
    assert thumb.pop("labels") == pytest.approx(labels)
    assert thumb == {
        "sensor": "uskin-curved", "n_taxels": 30, "unit": "count", "n_samples": n, "gaps": 0,
        "rate": pytest.approx(150.0), "repeats": 0, "drift": None, "faults": {},
    }  # fmt: skip


def test_gaps_repeats_and_faults(capsys, tmp_path):
    rng = np.random.default_rng(0)
    readings = rng.integers(100, 200, (300, 5, 3)).astype(float)
    readings[50] = readings[49]
    readings[100, 2, 1] = np.nan
    times = np.arange(300) / 100 + np.where(np.arange(300) < 200, 0, 1.0)
    module = Tactile(sensor("anyskin"), times, readings)
    save_recording(Recording("a", {"finger1": module}), tmp_path / "a.parquet")
    found = info_json(capsys, tmp_path / "a.parquet")["modules"]["finger1"]
    assert (found["gaps"], found["repeats"], found["faults"]) == (1, 1, {"not_finite": 1})


def test_markers_since_1970_are_shown_since_the_first_sample(capsys, grasp, tmp_path):
    times = grasp.modules["thumb"].times + 1795364053.99
    modules = {name: Tactile(m.sensor, times, m.readings) for name, m in grasp.modules.items()}
    markers = ((1795364059.29, "shaken"),)
    late = replace(grasp, modules=modules, markers=markers, truth=None)
    save_recording(late, tmp_path / "late.parquet")
    assert main(["info", str(tmp_path / "late.parquet")]) == 0
    assert re.search(r"^ +5\.300 +shaken$", capsys.readouterr().out, re.MULTILINE)


def test_findings_are_listed(capsys, grasp, path):
    save_labels(grasp, path, author="rule:signal")
    save_recording(replace(grasp, metadata={"starts_loaded": True}), path, force=True)
    assert [one["kind"] for one in info_json(capsys, path)["findings"]] == [
        "starts_loaded", "hidden_labels",
    ]  # fmt: skip
    for given in (path, path.parent):
        assert main(["info", str(given)]) == 0
        out = capsys.readouterr().out
        assert "starts_loaded" in out
        assert max(map(len, out.splitlines())) <= 80


def test_a_cut_file_is_shown(capsys, grasp, tmp_path):
    save_recording(grasp, tmp_path / "a.mcap")
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(data[: len(data) // 2])
    assert main(["info", str(tmp_path / "a.mcap")]) == 0
    assert "cut off" in capsys.readouterr().out
    assert info_json(capsys, tmp_path / "a.mcap")["complete"] is False


class TestFolder:
    def test_all_recordings_by_name(self, capsys, grasp, path):
        save_recording(replace(grasp, name="b"), path.with_name("b.mcap"))
        path.with_name("notes.txt").write_text("mine")
        documents = info_json(capsys, path.parent)["recordings"]
        assert [one["name"] for one in documents] == ["b", "grasp"]
        assert documents[1] == info_json(capsys, path)
        assert main(["info", str(path.parent)]) == 0
        assert re.search(r"^grasp +2 +\d+ +150\.0 .* ok$", capsys.readouterr().out, re.M)


def test_a_plot_is_overwritten_only_by_force(capsys, path):
    plot = path.with_name("a.svg")
    words = ["info", str(path), "--plot", str(plot), "--tare", "first", "--model", "builtin:any"]
    assert main([*words, "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == f"{plot} written\n"
    assert json.loads(out)["name"] == "grasp"
    plot.write_text("mine")
    assert main([*words, "--force"]) == 0
    assert plot.read_bytes().startswith(b"<?xml")


class TestModel:
    @pytest.mark.parametrize("name", ["builtin:any", "builtin:twin", "builtin:noise-floor"])
    def test_all_heads_are_shown(self, capsys, name):
        assert main(["info", name]) == 0
        out = capsys.readouterr().out
        assert all(len(line) <= 80 for line in out.splitlines())
        text = " ".join(out.split())
        for head in info_json(capsys, name)["fingers"]["*"]["heads"].values():
            assert f" {head['name']}: " in text
            if 0.0 < (head.get("threshold") or 0.0) < 1.0:
                assert f"from a probability of {head['threshold']:.3g} on" in text


def test_parts_of_any_size_give_the_same(capsys, path, monkeypatch):
    whole = info_json(capsys, path)
    for n_samples in (50, 400):
        monkeypatch.setattr("holdfast.labelling.review.content.SAMPLES_OF_PART", n_samples)
        assert info_json(capsys, path) == whole


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_a_recording_that_is_too_large_to_load(capsys, tmp_path, monkeypatch, suffix):
    n, path = 20_000, tmp_path / f"long.{suffix}"
    readings = np.random.default_rng(0).normal(0, 3, (n, 5, 3))
    save_recording(
        Recording("long", {"a": Tactile(sensor("anyskin"), np.arange(n) / 100, readings)}), path
    )
    expected = info_json(capsys, path)
    monkeypatch.setattr("holdfast.io.safe_reading.MAX_RECORDING", readings.nbytes)
    assert info_json(capsys, path) == expected
    assert expected["modules"]["a"]["n_samples"] == n
    assert "holdfast info" in Verb("evaluate").refusal(capsys, "builtin:any", path)
