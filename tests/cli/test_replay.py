import time

import numpy as np
import pytest

from holdfast.cli import replay as module
from holdfast.cli.replay import replay
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
def clock(monkeypatch):
    """A clock that only sleep moves."""
    now = [100.0]

    def sleep(seconds):
        now[0] += seconds

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", sleep)
    return now


def test_every_sample_is_an_update_and_changes_of_the_hand_are_told(capsys, model, recording):
    assert replay(model, recording, 0) == recording.modules["thumb"].n_samples
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert lines
    assert all("hand" in line and " -> " in line for line in lines)
    times = [float(line.split()[0]) for line in lines]
    assert times == sorted(times)
    assert 0 <= times[0] <= times[-1] <= recording.modules["thumb"].times[-1]
    assert len({line.split(" -> ")[1] for line in lines}) > 1


@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_goes_at_its_pace(model, recording, clock, speed):
    replay(model, recording, speed)
    last = recording.modules["thumb"].times[-1]
    assert clock[0] - 100.0 == pytest.approx(last / speed, abs=0.01)


def test_as_fast_as_it_goes_never_waits(model, recording, clock):
    replay(model, recording, 0)
    assert clock[0] == 100.0


def test_on_a_terminal_a_table_follows(capsys, model, recording, clock, monkeypatch):
    monkeypatch.setattr(module.sys.stderr, "isatty", lambda: True, raising=False)
    assert replay(model, recording, 8.0) == recording.modules["thumb"].n_samples
    err = capsys.readouterr().err
    assert "thumb" in err
    assert "sigma" in err


def test_the_replay_does_not_touch_the_model(model, recording):
    before = model.debounce
    replay(model, recording, 0)
    assert model.debounce == before
    assert np.isfinite(recording.modules["thumb"].readings).all()
