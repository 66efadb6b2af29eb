"""Which models are exported for which hands, and what is refused."""

from dataclasses import replace

import pytest

import holdfast
from detection.detector.build import model as small_model
from detection.models import HAND, PATCH, TIP, built_in, paper
from holdfast.errors import ModelError
from holdfast.exporters import export, fingers_of_sensor
from holdfast.synthetic import synthetic_recording


def test_a_recording_gives_the_fingers(tmp_path):
    recording = synthetic_recording("made", 0, ("ring", "thumb"))
    written = holdfast.export(paper(), tmp_path / "model.h", like=recording)
    text = (tmp_path / "model.h").read_text()
    assert written.fingers == ("ring", "thumb")
    assert "HOLDFAST_FINGER_RING = 0" in text and "HOLDFAST_FIRST_TAXEL_THUMB = 30" in text
    assert written.size == len(text.encode())


def test_contact_at_the_start_is_in_the_metadata(tmp_path):
    recording = synthetic_recording("made", 0, ("thumb",))
    held = replace(recording, metadata={"starts_loaded": True})
    texts = [
        export(paper(), tmp_path / f"{k}.h", like=x, in_contact=y).header.text
        for k, (x, y) in enumerate(((recording, None), (held, None), (recording, True)))
    ]
    assert texts[1] == texts[2] != texts[0]


def test_the_fingers_of_a_sensor():
    assert list(fingers_of_sensor("uskin-4x4", "a, b")) == ["a", "b"]
    assert list(fingers_of_sensor("uskin-4x4", "3")) == ["finger1", "finger2", "finger3"]
    for wrong in ("", "a,,b", "a,a", "0"):
        with pytest.raises(ValueError, match="different names"):
            fingers_of_sensor("uskin-4x4", wrong)


def test_what_does_not_fit_is_refused(tmp_path):
    recording = synthetic_recording("made", 0, ("thumb",))
    out = tmp_path / "model.h"
    named = small_model(which=TIP, fingers=("thumb", "index"), rate=150.0)
    with pytest.raises(ModelError, match="thumb"):
        export(named, out, like=recording)
    with pytest.raises(ModelError, match="thumb"):
        export(small_model(which=TIP, fingers=("index",)), out, like=recording)
    with pytest.raises(ModelError, match="150 Hz"):
        export(built_in("any", rate=60.0), out, like=recording)
    with pytest.raises(ModelError, match="--like"):
        export(built_in("any"), out)
    with pytest.raises(ValueError, match=r"model.txt"):
        export(paper(), tmp_path / "model.txt", fingers=HAND)
    with pytest.raises(ModelError, match=r"thumb \(uskin-4x4\)"):
        export(built_in("twin"), out, fingers={"thumb": PATCH})
    assert list(tmp_path.iterdir()) == []


def test_names_of_fingers_that_are_no_words_are_made_so(tmp_path):
    fingers = {"left tip*/": TIP, "left tip?/": TIP}
    text = export(paper(), tmp_path / "model.h", fingers=fingers).header.text
    assert "HOLDFAST_FINGER_0 = 0" in text and text.split("\n#ifdef")[0].count("*/") == 1
