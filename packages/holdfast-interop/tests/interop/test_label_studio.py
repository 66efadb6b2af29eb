import json
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.recordings import Label, Recording, Tactile
from holdfast_interop.label_studio.reading import (
    annotations_of,
    is_label_studio,
    label_name,
    labels_from_label_studio,
    state_of,
)
from holdfast_interop.label_studio.writing import task_of
from labelling.tiny import TINY

TIMES = np.arange(400) / 100.0
FINGERS = ("thumb", "index")


def bare(name="can"):
    modules = {
        finger: Tactile(TINY, TIMES, np.full((400, 1, 3), k)) for k, finger in enumerate(FINGERS)
    }
    return Recording(name, modules)


def region(start, end, name="STABLE", finger="thumb", **more):
    value = {"start": start, "end": end, "instant": False, "timeserieslabels": [name]}
    return {
        "id": "Sd1",
        "type": "timeserieslabels",
        "from_name": finger,
        "to_name": "ts",
        "origin": "manual",
        "value": value,
    } | more


def annotation(*results, by=1, number=7, **more):
    return {"id": number, "completed_by": by, "was_cancelled": False, "result": results} | more


def export(tmp_path, *annotations, predictions=(), data=None):
    """A file as Label Studio writes it."""
    task = {
        "id": 3,
        "annotations": annotations,
        "file_upload": "0123abcd-can.signals.csv",
        "drafts": [],
        "predictions": predictions,
        "data": {"csv": "/data/upload/3/0123abcd-can.signals.csv"} if data is None else data,
        "meta": {},
        "created_at": "2026-01-02T03:04:05.000006Z",
        "inner_id": 1,
        "project": 4,
    }
    path = tmp_path / "project-4.json"
    path.write_text(json.dumps([task]))
    return path


def refusal(path, recording=None, annotator=None):
    with pytest.raises(RecordingError) as error:
        labels_from_label_studio(path, recording or bare(), annotator)
    text = str(error.value)
    assert "\n" not in text
    return text.replace(str(path), "FILE")


def test_regions_are_labels(tmp_path):
    path = export(
        tmp_path,
        annotation(
            region(1.0, 2.5),
            region(0.5, 1.0, "UNSTABLE (closing)"),
            region(0.25, 3.0, "no_contact", finger="index"),
            by={"id": 5, "email": "ann@lab.org", "first_name": "Ann"},
        ),
    )
    assert labels_from_label_studio(path, bare()) == {
        "thumb": (
            Label(0.5, 1.0, ContactState.UNSTABLE, Cause.CLOSING, author="ann@lab.org"),
            Label(1.0, 2.5, ContactState.STABLE, author="ann@lab.org"),
        ),
        "index": (Label(0.25, 3.0, ContactState.NO_CONTACT, author="ann@lab.org"),),
    }


@st.composite
def labels(draw):
    """Labels of a finger, some adjacent, some apart, with all fields."""
    cuts = sorted(draw(st.lists(st.floats(0, 4), unique=True, max_size=8)))
    spans = [pair for pair in pairwise(cuts) if draw(st.booleans())]
    states = st.sampled_from([s for s in ContactState if s is not ContactState.UNKNOWN])
    return tuple(
        Label(
            *span,
            draw(states),
            draw(st.none() | st.sampled_from(Cause)),
            draw(st.sampled_from(["", "hand", "slip measured by marker"])),
            draw(st.floats(0, 1)),
            draw(st.sampled_from(["", "rule:signal", "ann"])),
        )
        for span in spans
    )


@given(labels(), labels(), st.booleans())
def test_exported_labels_are_read_back(tmp_path_factory, thumb, index, predictions):
    recording = bare().with_labels({"thumb": thumb, "index": index})
    path = tmp_path_factory.mktemp("export") / "tasks.json"
    task = task_of(recording, "http://localhost/can.signals.csv", predictions=predictions)
    path.write_bytes(msgspec.json.encode([task]))
    found = annotations_of(path, bare())
    assert [each.prediction for each in found] == [predictions] * bool(thumb or index)
    back = found[0].labels if found else {}
    author = "holdfast" if predictions else ""
    for finger, given_labels in (("thumb", thumb), ("index", index)):
        expected = [
            by_author(label, author) if not label.author else label for label in given_labels
        ]
        assert list(back.get(finger, ())) == expected


