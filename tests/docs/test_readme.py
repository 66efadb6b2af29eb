import dataclasses
import re

import pytest
from msgspec.structs import replace

from holdfast import twin_recordings
from holdfast.cli import demo
from holdfast.io import save_recording
from holdfast.parallel import Engine
from holdfast.recordings import Tactile
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile

from . import blocks

README = blocks.ROOT / "README.md"
DEMO, RECORDINGS = ("", "Look at what the demo made"), ("Your own recordings",)
HAND = ("Your own hand", "Python")
SHORT = replace(profile("reference"), idle=(0.7, 0.8), hold=6.0)


@pytest.fixture
def short_demo(monkeypatch):
    """The demo with short grasps, in this process."""
    whole = twin_recordings.simulate_grasps
    monkeypatch.setattr(demo, "DEMO_OBJECTS", "mug")
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    monkeypatch.setattr(
        twin_recordings,
        "simulate_grasps",
        lambda *given, **named: whole(*given, **{**named, "engine": Engine(1)}),
    )


def test_the_demo_and_what_it_made(folder, short_demo):
    replaced = {"uv run holdfast demo": "holdfast demo --no-browser --speed 0"}
    assert blocks.run_page(README, replaced, DEMO) == 2
    assert (folder / "mug.png").exists()


def test_recordings_of_ones_own(folder, csv_recordings):
    csv_recordings("my-data", fingers=("thumb",), plain=True)
    assert blocks.run_page(README, {}, RECORDINGS) == 1
    assert (folder / "model.json").exists()


def test_a_hand_of_ones_own(folder, hand):
    save_recording(synthetic_recording("live", 0), folder / "live.parquet")
    replaced = {
        'open_source("xela://auto")': 'open_source("live.parquet", speed=0)',
        "xela://auto": f"'{hand}' --port 0",
        "holdfast play": "holdfast play --port 0",
    }
    assert blocks.run_page(README, replaced, HAND) == 3


def test_the_live_program_prints_times_that_a_person_can_read(folder, capsys):
    """Devices send times since 1970."""
    recording = synthetic_recording("live", 0)
    modules = {
        name: Tactile(m.sensor, m.times + 1795364053.99, m.readings)
        for name, m in recording.modules.items()
    }
    save_recording(dataclasses.replace(recording, modules=modules), folder / "live.parquet")
    replaced = {'open_source("xela://auto")': 'open_source("live.parquet", speed=0)'}
    blocks.run_page(README, replaced, ("Python",))
    lines = capsys.readouterr().out.splitlines()
    assert lines
    for line in lines:
        assert re.fullmatch(r"\d{1,2}\.\d\d s  \w+: [A-Z_]+", line)


def test_every_section_is_run():
    sections = {block.section for block in blocks.blocks_of(README)}
    assert sections == {*DEMO, *RECORDINGS, *HAND}


def test_the_links_exist():
    for target, _ in blocks.links_of(README):
        assert (blocks.ROOT / target).exists(), target


def test_no_path_of_this_machine_is_named():
    assert not re.search(r"/work/|/root/|/home/", README.read_text("utf-8"))
