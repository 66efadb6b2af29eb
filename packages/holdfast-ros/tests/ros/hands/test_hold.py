"""`holdfast hold` with hands of ROS: what they refuse is one line."""

from pathlib import Path

import pytest

from holdfast.cli import main
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_ros.hands import ros_hand


@pytest.fixture
def grasp(tmp_path):
    save_recording(synthetic_recording("grasp", 1), tmp_path / "grasp.parquet")
    return tmp_path / "grasp.parquet"


@pytest.mark.parametrize(
    ("hand", "message"),
    [
        ("ros2:magic", "ros2:plexus, ros2:v4"),
        ("ros2:plexus?effort=0.06&max_effort=0.1", "0.18 N m given at max_scale 3"),
    ],
)
def test_what_the_hand_does_not_have_is_one_line(grasp, capsys, hand, message):
    assert main(["hold", "builtin:twin", str(grasp), "--hand", hand, "--speed", "0"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_a_hand_that_does_not_answer_is_one_line(grasp, capsys, monkeypatch):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.setattr(ros_hand, "HAND_OPEN_TIMEOUT", 0.1)
    hand = "ros2:v4?domain=229"
    words = ["hold", "builtin:twin", str(grasp), "--hand", hand, "--armed", "--confirm", hand]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "/allegro_hand_position_controller/commands in ROS domain 229" in line


def test_the_table_of_fault_times_has_those_of_the_code():
    page = (Path(__file__).parents[5] / "docs" / "grip.md").read_text("utf-8")
    silence = f"{1000 * ros_hand.SILENCE_TIME:.0f} ms, or {ros_hand.SILENCE_PERIODS:g} of their"
    assert f"| {silence} periods |" in page
    assert f"| {1000 * ros_hand.STATE_TIMEOUT:.0f} ms |" in page
