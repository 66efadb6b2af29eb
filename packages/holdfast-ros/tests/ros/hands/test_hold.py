"""`holdfast hold` with hands of ROS: what they refuse is one line."""

from pathlib import Path

import pytest

from holdfast.cli import main
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_ros.hands import ros_hand

WIDTH = "ros2:width-gripper?topic=/g&joint=f&open=0.08&effort=4&stiffness=2000"
PLEXUS = "ros2:plexus?effort=0.06&max_effort=0.1"


@pytest.fixture
def grasp(tmp_path):
    save_recording(synthetic_recording("grasp", 1), tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


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
        ("ros2:magic", "there are the hands ros2:plexus, ros2:v4"),
        ("ros2:v4?joints=thumb:a:b:c:d", "4 of thumb, 4 of index, 4 of middle, 4 of ring expect"),
    ],
)
def test_limits_that_the_hand_does_not_have_are_one_line(grasp, capsys, hand, message):
    assert main(["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_a_hand_that_does_not_answer_is_one_line(grasp, capsys, monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setattr(ros_hand, "HAND_OPEN_TIMEOUT", 0.1)
    hand = "ros2:v4?domain=229"
    words = ["hold", "builtin:twin", str(grasp), "--hand", hand, "--armed", "--confirm", hand]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "nothing listens on /allegro_hand_position_controller/commands in ROS domain 229" in line


def test_an_armed_hand_is_confirmed_by_its_uri(grasp, capsys):
    words = ["hold", "builtin:twin", str(grasp), "--hand", "ros2:v4", "--armed"]
    assert main([*words, "--confirm", "x"]) == 2
    assert "confirm it with --confirm ros2:v4" in capsys.readouterr().err


def test_the_table_of_fault_times_has_those_of_the_code():
    page = (Path(__file__).parents[5] / "docs" / "details" / "grip.md").read_text("utf-8")
    silence = f"{1000 * ros_hand.SILENCE_TIME:.0f} ms, or {ros_hand.SILENCE_PERIODS:g} of their"
    assert f"| {silence} periods |" in page
    assert f"| {1000 * ros_hand.STATE_TIMEOUT:.0f} ms |" in page
