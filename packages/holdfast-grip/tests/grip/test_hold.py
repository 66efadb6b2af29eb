import json
from inspect import signature
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from holdfast.cli import main
from holdfast.cli.app import spread_groups
from holdfast.io import load_recording, save_recording
from holdfast.model import Model
from holdfast.synthetic import synthetic_recording
from holdfast_grip import GripCommand, Limits
from holdfast_grip.hands import Claim
from holdfast_grip.hold import hold
from holdfast_grip.loop import watchdog
from holdfast_grip.options import GripSettings
from holdfast_lab.trial.run import LIMITS

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[4] / "docs"
TWIN = "twin:?object=ball&case=1&profile=finger-vigorous"


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    path = tmp_path_factory.mktemp("grasp") / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 1), path)
    return path


@pytest.mark.usefixtures("short_grasps")
def test_the_twin_is_source_and_hand(tmp_path, capsys):
    out = tmp_path / "held.mcap"
    # Without MODEL: builtin:twin.
    words = ["hold", TWIN, "--hand", "twin:", "--armed", "--speed", "0"]
    assert main([*words, "--record", str(out)]) == 0
    captured = capsys.readouterr()
    assert "grip HOLD" in captured.out
    assert "commands sent to twin:" in captured.err
    recording = load_recording(out)
    texts = [text for _, text in recording.markers]
    assert "grip HOLD" in texts
    # A reaction is one line; that the force then stays and relaxes is in the recording alone.
    lines = [line.split(" s  ")[1] for line in captured.out.splitlines()]
    assert lines == [texts[0], *(text for text in texts if text not in ("grip HOLD", "grip RELAX"))]
    assert any(" x the first force (" in line for line in lines)
    assert all(len(line) <= 80 for line in captured.out.splitlines())
    assert recording.modules.keys() == {"thumb", "index", "middle", "ring"}


def test_a_dry_run_sends_nothing(tmp_path, grasp, capsys):
    hand = f"log:{tmp_path / 'hand'}"
    assert main(["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0"]) == 0
    assert not (tmp_path / "hand").exists()
    assert "dry run: nothing was sent" in capsys.readouterr().err


def test_a_model_that_reports_no_slip_is_warned_of(tmp_path, grasp, capsys):
    path = tmp_path / "silent.json"
    Model.load("builtin:any").with_threshold("slip", 1.0).save(path)
    hand = f"log:{tmp_path / 'hand'}"
    assert main(["hold", str(path), str(grasp), "--hand", hand, "--speed", "0"]) == 0
    err = capsys.readouterr().err
    assert "until it is taught on this hand (holdfast teach)" in err
    assert "; take a taught model, or builtin:twin with the twin\n" in err


@pytest.mark.parametrize("word", ["xela://auto", "builtin:any", "mine.json"])
def test_a_source_alone_is_the_twin(word, capsys):
    assert main(["hold", word, "--hand", "log:h"]) == 2
    assert capsys.readouterr().err == (
        f"holdfast: {word} given; MODEL SOURCE expected, with a model that was taught on this hand "
        "(holdfast teach), or twin:... alone\n"
    )


def test_armed_commands_reach_the_hand_and_stdout(tmp_path, grasp, capsys, monkeypatch):
    # A recording is read in bursts, on a busy machine with pauses of more than 0.1 s.
    monkeypatch.setattr(watchdog.Watchdog.__init__, "__defaults__", (300.0,))
    hand = f"log:{tmp_path / 'hand'}"
    words = ["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0", "--json"]
    assert main([*words, "--armed", "--confirm", hand]) == 0
    lines = (tmp_path / "hand").read_bytes().splitlines()
    sent = [msgspec.json.decode(line, type=GripCommand) for line in lines]
    assert "HOLD" in {command.state.value for command in sent}
    printed = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert printed[0]["state"] == "IDLE"


def test_the_limits_are_those_of_the_trials():
    given = signature(spread_groups(hold)).parameters
    names = ("max_scale", "max_force", "on_fault")
    settings = GripSettings("", **{name: given[name].default for name in names})
    assert settings.limits() == LIMITS == Limits()
    assert get_args(given["max_scale"].annotation)[1].show_default == str(LIMITS.max_scale)


def test_the_published_trials_have_these_limits():
    published = json.loads((DOCS / "study" / "grip" / "trial.json").read_text("utf-8"))["limits"]
    assert published == msgspec.to_builtins(Limits())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--hand", "log:h", "--armed"], "--armed moves the hand: confirm it with --confirm log:h"),
        (["--hand", "log:h", "--armed", "--confirm", "log:x"], "confirm it with --confirm log:h"),
        (["--hand", "magic:"], "'magic:' is no hand; there are twin:"),
        (["--hand", "twin:"], "--hand twin: needs the source twin:..."),
        (["--hand", "log:h", "--max-scale", "0.5"], "min_scale <= 1 <= max_scale expected"),
        (["--hand", "log:h", "--law", "magic"], "unknown law 'magic'"),
        (["--hand", "log:h", "--law", "pr2"], "needs forces in N and the readings are counts"),
        (["--hand", "log:h", "--seconds", "0"], "--seconds: more than 0 s expected, 0 given"),
        (["--hand", "log:h", "--record", "x.csv"], "--record: NAME.mcap expected, x.csv given"),
    ],
)
def test_bad_input_is_one_line(grasp, capsys, words, message):
    assert main(["hold", "builtin:twin", str(grasp), *words, "--speed", "0"]) == 2
    error = capsys.readouterr().err
    assert message in error.splitlines()[-1]


def test_a_hand_that_does_not_answer_or_is_in_use(grasp, capsys, tmp_path):
    hand = f"log:{tmp_path / 'none' / 'hand'}"
    words = ["hold", "builtin:twin", str(grasp), "--hand", hand, "--armed", "--confirm", hand]
    assert main(words) == 2
    assert "cannot write" in capsys.readouterr().err
    with Claim(hand):
        assert main(words) == 2
    text = f"holdfast: {hand} has another controller already: stop that one first\n"
    assert capsys.readouterr().err == text


def test_a_model_without_a_finger_of_the_hand(capsys, tmp_path):
    path = tmp_path / "thumb.json"
    model = Model.load("builtin:twin")
    msgspec.structs.replace(model, fingers={"thumb": model.fingers["*"]}).save(path)
    assert main(["hold", str(path), "twin:?object=ball", "--hand", "twin:"]) == 2
    assert (
        "holdfast: twin:?object=ball also holds with index, middle, ring, of which the model gives "
        "no estimates"
    ) in capsys.readouterr().err
