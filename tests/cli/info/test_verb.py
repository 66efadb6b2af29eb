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


VERB = Verb("info")
refusal, info_json = VERB.refusal, VERB.document


def test_json_of_a_recording(capsys, path, grasp):
    document = info_json(capsys, path)
    thumb = document["modules"].pop("thumb")
    assert list(document["modules"]) == ["index"]
    del document["modules"]
    assert document == {
        "name": "grasp",
        "start": grasp.start,
        "duration": grasp.duration,
        "complete": True,
        "metadata": dict(grasp.metadata),
        "markers": [{"time": 1.5, "text": "closing"}, {"time": 5.3, "text": "shaken"}],
        "media": [{"path": "grasp.mp4", "offset": 0.25}],
        "truth": {
            "n_samples": grasp.modules["thumb"].n_samples,
            "hand": ["phase"],
            "fingers": {"thumb": ["slip_speed"]},
        },
        "digest": grasp.digest,
        "findings": [],
    }
    labels = {"stable": 0.0, "unstable": 0.0, "no_contact": 0.0}
    for label in grasp.modules["thumb"].labels:
        labels[label.state.lower()] += label.end - label.start
    assert thumb == {
        "sensor": "uskin-curved",
        "n_taxels": 30,
        "unit": "count",
        "n_samples": grasp.modules["thumb"].n_samples,
        "rate": pytest.approx(150.0),
        "gaps": 0,
        "repeats": 0,
        "drift": None,
        "labels": pytest.approx(labels),
        "faults": {},
    }


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


def test_a_module_without_samples(capsys, grasp, tmp_path):
    thumb = grasp.modules["thumb"]
    both = {"thumb": thumb, "index": replace(thumb, labels=()).slice(0, 0)}
    save_recording(Recording("a", both), tmp_path / "a.parquet")
    assert info_json(capsys, tmp_path / "a.parquet")["modules"]["index"]["n_samples"] == 0
    assert main(["info", str(tmp_path / "a.parquet"), "--plot", str(tmp_path / "a.svg")]) == 0


