import json
from inspect import signature
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from holdfast.cli import main
from holdfast.cli.app import spread_groups
from holdfast.detection import Model
from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_grip import GripCommand, Limits
from holdfast_grip.hands import Claim, open_hand
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
    assert "holdfast calibrate" in capsys.readouterr().err


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


HOLD = "hold builtin:twin grasp.parquet --hand"
MESSAGES = [
    ("hold xela://auto --hand log:h", "xela://auto", "MODEL SOURCE", "holdfast teach"),
    ("hold builtin:any --hand log:h", "builtin:any", "MODEL SOURCE", "holdfast teach"),
    (f"{HOLD} log:h --armed", "--confirm log:h"),
    (f"{HOLD} log:h --armed --confirm log:x", "--confirm log:h"),
    (f"{HOLD} magic:", "'magic:'", "twin:"),
    (f"{HOLD} twin:", "--hand twin:", "twin:..."),
    (f"{HOLD} log:h --max-scale 0.5", "max_scale"),
    (f"{HOLD} log:h --law magic", "'magic'"),
    (f"{HOLD} log:h --law pr2", "forces in N", "counts"),
    (f"{HOLD} log:h --seconds 0", "--seconds", "0 given"),
    (f"{HOLD} log:h --record x.csv", "--record", "x.csv"),
    (f"{HOLD} log:none/h --armed --confirm log:none/h", "none/h"),
    (f"{HOLD} log:claimed --armed --confirm log:claimed", "another controller"),
    ("hold thumb.json twin:?object=ball --hand twin:", "index, middle, ring"),
]
"""Words of a command, and what its last line must name."""


@pytest.mark.parametrize(("words", "named"), [(words, named) for words, *named in MESSAGES])
def test_bad_input_is_one_line(grasp, capsys, tmp_path, monkeypatch, words, named):
    monkeypatch.chdir(tmp_path)
    Path("grasp.parquet").symlink_to(grasp)
    model = Model.load("builtin:twin")
    msgspec.structs.replace(model, fingers={"thumb": model.fingers["*"]}).save("thumb.json")
    with Claim(open_hand("log:claimed").resource):
        assert main(words.split()) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert [text for text in named if text not in error] == []
    assert not Path("h").exists()
