"""The table of support names all sources and hands of the package."""

from pathlib import Path

import pytest

from holdfast_ros.hands.table import hand_rows

PAGE = (Path(__file__).parents[4] / "docs" / "support.md").read_text("utf-8")


@pytest.mark.parametrize("name", [*(f"ros2:{name}" for name in hand_rows()), "ros2:"])
def test_it_is_in_the_table(name):
    assert f"`{name}`" in PAGE
