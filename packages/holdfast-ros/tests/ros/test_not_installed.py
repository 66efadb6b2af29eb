"""What holdfast and holdfast-grip print if this package is not installed."""

import importlib.metadata

import pytest

from holdfast.cli import main
from holdfast.errors import install_command


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["detect", "builtin:any", "ros2:///xServTopic"], "ros2:"),
        (["import", "run.bag", "out", "--format", "rosbag"], "rosbag"),
        (["serve", "builtin:any", "twin:", "--ros2"], "--ros2"),
        (["hold", "builtin:any", "twin:", "--hand", "ros2:plexus"], "ros2:"),
    ],
    ids=["source", "format", "option", "hand"],
)
def test_a_part_of_it_is_one_line_with_the_command(capsys, monkeypatch, words, what):
    find = importlib.metadata.entry_points

    def others(**given):
        return [point for point in find(**given) if point.dist.name != "holdfast-ros"]

    monkeypatch.setattr(importlib.metadata, "entry_points", others)
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line
    assert line.endswith(install_command("ros"))