def test_the_table(capsys, path):
    assert main(["info", str(path)]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert re.search(r"^duration +\d+\.\d{3} s from 0\.000 s$", out, re.MULTILINE)
    assert re.search(r"^complete +yes$", out, re.MULTILINE)
    assert re.search(r"^notes +very [^\n]*\n +very .*\.\.\.$", out, re.MULTILINE)
    assert re.search(r"^truth +phase, thumb\.slip_speed$", out, re.MULTILINE)
    assert re.search(r"^thumb +uskin-curved +30 +count +1725 +150\.0 +0 +0$", out, re.MULTILINE)
    assert re.search(r"^thumb( +\d\.\d\d){3} +- +none$", out, re.MULTILINE)
    assert re.search(r"^ +5\.300 +shaken$", out, re.MULTILINE)
    assert max(map(len, out.splitlines())) <= 80


def test_the_tables_fit_with_long_names(capsys, grasp, tmp_path):
    name = "2025-11-22_grasp-of-the-red-carton_case2_repetition-01"
    modules = {f"{name}_{'of_the_left_hand_' * 3}": m for name, m in grasp.modules.items()}
    path = tmp_path / f"{name}.parquet"
    save_recording(replace(grasp, modules=modules), path)
    for given in (path, tmp_path):
        assert main(["info", str(given)]) == 0
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= 80
        assert re.search(r" (150\.0|0\.00) ", out)


def test_markers_since_1970_are_shown_since_the_first_sample(capsys, grasp, tmp_path):
    times = grasp.modules["thumb"].times + 1795364053.99
    modules = {name: Tactile(m.sensor, times, m.readings) for name, m in grasp.modules.items()}
    markers = ((1795364059.29, "shaken"),)
    late = replace(grasp, modules=modules, markers=markers, truth=None)
    save_recording(late, tmp_path / "late.parquet")
    assert main(["info", str(tmp_path / "late.parquet")]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^markers since the first sample$", out, re.MULTILINE)
    assert re.search(r"^ +5\.300 +shaken$", out, re.MULTILINE)


def test_findings_are_listed(capsys, grasp, path):
    save_labels(grasp, path, author="rule:signal")
    save_recording(replace(grasp, metadata={"starts_loaded": True}), path, force=True)
    assert [one["kind"] for one in info_json(capsys, path)["findings"]] == [
        "starts_loaded", "hidden_labels",
    ]  # fmt: skip
    assert main(["info", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    findings = lines[lines.index("findings:") + 1 :]
    assert (
        findings[0]
        == "- begins in contact (metadata: starts_loaded): the first samples are load (give"
    )
    assert max(map(len, findings)) <= 80
    assert main(["info", str(path.parent)]) == 0
    out = capsys.readouterr().out
    assert out.rstrip().endswith(" starts_loaded, hidden_labels")
    assert max(map(len, out.splitlines())) <= 80


def test_a_cut_file_is_shown(capsys, grasp, tmp_path):
    save_recording(grasp, tmp_path / "a.mcap")
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(data[: len(data) // 2])
    assert main(["info", str(tmp_path / "a.mcap")]) == 0
    assert "no: the end of the file is cut off" in capsys.readouterr().out
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

    def test_damaged_ones_are_named_and_the_rest_shown(self, capsys, path):
        broken = path.with_name("broken.parquet")
        broken.write_bytes(b"")
        message = f"{broken} is empty (0 bytes); a Parquet recording expected"
        assert main(["info", str(path.parent), "--json"]) == 2
        out, err = capsys.readouterr()
        assert err == f"holdfast: {message}\n"
        first, second = json.loads(out)["recordings"]
        assert first == {"name": "broken", "error": message}
        assert second["name"] == "grasp"
        assert main(["info", str(path.parent)]) == 2
        assert re.search(r"^broken .* unreadable$", capsys.readouterr().out, re.M)

    def test_refusals(self, capsys, tmp_path):
        assert refusal(capsys, tmp_path) == (
            f"no recording in {tmp_path} (0 other entries); files *.parquet or *.mcap expected: "
            "`holdfast import` makes them"
        )
        assert refusal(capsys, tmp_path, "--plot", "a.svg") == (
            f"--plot draws one recording; the folder {tmp_path} given"
        )


@pytest.mark.parametrize(
    ("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")]
)
def test_plots(suffix, magic, capsys, path):
    plot = path.with_name(f"plot{suffix}")
    assert main(["info", str(path), "--plot", str(plot), "--tare", "first", "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == f"{plot} written\n"
    assert json.loads(out)["name"] == "grasp"
    assert plot.read_bytes().startswith(magic)


def test_a_plot_is_not_overwritten(capsys, path):
    plot = path.with_name("a.svg")
    plot.write_text("mine")
    assert refusal(capsys, path, "--plot", plot) == (
        f"{plot} exists already: choose another name, or give --force"
    )
    assert plot.read_text() == "mine"
    assert main(["info", str(path), "--plot", str(plot), "--force"]) == 0
    assert plot.read_text() != "mine"


def test_refusals(capsys, path):
    missing = path.with_name("none")
    assert refusal(capsys, missing) == f"{missing} does not exist; a recording's file expected"
    assert refusal(capsys, path, "--plot", "a.txt") == (
        "a plot ends in .pdf, .png, .svg; 'a.txt' given"
    )
    assert refusal(capsys, path, "--tare", "90:91") == (
        "thumb of 'grasp', which runs from 0 to 11.4933333333333 s: "
        "tare 90:91: no finite sample in that time"
    )
    data = bytearray(path.read_bytes())
    data[1000] ^= 1
    path.write_bytes(data)
    assert refusal(capsys, path) == f"{path} is damaged: its content does not match its checksum"


def test_all_heads_of_a_model_are_shown(capsys):
    assert main(["info", "builtin:twin"]) == 0
    out = re.sub(r"\s+", " ", capsys.readouterr().out)
    heads = info_json(capsys, "builtin:twin")["fingers"]["*"]["heads"]
    assert list(heads) == ["stable", "slip", "slip_speed", "cause"]
    stable, slip, speed, cause = heads.values()
    for head, n in ((stable, 15), (slip, 39), (speed, 39), (cause, 15)):
        assert len(head["features"]) == n
        assert f"{head['name']}: linear, {n} features; " in out
    assert f" features {', '.join(stable['features'][:3])}, ..." in out
    own = r"of them new relative\(second_all\[0\.0067 s\]\), "
    for name in ("slip", "slip_speed"):
        assert re.search(f" {name}: linear, 39 features; [^:]* {own}", out)
    assert f"STABLE from a probability of {stable['threshold']:.3g} on" in out
    assert f"slides from a probability of {slip['threshold']:.3g} on; smoothing 0.02 s, hold" in out
    assert f"speed and distance of slips, up to {speed['highest']:.3g} mm/s" in out
    assert ", ".join(cause["classes"]) in out
    choice = slip["choice"]
    assert (
        f"threshold from the training, out of fold: {choice['false_alarms_per_minute']:.2g}" in out
    )
    assert f"; {choice['n']} slips; {choice['found']:.0f} % found within 0.1 s" in out
    assert (stable["choice"], "threshold" in speed, "threshold" in cause) == (None, False, False)
    heads = info_json(capsys, "builtin:any")["fingers"]["*"]["heads"]
    assert list(heads) == ["stable", "slip", "cause"]
    assert heads["slip"]["features"] == heads["stable"]["features"]


def test_a_model_without_a_figure_is_refused(capsys, path):
    assert refusal(capsys, path, "--model", "builtin:twin") == (
        "--model is for the figure; --plot FILE expected beside it"
    )


def test_parts_of_any_size_give_the_same(capsys, path, monkeypatch):
    whole = info_json(capsys, path)
    for n_samples in (1, 100):
        monkeypatch.setattr("holdfast.labelling.review.content.SAMPLES_OF_PART", n_samples)
        assert info_json(capsys, path) == whole


@pytest.mark.parametrize("suffix", ["parquet", "mcap"])
def test_a_recording_that_is_too_large_to_load(capsys, tmp_path, monkeypatch, suffix):
    n, path = 140_000, tmp_path / f"long.{suffix}"
    readings = np.random.default_rng(0).normal(0, 3, (n, 5, 3))
    save_recording(
        Recording("long", {"a": Tactile(sensor("anyskin"), np.arange(n) / 100, readings)}), path
    )
    expected = info_json(capsys, path)
    monkeypatch.setattr("holdfast.io.safe_reading.MAX_RECORDING", readings.nbytes)
    assert info_json(capsys, path) == expected
    assert expected["modules"]["a"]["n_samples"] == n
    assert main(["evaluate", "builtin:any", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "`holdfast info` and `detect`, and `read_chunks` in Python, read it in parts" in line