def by_author(label, author):
    return Label(
        label.start, label.end, label.state, label.cause, label.evidence, label.confidence, author
    )


@pytest.mark.parametrize("cause", [None, *Cause])
@pytest.mark.parametrize("state", list(ContactState)[1:])
def test_names_of_labels(state, cause):
    assert state_of(label_name(state, cause)) == (state, cause)
    assert state_of(label_name(state, cause).lower()) == (state, cause)


def test_several_annotators(tmp_path):
    path = export(
        tmp_path,
        annotation(region(0.0, 1.0), by={"id": 5, "email": "ann@lab.org"}),
        annotation(region(0.0, 2.0), by=6),
        annotation(region(0.0, 3.0), by=7, was_cancelled=True),
        predictions=[{"model_version": "v2", "result": [region(0.0, 4.0)]}],
    )
    found = annotations_of(path, bare())
    assert [(each.annotator, each.prediction) for each in found] == [
        ("ann@lab.org", False),
        ("6", False),
        ("v2", True),
    ]
    ends = {
        who: labels_from_label_studio(path, bare(), who)["thumb"][0].end
        for who in ("ann@lab.org", "6", "v2")
    }
    assert ends == {"ann@lab.org": 1.0, "6": 2.0, "v2": 4.0}
    assert refusal(path) == (
        "FILE: one annotation of 'can' expected, 2 found; its annotators are "
        "ann@lab.org, 6, v2 (prediction)"
    )
    assert refusal(path, annotator="bob") == (
        "FILE: one annotation by 'bob' of 'can' expected, 0 found; its annotators are "
        "ann@lab.org, 6, v2 (prediction)"
    )


def test_a_person_takes_precedence_over_models(tmp_path):
    made = [{"model_version": "v2", "result": [region(0.0, 4.0)]}]
    path = export(tmp_path, annotation(region(0.0, 1.0)), predictions=made)
    assert labels_from_label_studio(path, bare())["thumb"][0].end == 1.0


def test_a_model_is_used_without_a_person(tmp_path):
    made = [{"model_version": "v2", "result": [region(0.0, 4.0, score=0.7)]}]
    (label,) = labels_from_label_studio(export(tmp_path, predictions=made), bare())["thumb"]
    assert (label.confidence, label.author) == (0.7, "v2")


def test_no_annotation_at_all(tmp_path):
    assert refusal(export(tmp_path, predictions=[12, 13])) == (
        "FILE: one annotation of 'can' expected, 0 found; its annotators are none"
    )


def test_the_author_of_a_changed_proposal_is_the_person(tmp_path):
    proposed = {"meta": {"author": "rule:signal", "evidence": "force"}}
    path = export(
        tmp_path,
        annotation(
            region(0.0, 1.0, origin="prediction", **proposed),
            region(1.0, 2.0, origin="prediction-changed", **proposed),
            by=6,
        ),
    )
    authors = [label.author for label in labels_from_label_studio(path, bare())["thumb"]]
    assert authors == ["rule:signal", "6"]


def test_regions_of_other_types_are_ignored(tmp_path):
    note = {"type": "textarea", "from_name": "note", "value": {"text": ["odd"]}}
    path = export(tmp_path, annotation(note, region(0.0, 1.0), {"type": "relation"}))
    assert len(labels_from_label_studio(path, bare())["thumb"]) == 1


@pytest.mark.parametrize(
    ("results", "text"),
    [
        (
            [region(0.0, 1.0, "Run")],
            "unknown label 'Run'; there are STABLE, UNSTABLE, NO_CONTACT, alone or with a cause "
            "in brackets (closing, disturbance, slip, lost, released, glitch)",
        ),
        (
            [region(0.0, 1.0, "STABLE (wind)")],
            "unknown label 'STABLE (wind)'; there are STABLE, UNSTABLE, NO_CONTACT, alone or "
            "with a cause in brackets (closing, disturbance, slip, lost, released, glitch)",
        ),
        ([region(2.0, 1.0)], "a label ends after its start; [2.0, 1.0) s given"),
        ([region(2.0, 2.0)], "an instant at 2 s given, an interval expected"),
        (
            [region(0.0, 1.0) | {"value": region(0, 1)["value"] | {"timeserieslabels": []}}],
            "one label for an interval expected, given: none",
        ),
        (
            [region("2026-01-02", "2026-01-03")],
            "start and end in seconds and one label expected (Expected `float`, got `str` - at "
            "`$.start`); a labelling config with a timeFormat exports dates: leave it out",
        ),
        ([region(0.0, 1.0, score=1.5)], "confidence from 0 to 1 expected, 1.5 given"),
    ],
)
def test_invalid_regions(tmp_path, results, text):
    path = export(tmp_path, annotation(*results))
    assert refusal(path) == f"FILE, 'can', annotation 7, thumb: {text}"


