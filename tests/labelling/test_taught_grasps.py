import re
from dataclasses import replace

import pytest

from holdfast.contact import Cause, ContactState
from holdfast.io import load_recording, save_recording
from holdfast.labelling import taught_grasps
from holdfast.labelling.taught_grasps import label_grasp, slides_of, throw_away, write_pictures
from holdfast.live.teaching.steps import STEPS
from holdfast.metrics.slip_truth import slip_truth
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording

STEP = {step.name: step for step in STEPS}


def slip(start, end, text="slides 0.80 mm, onset +/- 4 ms; a video"):
    return Label(start, end, ContactState.UNSTABLE, Cause.SLIP, text, 0.9, "rule:tracking")


def held(start, end):
    return Label(start, end, ContactState.STABLE, None, "force", 0.9, "rule:signal")


LABELS = {
    "thumb": (held(2.5, 3.0), slip(3.0, 3.2), held(3.2, 6.0), slip(6.0, 6.3), held(6.3, 8.0)),
    "index": (held(2.5, 3.1), slip(3.1, 3.3), held(3.3, 8.0)),
}


@pytest.fixture
def grasp(tmp_path):
    """Path of a recorded grasp of two fingers, without labels."""
    recording = synthetic_recording("004-pull", 1, ("thumb", "index"))
    modules = {name: replace(x, labels=()) for name, x in recording.modules.items()}
    path = tmp_path / "004-pull.mcap"
    save_recording(replace(recording, modules=modules), path)
    return path


def test_slips_that_follow_each_other_are_one_slide():
    slides = slides_of(LABELS)
    assert [(x.start, x.end, sorted(x.slips)) for x in slides] == [
        (3.0, 3.3, ["index", "thumb"]), (6.0, 6.3, ["thumb"])
    ]  # fmt: skip
    assert slides[0].slips["thumb"].start == 3.0


def test_slips_come_from_the_video(grasp, monkeypatch):
    asked = []

    def propose(rule, recording, **parameters):
        asked.append((rule, parameters))
        return LABELS

    monkeypatch.setattr(taught_grasps, "propose", propose)
    slides, note = label_grasp(grasp, STEP["pull"])
    assert (len(slides), note) == (2, "")
    assert asked == [("tracking", {"video": grasp.with_suffix(".mp4")})]
    truth = slip_truth(load_recording(grasp), "thumb", [3.1])
    assert [(x.onset, x.end) for x in truth.slips] == [(3.0, 3.2), (6.0, 6.3)]


def test_without_pictures_nothing_is_a_slip_and_the_reason_is_returned(grasp):
    slides, note = label_grasp(grasp, STEP["pull"])
    assert slides is None
    assert "004-pull.mp4" in note
    assert not any(module.labels for module in load_recording(grasp).modules.values())


def test_a_step_in_which_nothing_slides_teaches_what_is_no_slip(grasp):
    assert label_grasp(grasp, STEP["carry"]) == (None, "")
    labels = load_recording(grasp).modules["thumb"].labels
    assert {x.author for x in labels} == {"rule:teach"}
    assert all("step carry" in x.evidence for x in labels)
    shaken = [x for x in labels if x.start < 5.9 < x.end]
    assert {x.cause for x in shaken if x.state is ContactState.UNSTABLE} == {Cause.DISTURBANCE}


def test_a_slide_that_is_thrown_away_is_neither_a_slip_nor_none(grasp, monkeypatch):
    monkeypatch.setattr(taught_grasps, "propose", lambda *_, **__: LABELS)
    label_grasp(grasp, STEP["pull"])
    assert [x.start for x in throw_away(grasp, 1)] == [6.0]
    labels = load_recording(grasp).modules["index"].labels
    assert [(x.start, x.end) for x in labels] == [(2.5, 2.9), pytest.approx((3.4, 8.0))]
    with pytest.raises(ValueError, match="slide 2"):
        throw_away(grasp, 2)


def test_each_slide_has_a_picture_with_its_onsets(grasp, monkeypatch):
    monkeypatch.setattr(taught_grasps, "propose", lambda *_, **__: LABELS)
    label_grasp(grasp, STEP["pull"])
    page = write_pictures(grasp.parent, ["004-pull"]).read_text()
    assert len(re.findall("<svg", page)) == 2
    assert len(re.findall("<polyline", page)) == 4
    assert len(re.findall("stroke-dasharray", page)) == 3
    assert "thumb</b> 3.00 s: slides 0.80 mm, onset +/- 4 ms" in page
    assert "<svg" not in write_pictures(grasp.parent, []).read_text()
