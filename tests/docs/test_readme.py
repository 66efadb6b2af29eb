import pytest
from msgspec.structs import replace

from holdfast import simulated_grasps
from holdfast.cli import demo
from holdfast.io import save_recording
from holdfast.parallel import Engine
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile

from . import blocks

README = blocks.ROOT / "README.md"
DEMO, HAND, FILES, CODE = ("",), ("I have a hand",), ("I have files",), ("I write code",)
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


def test_the_demo(folder, short_demo):
    replaced = {"uv run holdfast demo": "holdfast demo --no-browser --speed 0"}
    assert blocks.run_page(README, replaced, DEMO) == 1


def test_files_of_ones_own_and_code(folder, csv_recordings):
    csv_recordings("my-data")
    assert blocks.run_page(README, {}, FILES) == 1
    assert (folder / "model.json").exists()
    save_recording(synthetic_recording("live", 0), folder / "live.parquet")
    replaced = {'open_source("xela://auto")': 'open_source("live.parquet", speed=0)'}
    assert blocks.run_page(README, replaced, CODE) == 2


def test_a_hand_of_ones_own(folder, hand):
    replaced = {"serve builtin:any xela://auto": f"serve builtin:any '{hand}' --port 0"}
    assert blocks.run_page(README, replaced, HAND) == 1


def test_every_section_is_run():
    sections = {block.section for block in blocks.blocks_of(README)}
    assert sections == {*DEMO, *HAND, *FILES, *CODE}
