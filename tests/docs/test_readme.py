import re

import pytest
from msgspec.structs import replace

import holdfast
from holdfast import simulated_grasps
from holdfast.cli import demo
from holdfast.parallel import Engine
from holdfast.twin import simulation
from holdfast.twin.profile import profile

from . import blocks

README = blocks.ROOT / "README.md"
SHORT = replace(profile("reference"), idle=(0.7, 0.8), hold=6.0)


@pytest.fixture
def short_demo(monkeypatch):
    """The demo with short grasps, in this process."""
    whole = simulated_grasps.simulate_grasps
    monkeypatch.setattr(demo, "DEMO_OBJECTS", "mug")
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    monkeypatch.setattr(
        simulated_grasps,
        "simulate_grasps",
        lambda *given, **named: whole(*given, **{**named, "engine": Engine(1)}),
    )


def test_the_page(folder, short_demo):
    replaced = {"uv run holdfast demo": "holdfast demo --no-browser --speed 0"}
    assert blocks.run_page(README, replaced) == 2


def test_files_of_ones_own(folder, csv_recordings):
    csv_recordings("my-data")
    assert blocks.run_page(blocks.ROOT / "docs" / "which-way.md") == 1
    assert (folder / "model.json").exists()


def test_the_front_page_is_short():
    assert len(README.read_text("utf-8").split()) <= 550


def test_help_shows_the_example():
    """`help(holdfast)` has the lines of README's program."""
    (program,) = [b.text for b in blocks.blocks_of(README) if b.language == "python"]
    shown = re.sub(r"^ {4}(>>>|\.\.\.) ?", "", holdfast.__doc__, flags=re.M)
    assert [line for line in program.splitlines() if line and line not in shown] == []
