"""`holdfast calibrate`: what it writes, prints and refuses."""

import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from command_line import Verb
from holdfast.devices import sources
from holdfast.devices.sources import Arrival
from holdfast.devices.sources.base import Source
from holdfast.io import load_recording, save_recording
from holdfast.model import Model
from holdfast.training import calibrate
from training.build import PAD, handling_recording, normalised_model

pytestmark = pytest.mark.slow

SECONDS = 32.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A normalised model, and two recordings of handling."""
    place = tmp_path_factory.mktemp("calibrate")
    (place / "data").mkdir()
    normalised_model().save(place / "model.json")
    for k in range(2):
        recording = handling_recording(k, held=SECONDS / 2 + 3)
        save_recording(recording, place / "data" / f"{recording.name}.mcap")
    return place


run = Verb().run


def calibrated(capsys, folder, out, *words, data="data"):
    return run(capsys, "calibrate", folder / "model.json", folder / data, "-o", out, *words)


def test_the_screen(capsys, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.chdir(tmp_path)
    code, printed, err = calibrated(capsys, folder, "mine.json")
    assert (code, err) == (0, "")
    lines = printed.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    text = " ".join(printed.split())
    assert text.startswith("pad: held ")
    assert "(thumb 40 s, index 40 s)" in text
    assert "of 31 features differ" in text
    assert "the force changed by " in text
    assert "threshold of STABLE" in text
    assert lines[-1] == "mine.json: builtin:any, calibrated"
    recordings = [load_recording(folder / "data" / f"handling-{k}.mcap") for k in range(2)]
    assert Model.load("mine.json") == calibrate(Model.load(folder / "model.json"), recordings)


def test_handling_that_begins_in_contact(capsys, tmp_path):
    """The first second of a hold is load only if it is declared: the hand is never seen open."""
    normalised_model().save(tmp_path / "model.json")
    whole = handling_recording(0, held=20.0)
    modules = {
        name: module.slice(*np.searchsorted(module.times, (4.0, 18.0)))
        for name, module in whole.modules.items()
    }
    (tmp_path / "data").mkdir()
    save_recording(replace(whole, modules=modules), tmp_path / "data" / "held.mcap")
    seconds = []
    for words in ([], ["--in-contact"]):
        out = tmp_path / f"mine{len(words)}.json"
        code, printed, _ = calibrated(capsys, tmp_path, out, "--json", *words)
        seconds.append(json.loads(printed)["sensors"][0]["seconds"] if code == 0 else 0.0)
    assert seconds[1] > 12.0
    assert seconds[0] < seconds[1]


def test_json(capsys, folder, tmp_path):
    out = tmp_path / "mine.json"
    code, printed, err = calibrated(capsys, folder, out, "--json", "--false-alarms", 4)
    report = json.loads(printed)
    assert (code, err) == (0, "")
    assert set(report) == {"model", "sensors", "warnings"}
    (seen,) = report["sensors"]
    assert set(seen) == {
        "sensor", "fingers", "seconds", "load_change", "n_features", "n_changed", "activity",
        "still", "before", "after",
    }  # fmt: skip
    assert seen["after"]["alarms_per_minute"] <= 4
    handling = Model.load(out).fingers["*"].handling["pad"]
    assert handling.thresholds["stable"] == seen["after"]["threshold"]


def test_info_shows_own_handling(capsys, folder, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    out = tmp_path / "mine.json"
    assert calibrated(capsys, folder, out)[0] == 0
    _, printed, _ = run(capsys, "info", out)
    text = " ".join(printed.split())
    assert "own handling of pad: 39." in text
    assert "s held in 2 recordings (handling-0, handling-1); STABLE from" in text
    handling = Model.load(out).fingers["*"].handling["pad"]
    silent = "reports no slip until it is taught (holdfast teach)"
    assert f"STABLE from {handling.thresholds['stable']:.3g} on; {silent}" in text
    assert text.count("STABLE from") == text.count(silent) == 1
    part = Model.load(out).fingers["*"].without_thresholds("stable")
    tuned = msgspec.structs.replace(Model.load(out), fingers={"*": part})
    tuned.save(tmp_path / "tuned.json")
    _, printed, _ = run(capsys, "info", tmp_path / "tuned.json")
    shown = f"; STABLE from {part.stable.threshold:.3g} on; {silent}"
    assert shown in " ".join(printed.split())
    document = json.loads(run(capsys, "info", out, "--json")[1])["fingers"]["*"]
    assert document["normalised"] is True
    assert document["handling"]["pad"]["recordings"] == ["handling-0", "handling-1"]
    _, printed, _ = run(capsys, "info", folder / "model.json")
    assert "features normalised by default handling" in " ".join(printed.split())


def test_a_single_short_recording_is_a_warning(capsys, folder, tmp_path):
    save_recording(handling_recording(5), tmp_path / "one.mcap")
    out = tmp_path / "mine.json"
    code, _, err = calibrated(capsys, folder, out, data=tmp_path / "one.mcap")
    assert code == 0
    assert err == "pad: 9 s of holding; 30 s or more are better\n"


class Hand(Source):
    """Source that sends a recording once."""

    name = "xela://fake"
    paced = False

    def __init__(self, recording):
        self.sensors = dict.fromkeys(recording.modules, PAD)
        thumb, index = recording.modules.values()
        self._arrivals = [
            Arrival(float(time), {"thumb": one, "index": two}, received=float(time))
            for time, one, two in zip(thumb.times, thumb.readings, index.readings, strict=True)
        ]

    def open(self):
        pass

    def close(self):
        pass

    def read(self, timeout):
        return self._arrivals.pop(0) if self._arrivals else None

    @property
    def ended(self):
        return not self._arrivals


def test_a_live_source_is_recorded_for_a_time(capsys, folder, tmp_path, monkeypatch):
    hand = Hand(handling_recording(3, held=20.0))
    monkeypatch.setattr(sources, "open_source", lambda *_, **__: hand)
    out = tmp_path / "live.json"
    code, _, err = run(
        capsys, "calibrate", folder / "model.json", "xela://auto", "-o", out, "--seconds", 12
    )
    assert code == 0, err
    assert "pad: 11 s of holding; 30 s or more are better" in err
    assert "\nheld 9 of 30 s\n" in err
    assert "q stops" not in err
    assert "handling.mcap" not in err
    assert Model.load(out).fingers["*"].handling["pad"].seconds == pytest.approx(10.8, abs=0.5)
    assert [path.name for path in tmp_path.iterdir()] == ["live.json"]


def test_a_live_source_that_sends_nothing(capsys, folder, tmp_path, monkeypatch):
    hand = Hand(handling_recording(3))
    hand._arrivals = []
    monkeypatch.setattr(sources, "open_source", lambda *_, **__: hand)
    words = ["calibrate", folder / "model.json", "xela://auto", "-o", tmp_path / "no.json"]
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert err.splitlines()[-1] == ("holdfast: xela://fake sent no samples: nothing was recorded")
    assert not list(tmp_path.iterdir())


BAD = {
    "slip": ({"slip": 0.9}, "pad: most of this handling looks like slip"),
    "empty": ({"force": 0.0}, "nothing is held in 1 recording"),
    "still": ({"held": 36.0, "sway": 0.0}, "pad: the arm hardly moved; move the arm as it will "),
    "short": ({"held": 2.5}, "s of holding given, at least 5 s expected"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_handling_is_one_line(capsys, folder, tmp_path, kind):
    options, message = BAD[kind]
    save_recording(handling_recording(0, **options), tmp_path / "bad.mcap")
    code, out, err = calibrated(capsys, folder, tmp_path / "no.json", data=tmp_path / "bad.mcap")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("holdfast: ")
    assert message in err
    assert not (tmp_path / "no.json").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("builtin:twin", "data"), "was not trained on normalised features"),
        (("model.json", "nothing"), "there is no folder"),
        (("model.json", "data", "--seconds", "9"), "--seconds and --speed are for live sources"),
        (("model.json", "xela://auto", "--seconds", "0"), "--seconds: more than 0 s expected"),
        (("model.json", "data", "--false-alarms", "-1"), "of at least 0 expected, -1 given"),
        (("model.json", "hand"), "the source hand was removed"),
    ],
)
def test_bad_input_is_one_line(capsys, folder, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(folder)
    code, out, err = run(capsys, "calibrate", *words, "-o", tmp_path / "no.json")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not (tmp_path / "no.json").exists()


def test_a_model_is_overwritten_only_by_force(capsys, folder, tmp_path):
    out = tmp_path / "mine.json"
    out.write_text("mine")
    code, _, err = calibrated(capsys, folder, out)
    assert code == 2
    assert "mine.json exists" in err
    assert out.read_text() == "mine"
    assert calibrated(capsys, folder, out, "--force")[0] == 0


@pytest.mark.parametrize("verb", ["detect", "evaluate", "tune"])
def test_on_another_sensor_it_says_so_and_uses_the_default(capsys, folder, tmp_path, verb):
    out = tmp_path / "mine.json"
    assert calibrated(capsys, folder, out)[0] == 0
    part = Model.load(out).fingers["*"]
    handling = {"uskin-4x4": part.handling["pad"]}
    part = msgspec.structs.replace(part, handling=handling)
    model = msgspec.structs.replace(Model.load(out), fingers={"*": part})
    model.save(tmp_path / "other.json")
    data = folder / "data" / "handling-0.mcap"
    options = {"detect": ["--summary", "--json"], "evaluate": ["--json"]}
    words = options.get(verb, ["-o", tmp_path / "new.json", "--false-alarms", 1])
    _, printed, err = run(capsys, verb, tmp_path / "other.json", data, *words)
    notice = (
        "builtin:any, calibrated was calibrated on uskin-4x4, not on pad: default handling is used "
        "(holdfast calibrate)\n"
    )
    assert err.count(notice) == 1
    if verb == "detect":
        usual = json.loads(run(capsys, verb, folder / "model.json", data, *words)[1])
        assert json.loads(printed)["fingers"] == usual["fingers"]
        assert notice not in run(capsys, verb, out, data, *words)[2]


def test_still_handling_is_saved_only_by_force(capsys, folder, tmp_path):
    save_recording(handling_recording(0, held=36.0, sway=0.0), tmp_path / "still.mcap")
    out = tmp_path / "mine.json"
    code, _, err = calibrated(capsys, folder, out, data=tmp_path / "still.mcap")
    assert (code, out.exists()) == (2, False)
    assert err.endswith("(--force saves all the same)\n")
    assert calibrated(capsys, folder, out, "--force", data=tmp_path / "still.mcap")[0] == 0
    assert out.exists()
