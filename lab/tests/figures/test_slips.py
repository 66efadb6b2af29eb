import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from holdfast.contact import SLIP_CODE
from holdfast_lab.figures import slips
from holdfast_lab.figures.slips import COLUMN_WIDTH, event_kinds, slip_figure, slips_figure
from study.example_recordings import SLIPS, recording_with_truth

EVENTS = [
    {"kind": "weight", "start": 5.5, "end": 6.3, "slid": 5e-3},
    {"kind": "grip", "start": 7.0, "end": 8.0, "slid": 0.0},
]


@pytest.fixture
def recording():
    made = recording_with_truth("grasp", 0)
    fingers = {name: dict(arrays) for name, arrays in made.truth.fingers.items()}
    times = made.truth.times
    fingers["thumb"]["slipping_share"] = np.where(times >= 5.7, 1.0, 0.2)
    truth = replace(made.truth, fingers=fingers)
    return replace(made, truth=truth, metadata={**made.metadata, "slip_events": EVENTS})


@pytest.fixture
def model(monkeypatch, recording):
    """A model that reports a slip from 5.65 to 5.8 s."""
    times = recording.modules["thumb"].times
    decided = (times >= 5.65) & (times < 5.8)
    trace = SimpleNamespace(
        times=times,
        slip_probability=np.where(decided, 0.4, 0.01),
        cause=np.where(decided, SLIP_CODE, 0),
    )
    detection = SimpleNamespace(fingers=dict.fromkeys(recording.modules, trace))
    monkeypatch.setattr(slips, "detect", lambda *_: detection)
    rule = SimpleNamespace(threshold=0.3)
    return SimpleNamespace(name="mine", finger=lambda *_: SimpleNamespace(slip=rule))


def test_kinds_of_events_in_which_a_finger_slips(recording):
    assert event_kinds(recording) == ["weight"]
    slid = 0.01 * sum(b - a for a, b in SLIPS)
    assert event_kinds(recording, 0.9 * slid) == ["weight"]
    assert event_kinds(recording, 1.1 * slid) == []
    assert event_kinds(replace(recording, metadata={})) == []
    assert event_kinds(replace(recording, truth=None)) == []


def test_a_figure_shows_truth_and_decisions_from_the_first_onset(model, recording):
    figure = slip_figure(model, recording, "weight")
    assert figure.get_size_inches()[0] == COLUMN_WIDTH
    speed, distance, probability, strips = figure.axes
    slid = distance.lines[-1].get_ydata()
    assert slid[0] == 0
    assert slid[-1] == pytest.approx(1e3 * 0.01 * sum(b - a for a, b in SLIPS), rel=0.02)
    assert 0.3 in probability.lines[-1].get_ydata()
    assert speed.get_title(loc="left").startswith("weight is added: ")
    first = SLIPS[0][0]
    sliding, raised = (
        [path.get_extents() for path in bars.get_paths()] for bars in strips.collections
    )
    assert [box.x0 for box in sliding] == pytest.approx([a - first for a, _ in SLIPS], abs=0.01)
    assert [(box.x0, box.x1) for box in raised] == [
        (pytest.approx(0.05, abs=0.01), pytest.approx(0.2, abs=0.01))
    ]
    figure.savefig(io.BytesIO())


def test_onsets_are_marked(model, recording):
    """Two incipient and two gross: the second slip is gross at once."""
    axes = slip_figure(model, recording, "weight").axes[1]
    marked = sorted(line.get_xdata()[0] for line in axes.lines if len(line.get_xdata()) == 2)
    assert marked == pytest.approx([0.0, 0.1, 0.4, 0.4], abs=0.01)


def test_an_event_without_a_slip_cannot_be_drawn(model, recording):
    with pytest.raises(ValueError, match="grasp has no slip event 'grip' in which a finger slips"):
        slip_figure(model, recording, "grip")
    without = SimpleNamespace(name="mine", finger=lambda *_: SimpleNamespace(slip=None))
    with pytest.raises(ValueError, match="mine has no slip rule of the thumb"):
        slip_figure(without, recording, "weight")


def test_a_figure_of_several_slips_has_a_panel_for_each_and_a_legend(model, recording):
    figure = slips_figure(model, [(recording, "weight")] * 3)
    panels = [place for place in figure.subfigs if place.axes]
    assert len(panels) == 3
    for panel in panels:
        speed, probability, strips = panel.axes
        assert speed.get_title(loc="left").startswith("weight is added: ")
        assert 0.3 in probability.lines[-1].get_ydata()
        assert len(strips.collections) == 2
    (legend,) = figure.subfigs[-1].legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "a slip begins", "it becomes gross", "1 mm/s: faster is sliding", "threshold of the model",
    ]  # fmt: skip
    figure.savefig(io.BytesIO())


def test_a_low_probability_is_drawn_at_the_lower_end(model, recording):
    axes = slip_figure(model, recording, "weight").axes[2]
    assert axes.get_yscale() == "log"
    assert min(axes.lines[-2].get_ydata()) >= slips.LOWEST_SHOWN_PROBABILITY
