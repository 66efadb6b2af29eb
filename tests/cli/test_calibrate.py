"""`holdfast calibrate`: what it writes and prints."""

import json

import msgspec
import pytest

from command_line import Verb
from holdfast.detection import Model
from holdfast.devices import sources
from holdfast.devices.sources.replay import ReplaySource
from holdfast.io import load_recording, save_recording
from holdfast.sensors import flat_sensor
from holdfast.training import calibrate
from training.build import handling_recording, normalised_model

pytestmark = pytest.mark.slow

SECONDS = 32.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A normalised model, and two recordings of handling."""
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "data").mkdir()
    normalised_model().save(folder / "model.json")
    for k in range(2):
        recording = handling_recording(k, held=SECONDS / 2 + 3)
        save_recording(recording, folder / "data" / f"{recording.name}.mcap")
    return folder


run = Verb().run


def calibrated(capsys, folder, out, *words, data="data"):
    return run(capsys, "calibrate", folder / "model.json", folder / data, "-o", out, *words)


@pytest.fixture(scope="module")
def mine(folder):
    """The model, calibrated by the recordings."""
    recordings = [load_recording(path) for path in sorted((folder / "data").iterdir())]
    model = calibrate(Model.load(folder / "model.json"), recordings)
    model.save(folder / "mine.json")
    return model


def test_it_is_the_library_that_calibrates(capsys, folder, mine, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, printed, err = calibrated(capsys, folder, "mine.json")
    assert (code, err) == (0, "")
    assert Model.load("mine.json") == mine
    lines = printed.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert " ".join(lines).partition("Next: ")[2].endswith("holdfast detect mine.json SOURCE")


def test_json(capsys, folder, tmp_path):
    out = tmp_path / "mine.json"
    code, printed, err = calibrated(capsys, folder, out, "--json", "--false-alarms", 4)
    report = json.loads(printed)
    assert (code, err) == (0, "")
    assert set(report) == {"model", "sensors", "warnings", "next"}
    (seen,) = report["sensors"]
    assert set(seen) == {
        "sensor", "fingers", "seconds", "load_change", "n_features", "n_changed", "activity",
        "still", "before", "after", "slips",
    }  # fmt: skip
    (slips,) = seen["slips"]
    assert slips["n"] <= 4 * slips["minutes"]
    assert len(slips["highest"]) == 5
    handling = Model.load(out).fingers["*"].handling["pad"]
    assert handling.thresholds["stable"] == seen["after"]["threshold"]


def test_info_shows_own_handling(capsys, folder, mine):
    text = " ".join(run(capsys, "info", folder / "mine.json")[1].split())
    handling = mine.fingers["*"].handling["pad"]
    assert "(handling-0, handling-1)" in text
    assert text.count(f"STABLE from {handling.thresholds['stable']:.3g} on") == 1
    document = json.loads(run(capsys, "info", folder / "mine.json", "--json")[1])
    assert document["fingers"]["*"]["normalised"] is True
    own = document["fingers"]["*"]["handling"]["pad"]
    assert own["recordings"] == ["handling-0", "handling-1"]


def test_a_live_source_is_recorded_for_a_time(capsys, folder, tmp_path, monkeypatch):
    save_recording(handling_recording(3, held=20.0), tmp_path / "hand.mcap")
    hand = ReplaySource(tmp_path / "hand.mcap", speed=0)
    monkeypatch.setattr(sources, "open_source", lambda *_, **__: hand)
    words = (folder / "model.json", "xela://auto", "-o", tmp_path / "live.json", "--seconds", 12)
    code, _, err = run(capsys, "calibrate", *words)
    assert code == 0, err
    assert "pad: 11 s of holding" in err
    assert "\n10 of 12 s, held 9 s\n" in err
    handling = Model.load(tmp_path / "live.json").fingers["*"].handling["pad"]
    assert handling.seconds == pytest.approx(10.8, abs=0.5)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["hand.mcap", "live.json"]


@pytest.mark.parametrize(
    ("given", "opened"),
    [
        ("twin:", ("twin:?profile=handling", True)),
        ("twin:?seed=3", ("twin:?seed=3&profile=handling", True)),
        ("twin:?profile=gentle", ("twin:?profile=gentle", True)),
        ("xela://auto", ("xela://auto", False)),
    ],
)
def test_the_twin_handles_until_the_time_is_over(
    capsys, folder, tmp_path, monkeypatch, given, opened
):
    seen = []

    def open_source(uri, *, speed, loop):
        seen.append((uri, loop))
        raise ValueError("seen")

    monkeypatch.setattr(sources, "open_source", open_source)
    words = (folder / "model.json", given, "-o", tmp_path / "live.json")
    assert run(capsys, "calibrate", *words)[0] == 2
    assert seen == [opened]


@pytest.mark.parametrize("verb", ["detect", "evaluate", "tune"])
def test_on_another_sensor_it_says_so_and_uses_the_default(capsys, folder, mine, tmp_path, verb):
    part = mine.fingers["*"]
    part = msgspec.structs.replace(part, handling={"uskin-4x4": part.handling["pad"]})
    msgspec.structs.replace(mine, fingers={"*": part}).save(tmp_path / "other.json")
    data = folder / "data" / "handling-0.mcap"
    options = {"detect": ["--summary", "--json"], "evaluate": ["--json"]}
    words = options.get(verb, ["-o", tmp_path / "new.json", "--false-alarms", 1])
    _, printed, err = run(capsys, verb, tmp_path / "other.json", data, *words)
    (notice,) = [line for line in err.splitlines() if "holdfast calibrate" in line]
    assert "uskin-4x4" in notice and "pad" in notice
    if verb == "detect":
        usual = json.loads(run(capsys, verb, folder / "model.json", data, *words)[1])
        assert json.loads(printed)["fingers"] == usual["fingers"]
        assert notice not in run(capsys, verb, folder / "mine.json", data, *words)[2]


COUNTS = flat_sensor("skin", 3, 3, 0.005, 100.0, "count")
"""A sensor whose readings without contact are not known of a recording that begins in contact."""


def test_handling_in_contact_sets_the_threshold_of_changes(capsys, tmp_path):
    made = handling_recording(0, held=20.0, sensor=COUNTS, force=900.0)
    save_recording(made, tmp_path / "own.mcap")
    words = ("builtin:any", tmp_path / "own.mcap", "-o", tmp_path / "mine.json", "--in-contact")
    (sensor,) = json.loads(run(capsys, "calibrate", *words, "--json")[1])["sensors"]
    assert [slips["head"] for slips in sensor["slips"]] == ["slip_changes"]


def test_still_handling_is_saved_by_force(capsys, folder, tmp_path):
    save_recording(handling_recording(0, held=36.0, sway=0.0), tmp_path / "still.mcap")
    out = tmp_path / "mine.json"
    out.write_text("mine")
    assert calibrated(capsys, folder, out, "--force", data=tmp_path / "still.mcap")[0] == 0
    assert Model.load(out)
