"""The recording of a real hand that ships, and what the demo tells of it."""

import pytest

from holdfast.cli import demo_replay
from holdfast.cli.demo_replay import ClipEvent, show_clip
from holdfast.io import load_recording
from holdfast.recorded import BOX_SLIPS

pytestmark = pytest.mark.slow


def test_the_recording_is_small_and_has_its_licence():
    assert BOX_SLIPS.stat().st_size < 300_000
    assert "MIT License" in BOX_SLIPS.with_name("LICENSE.box-slips").read_text("utf-8")
    recording = load_recording(BOX_SLIPS)
    assert recording.complete
    assert recording.metadata["source"] == "imanlab/proactive-slip-control"


@pytest.fixture(scope="module")
def shown():
    lines = []
    return show_clip(0, lines.append), lines


def test_it_tells_what_happens_in_the_order_of_time(shown):
    events, lines = shown
    states = [event.state for event in events]
    assert states[0] == "STABLE"
    assert states.index("UNSTABLE") < states.index("slip") < states.index("NO_CONTACT")
    assert [event.time for event in events] == sorted(event.time for event in events)
    assert all(len(line) <= 80 for line in lines)
    assert len(lines) == 1 + len(events)


def test_lines_come_at_their_times(monkeypatch):
    waits = []
    monkeypatch.setattr(demo_replay.time, "sleep", waits.append)
    monkeypatch.setattr(demo_replay.time, "monotonic", lambda: 100.0)
    events = [ClipEvent(0.5, "STABLE", "a"), ClipEvent(2.0, "slip", "b")]
    monkeypatch.setattr(demo_replay, "_events", lambda: events)
    assert show_clip(2.0, lambda line: None) == events
    assert waits == [0.25, 1.0]
