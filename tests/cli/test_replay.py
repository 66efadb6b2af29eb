import pytest

from holdfast.cli import replay as module
from holdfast.cli.replay import replay
from holdfast.io import save_recording
from holdfast.model import Debounce
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train

FINGERS = ("thumb", "index")


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


def test_every_sample_is_an_update_and_changes_of_the_hand_are_told(capsys, model, recording, path):
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


def test_on_a_terminal_a_table_follows(capsys, model, recording, path, monkeypatch):
    monkeypatch.setattr(module.sys.stderr, "isatty", lambda: True, raising=False)
    assert replay(model, path, 40.0) == recording.modules["thumb"].n_samples
    err = capsys.readouterr().err
    assert "thumb" in err
    assert "sigma" in err


def test_for_the_eye_states_are_held_back(model):
    before = model.debounce
    assert module.calmer(model).debounce == Debounce(*module.DEBOUNCE)
    assert model.debounce == before