@pytest.mark.parametrize(
    ("results", "text"),
    [
        (
            [region(0.0, 1.0), region(0.5, 2.0, "UNSTABLE")],
            "labels overlap: [0, 1) s and [0.5, 2) s",
        ),
        (
            [region(3.0, 5.0)],
            "label [3, 5) s lies outside the recording, which runs from 0 to 4.005 s",
        ),
        (
            [region(0.0, 1.0, finger="label")],
            "label group 'label' is no finger; one group for each of thumb, index expected",
        ),
    ],
)
def test_labels_that_do_not_fit_the_recording(tmp_path, results, text):
    path = export(tmp_path, annotation(*results))
    assert refusal(path) == f"FILE, 'can', annotation 7: {text}"


def test_predictions_are_named_in_messages(tmp_path):
    made = [{"model_version": "v2", "result": [region(2.0, 1.0)]}]
    assert refusal(export(tmp_path, predictions=made)).startswith(
        "FILE, 'can', prediction 'v2', thumb: a label ends after its start"
    )


@pytest.mark.parametrize(
    "link",
    [
        "/data/upload/3/0123abcd-can%20two.signals.csv",
        "/data/local-files/?d=grasps/can%20two.csv",
        "s3://bucket/folder/can two.CSV",
        "can two.tsv",
    ],
)
def test_a_task_is_found_by_the_name_of_its_file(tmp_path, link):
    path = export(tmp_path, annotation(region(0.0, 1.0)), data={"ts": link, "n": 3})
    assert labels_from_label_studio(path, bare("can two"))


def test_a_task_is_found_by_its_hash_under_any_name(tmp_path):
    data = {"csv": "a.csv", "recording": "old name", "digest": bare().digest}
    path = export(tmp_path, annotation(region(0.0, 1.0)), data=data)
    assert labels_from_label_studio(path, bare("new name"))


def test_another_recording_of_the_same_name(tmp_path):
    data = {"csv": "can.csv", "recording": "can", "digest": "0123456789abcdef"}
    path = export(tmp_path, annotation(region(0.0, 1.0)), data=data)
    assert refusal(path) == (
        "FILE: the task of 'can' is of another recording of that name "
        f"(hash 0123456789ab, not {bare().digest[:12]})"
    )


def test_no_task_of_the_recording(tmp_path):
    path = export(tmp_path, annotation(region(0.0, 1.0)))
    assert refusal(path, bare("cup")) == (
        "FILE: one task of 'cup' expected, 0 found; its 1 tasks are of can"
    )


def test_two_tasks_of_one_recording(tmp_path):
    path = export(tmp_path, annotation(region(0.0, 1.0)))
    path.write_text(json.dumps(2 * json.loads(path.read_text())))
    assert refusal(path) == "FILE: one task of 'can' expected, 2 found; its 2 tasks are of can"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("[", "Input data was truncated"),
        ("3", "Expected `object`, got `int` - at `$[0]`"),
        ('[{"data": 3}]', "Expected `object`, got `int` - at `$[0].data`"),
        ('[{"data": {}, "annotations": 3}]', "Expected `array`, got `int` - at `$[0].annotations`"),
    ],
)
def test_no_export(tmp_path, text, found):
    path = tmp_path / "tasks.json"
    path.write_text(text)
    assert refusal(path) == f"FILE is no JSON export of Label Studio: {found}"
    path.write_text("[" * 100_000)
    assert refusal(path).startswith("FILE is no JSON export of Label Studio: ")


def test_no_file(tmp_path):
    assert refusal(tmp_path / "no.json") == "cannot read FILE: No such file or directory"


def test_json_of_label_studio_is_recognized():
    assert is_label_studio(b'[{"data": {}}]')
    assert is_label_studio(b'{"data": {}}')
    assert not is_label_studio(b'{"schema": "holdfast.labels/1"}')
    assert not is_label_studio(b"[]")
    assert not is_label_studio(b"\xff")
    assert not is_label_studio(b"[" * 100_000)
