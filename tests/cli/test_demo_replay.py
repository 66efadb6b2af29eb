import io
import itertools
import math

import pytest
from rich.console import Console

from holdfast.cli import demo_replay
from holdfast.cli.demo_replay import TrueEvents, finger_table, replay
from holdfast.contact import ContactEstimate, ContactEvent, ContactState, HandEstimate, Reason
from holdfast.io import save_recording
from holdfast.metrics import InstabilityEvent
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording
from holdfast.training import Setting, train

FINGERS = ("thumb", "index")


@pytest.fixture(scope="module")
def recording():
    return synthetic_recording("grasp", 0, FINGERS)


@pytest.fixture(scope="module")
def model():
    others = [synthetic_recording(f"grasp-{k}", k, FINGERS) for k in (1, 2)]
    return train(others, Setting(trials=0)).model


@pytest.fixture
def path(recording, tmp_path):
    save_recording(recording, tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


def test_every_sample_is_an_update_and_lasting_changes_are_lines(capsys, model, recording, path):
    assert replay(model, path, 0, TrueEvents()) == recording.modules["thumb"].n_samples
    out, err = capsys.readouterr()
    assert out == ""
    header, *lines = err.splitlines()
    assert "hand" in header
    states = [line.split()[2] for line in lines]
    assert len(set(states)) > 1
    assert all(one != two for one, two in itertools.pairwise(states))
    times = [float(line.split()[0]) for line in lines]
    assert times == sorted(times)
    assert 0 <= times[0] <= times[-1] <= recording.modules["thumb"].times[-1]
    assert max(map(len, err.splitlines())) <= 80


def test_on_a_terminal_a_table_is_shown(capsys, model, recording, path, monkeypatch):
    monkeypatch.setattr(demo_replay.sys.stderr, "isatty", lambda: True, raising=False)
    assert replay(model, path, 40.0, TrueEvents()) == recording.modules["thumb"].n_samples
    err = capsys.readouterr().err
    assert "thumb" in err
    assert "instability" in err


def change(state, time):
    return ContactEvent("hand", ContactState(state), ContactState.STABLE, time)


def test_words_of_a_change():
    events = TrueEvents(
        [(5.0, 6.0, "pulled or pushed"), (8.0, 8.2, "a jerk of the controller")],
        [InstabilityEvent(5.0, 6.0, 5.0066), InstabilityEvent(8.0, 8.2, 7.99)],
    )
    assert events.words(change("UNSTABLE", 5.0066)) == "pulled or pushed; detected after 7 ms"
    assert events.words(change("UNSTABLE", 7.99)) == "a jerk of the controller; detected at once"
    assert events.words(change("UNSTABLE", 3.0)) == "false alarm"
    assert events.words(change("STABLE", 5.0)) == "the hand holds the object"
    assert TrueEvents([(5.0, 6.0, "x")], []).words(change("UNSTABLE", 5.1)) == "x"


def test_every_line_fits_80_columns():
    longest = max(map(len, demo_replay.CAUSE_WORDS.values())) + len("; detected after 250 ms")
    other = max(map(len, demo_replay.STATES.values()))
    assert len(f"     {0:6.2f} s   {'':10}  ") + max(longest, other) <= 80


def test_without_a_truth_there_are_no_true_events(model, recording):
    assert TrueEvents.of(model, recording) == ([], ())


def test_the_table_fits_80_columns_and_has_no_nan_and_no_minus_zero():
    unknown = ContactEstimate(
        0.1, ContactState.UNKNOWN, Reason.WARM_UP, math.nan, math.nan, (-0.2, 0.0, math.nan)
    )
    full = ContactEstimate(0.1, ContactState.NO_CONTACT, Reason.NONE, 1.0, -0.0, (-1e5, 0.0, 0.0))
    estimate = HandEstimate(0.1, ContactState.UNKNOWN, {"thumb": unknown, "middle": full})
    console = Console(file=io.StringIO(), width=80)
    console.print(finger_table(estimate))
    text = console.file.getvalue()
    assert "nan" not in text
    assert "-0" not in text
    assert "UNKNOWN    warm_up" in text
    assert "100000" in text
    assert "##########" in text
    assert "force [counts]" in text
    assert all(len(line.rstrip()) <= 80 for line in text.splitlines())


def test_the_replay_uses_the_model_as_it_ships(path, recording):
    shipped = Model.load("builtin:noise-floor")
    assert replay(shipped, path, 0, TrueEvents()) == recording.modules["thumb"].n_samples
