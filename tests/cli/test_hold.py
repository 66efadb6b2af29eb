import json
from inspect import signature
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from holdfast.cli import main
from holdfast.cli.app import spread_groups
from holdfast.cli.grip_options import GripSettings
from holdfast.cli.hold import hold
from holdfast.cli.serve import serve
from holdfast.grip import GripCommand, Limits
from holdfast.io import load_recording, save_recording
from holdfast.live.loop import watchdog
from holdfast.synthetic import synthetic_recording
from holdfast_lab.trial.run import LIMITS
from holdfast_ros.hands import ros_hand

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
TWIN = "twin:?object=ball&case=1&profile=finger-vigorous"
WIDTH = "ros2:width-gripper?topic=/g&joint=f&open=0.08&effort=4&stiffness=2000"
PLEXUS = "ros2:plexus?effort=0.06&max_effort=0.1"


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    path = tmp_path_factory.mktemp("grasp") / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 1), path)
    return path


@pytest.mark.usefixtures("short_grasps")
def test_the_twin_is_source_and_hand(tmp_path, capsys):
    out = tmp_path / "held.mcap"
    words = ["hold", "builtin:twin", TWIN, "--hand", "twin:", "--armed", "--speed", "0"]
    assert main([*words, "--record", str(out)]) == 0
    captured = capsys.readouterr()
    assert "grip HOLD" in captured.out
    assert "commands sent to twin:" in captured.err
    recording = load_recording(out)
    texts = [text for _, text in recording.markers]
    assert "grip HOLD" in texts
    assert len(texts) == len(captured.out.splitlines())
    assert recording.modules.keys() == {"thumb", "index", "middle", "ring"}


def test_a_dry_run_sends_nothing(tmp_path, grasp, capsys):
    hand = f"log:{tmp_path / 'hand'}"
    assert main(["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0"]) == 0
    assert not (tmp_path / "hand").exists()
    assert "dry run: nothing was sent" in capsys.readouterr().err


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


@pytest.mark.parametrize("verb", [hold, serve])
def test_the_limits_are_those_of_the_trials(verb):
    given = signature(spread_groups(verb)).parameters
    names = ("max_scale", "min_scale", "max_force", "on_fault")
    settings = GripSettings("", **{name: given[name].default for name in names})
    assert settings.limits() == LIMITS == Limits()
    shown = {name: get_args(given[name].annotation)[1].show_default for name in names[:2]}
    assert shown == {"max_scale": str(LIMITS.max_scale), "min_scale": str(LIMITS.min_scale)}


def test_the_published_trials_have_these_limits():
    published = json.loads((DOCS / "study" / "grip" / "trial.json").read_text("utf-8"))["limits"]
    assert published == msgspec.to_builtins(Limits())


@pytest.mark.parametrize(
    ("hand", "message"),
    [
        ("ros2:plexus?effort=1", "max_effort: a number or 16 numbers"),
        (PLEXUS, "at most 0.1 N m expected, 0.18 N m given at max_scale 3: lower"),
        (f"{WIDTH}&max_effort=9", "at most 9 N expected, 12 N given at max_scale 3: lower one of"),
        (
            f"{WIDTH.replace('2000', '2')}&max_effort=12",
            "0.08 m expected, 4 m given at max_scale 3",
        ),
        (
            f"{WIDTH.replace('0.08', '80')}&max_effort=12",
            "a stroke of at most 1 m expected, 80 giv",
        ),
        (f"ros2:v4?effort={','.join(['0.3'] * 16)}", "0.9 N m given at max_scale 3: lower one of"),
        (
            f"ros2:v4?home={','.join(['45'] * 16)}",
            "home: index joint 0: -0.47 to 0.47 rad expected",
        ),
        ("ros2:v4?order=thumb,ring,index", "order=thumb,index,middle,ring expected, in any order"),
    ],
)
def test_limits_that_the_hand_does_not_have_are_one_line(grasp, capsys, hand, message):
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
    assert main(["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_a_hand_that_does_not_answer_is_one_line(grasp, capsys, monkeypatch):
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setattr(ros_hand, "HAND_OPEN_TIMEOUT", 0.1)
    hand = "ros2:v4?domain=229"
    words = ["hold", "builtin:twin", str(grasp), "--hand", hand, "--armed", "--confirm", hand]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nothing listens on /allegro_hand_position_controller/commands in ROS domain 229" in line


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--hand", "log:h", "--armed"], "--armed moves the hand: confirm it with --confirm log:h"),
        (["--hand", "log:h", "--armed", "--confirm", "log:x"], "confirm it with --confirm log:h"),
        (["--hand", "magic:"], "'magic:' is no hand; there are twin:"),
        (["--hand", "ros2:magic"], "there are the hands ros2:plexus, ros2:v4"),
        (["--hand", "ros2:v4-envelop"], "as a goal, by services, which plain DDS does not have"),
        (["--hand", "ros1:efforts", "--armed", "--confirm", "x"], "confirm it with --confirm ros1"),
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
