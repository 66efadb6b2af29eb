"""The table of support names all sources and hands of the package."""

from pathlib import Path

import pytest

from holdfast_ros.hands.kinds import HAND_KINDS

PAGE = (Path(__file__).parents[4] / "docs" / "support.md").read_text("utf-8")
KINDS = [f"{scheme}:{kind}" for scheme, kinds in HAND_KINDS.items() for kind in kinds]


@pytest.mark.parametrize("name", [*KINDS, *(f"{scheme}:" for scheme in HAND_KINDS)])
def test_it_is_in_the_table(name):
    assert f"`{name}`" in PAGE
