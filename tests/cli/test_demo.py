import json
import threading
import urllib.request

import msgspec
import pytest

from holdfast.cli import demo as verb
from holdfast.cli import main
from holdfast.cli import simulate as simulate_verb
from holdfast.cli.demo import replay
from holdfast.io import load_dataset, save_recording
from holdfast.model import Debounce, Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train
from holdfast.twin import simulation
from holdfast.twin.profile import profile

FINGERS = ("thumb", "index")
SHORT = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=6.0)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Simulate one flask per case, in this process."""
    whole = simulate_verb.simulate_grasps
    monkeypatch.setattr(verb, "OBJECTS", "flask")
    monkeypatch.setattr(verb, "N_REPEATS", 1)
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    monkeypatch.setattr(
        simulate_verb,
        "simulate_grasps",
        lambda *given, **named: whole(*given, **{**named, "jobs": 1}),
    )


def run(capsys, *words):
    code = main(["demo", *map(str, words)])
    out, err = capsys.readouterr()
    return code, out, err


def test_simulates_trains_and_replays(capsys, tmp_path):
    code, out, err = run(capsys, tmp_path / "demo", "--speed", 0, "--json")
    assert code == 0
    result = json.loads(out)
    recordings = load_dataset(result["recordings"])
    assert list(recordings.names) == ["flask-case1-1", "flask-case2-1"]
    assert tuple(Model.load(result["model"]).fingers) == ("thumb", "index", "middle", "ring")
    assert result["updates"] == recordings[1].modules["thumb"].n_samples
    assert 50 < result["accuracy"] <= 100
    assert result["seconds"] > 0
    for step in ("1/4", "2/4", "3/4", "4/4  replaying flask-case2-1"):
        assert step in err
    assert "hand" in err
    assert "STABLE" in err


def test_prints_next_steps_and_refuses_to_overwrite(capsys, tmp_path):
    folder = tmp_path / "demo"
    code, out, _ = run(capsys, folder, "--speed", 0)
    assert code == 0
    for line in (f"{folder}/recordings", "model.json", "what to try next", "holdfast detect"):
        assert line in out
    code, out, err = run(capsys, folder, "--speed", 0)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "model.json exists already" in err
    assert run(capsys, folder, "--speed", 0, "--seed", 1, "--force")[0] == 0
    assert {r.metadata["seed"] for r in load_dataset(folder / "recordings")} == {1}


@pytest.mark.parametrize("speed", ["-1", "nan", "inf"])
def test_bad_speed(capsys, tmp_path, speed):
    code, out, err = run(capsys, tmp_path / "demo", f"--speed={speed}")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--speed: at least 0 expected" in err
    assert not (tmp_path / "demo").exists()


def test_a_negative_seed(capsys, tmp_path):
    code, out, err = run(capsys, tmp_path / "demo", "--seed", "-1")
    assert (code, out, err.count("\n")) == (2, "", 1)


def test_the_replay_page_stops_at_the_end_of_the_recording(capsys, tmp_path, monkeypatch):
    pages = []

    def look(url):
        with urllib.request.urlopen(f"{url}api/v1/info") as answer:
            pages.append(json.load(answer))
        return False

    monkeypatch.setattr("holdfast.cli.serve.open_browser", lambda url: _in_a_thread(look, url))
    code, out, err = run(capsys, tmp_path / "demo", "--speed", 8)
    assert code == 0
    assert "(open it in a browser)" in err
    assert "it stops at the end of the recording" in err
    assert "what to try next" in out
    assert [set(page["fingers"]) for page in pages] == [{"thumb", "index", "middle", "ring"}]


def _in_a_thread(work, url):
    threading.Thread(target=work, args=(url,)).start()
    return False


@pytest.fixture(scope="module")
def recording():
    return synthetic_recording("grasp", 0, FINGERS)


@pytest.fixture(scope="module")
def model(recording):
    others = [synthetic_recording(f"grasp-{k}", k, FINGERS) for k in (1, 2)]
    return train(others, Setting(trials=0)).model


@pytest.fixture
def path(recording, tmp_path):
    save_recording(recording, tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


def test_every_sample_is_an_update_and_changes_of_the_hand_are_printed(
    capsys, model, recording, path
):
    assert replay(model, path, 0) == recording.modules["thumb"].n_samples
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert lines
    assert all("hand" in line and " -> " in line for line in lines)
    times = [float(line.split()[0]) for line in lines]
    assert times == sorted(times)
    assert 0 <= times[0] <= times[-1] <= recording.modules["thumb"].times[-1]
    assert len({line.split(" -> ")[1] for line in lines}) > 1


def test_on_a_terminal_a_table_is_shown(capsys, model, recording, path, monkeypatch):
    monkeypatch.setattr(verb.sys.stderr, "isatty", lambda: True, raising=False)
    assert replay(model, path, 40.0) == recording.modules["thumb"].n_samples
    err = capsys.readouterr().err
    assert "thumb" in err
    assert "sigma" in err


def test_replayed_states_are_debounced(model):
    before = model.debounce
    assert verb.with_debouncing(model).debounce == Debounce(verb.MIN_DURATION, verb.HYSTERESIS)
    assert model.debounce == before
