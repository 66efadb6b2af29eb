"""The examples for ROS 2: they subscribe to topics that holdfast publishes."""

import re
from pathlib import Path

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from holdfast_ros.dds import Link
from holdfast_ros.publisher import Ros2Publisher

FOLDER = Path(__file__).parents[5] / "examples" / "ros2"


@pytest.mark.parametrize("name", ["watch_states.py", "grip_harder.py"])
def test_the_topics_are_published(name):
    text = (FOLDER / name).read_text("utf-8")
    compile(text, name, "exec")
    used = {
        re.sub(r"{\w+}", "thumb", topic) for topic in re.findall(r'"(/holdfast/[\w/{}]+)"', text)
    }
    assert used
    assert used <= set(Ros2Publisher({"thumb": "count"}, Link()).topics())
