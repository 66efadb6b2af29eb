"""What holdfast and holdfast-grip print if this package is not installed."""

import importlib.metadata

import pytest

from holdfast.cli import main
from holdfast.errors import HoldfastError, install_command
from holdfast_grip.hands import open_hand

SENTENCE = f"is part of holdfast-ros, which is not installed: {install_command('ros')}"


@pytest.fixture(autouse=True)
def without_the_package(monkeypatch):
    find = importlib.metadata.entry_points

    def others(**given):
        return [point for point in find(**given) if point.dist.name != "holdfast-ros"]

    monkeypatch.setattr(importlib.metadata, "entry_points", others)


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["detect", "builtin:any", "ros2:///xServTopic"], "the source ros2:"),
        (["import", "run.bag", "out", "--format", "rosbag"], "the format rosbag"),
        (["serve", "builtin:any", "twin:", "--ros2"], "the option --ros2"),
        (["hold", "builtin:any", "twin:", "--hand", "ros2:plexus"], "the hand ros2:"),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_a_part_of_it_is_one_line_with_the_command(capsys, words, what):
    assert main(words) == 2
    assert capsys.readouterr() == ("", f"holdfast: {what} {SENTENCE}\n")


def test_a_hand_in_python():
    with pytest.raises(HoldfastError) as refusal:
        open_hand("ros2:v4")
    assert str(refusal.value) == f"the hand ros2: {SENTENCE}"


def test_the_other_formats_are_named(capsys, tmp_path):
    (tmp_path / "run.bag").write_bytes(b"#ROSBAG V2.0\n")
    assert main(["import", str(tmp_path / "run.bag"), str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "run.bag is of no supported format; there are xela-log, csv" in error
    assert "; not installed: rosbag (holdfast-ros) (--format)" in error
    assert error.count("\n") == 1
