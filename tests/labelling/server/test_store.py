import json
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import Cause, ContactState
from holdfast.errors import OutputError, RecordingError
from holdfast.io import labels_path, load_labels, load_recording
from holdfast.io.label_files import label_bytes
from holdfast.labelling.server import store
from holdfast.labelling.server.store import (
    ConflictError,
    LabelInput,
    ReadOnlyError,
    cut_to_samples,
    is_read_only,
    parse_labels,
    read_stored,
    revision_of,
    save_stored,
    validated,
)
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import sensor
from traps import traps

from .build import NOW, made

HELD = Label(3.0, 4.0, ContactState.STABLE)
LOST = Label(4.0, 5.0, ContactState.UNSTABLE, Cause.LOST, "seen", 0.7, "eve")


@pytest.fixture(params=[".parquet", ".mcap"])
def labelled(request, tmp_path):
    """A recording with labels inside, and its path."""
    path = made(tmp_path, suffix=request.param, bare=False)
    return load_recording(path), path


@pytest.fixture
def bare(tmp_path):
    """A recording without labels, and its path."""
    path = made(tmp_path, "bare")
    return load_recording(path), path


def save(opened, labels, revision="none", **words):
    recording, path = opened
    given = {"author": "ada", "time": NOW, "note": "nice", **words}
    return save_stored(path, recording, labels, revision=revision, **given)


def test_saved_labels_are_read_back(labelled):
    recording, path = labelled
    stored = save(labelled, {"thumb": [LOST, HELD]})
    assert stored.labels == {"thumb": (replace(HELD, author="ada"), LOST), "index": ()}
    assert read_stored(path, recording) == stored
    assert (stored.author, stored.time, stored.note) == ("ada", NOW, "nice")
    assert (stored.origin, stored.revision) == ("file", revision_of(label_bytes(path)))
    assert load_recording(path).modules["thumb"].labels == stored.labels["thumb"]
    assert load_recording(path).modules["index"].labels == ()
    assert load_labels(labels_path(path)).time == NOW


def test_labels_inside_and_none(labelled, bare):
    recording, path = labelled
    inside = read_stored(path, recording)
    assert (inside.origin, inside.revision, inside.time) == ("inside", "none", "")
    assert inside.labels["thumb"] == recording.modules["thumb"].labels
    assert read_stored(bare[1], bare[0]).origin == "none"


def test_an_old_revision_is_refused_and_nothing_is_written(bare):
    recording, path = bare
    first = save(bare, {"thumb": [HELD]})
    second = save(bare, {"thumb": [LOST]}, first.revision)
    with pytest.raises(ConflictError, match=r"bare\.labels\.json") as raised:
        save(bare, {"index": [HELD]}, first.revision)
    assert raised.value.revision == second.revision == revision_of(label_bytes(path))
    assert read_stored(path, recording) == second
    labels_path(path).unlink()
    with pytest.raises(ConflictError) as raised:
        save(bare, {"index": [HELD]}, second.revision)
    assert raised.value.revision == "none"
    assert not labels_path(path).exists()


def test_saving_the_same_again_changes_no_revision(bare):
    first = save(bare, {"thumb": [HELD]})
    assert save(bare, {"thumb": [HELD]}, first.revision) == first
    assert save(bare, {"thumb": [HELD]}, first.revision, note="other").revision != first.revision


@traps
def test_no_label_file_is_read_or_replaced_but_a_file(bare, word, trap):
    recording, path = bare
    trap(labels_path(path))
    for act in (lambda: read_stored(path, recording), lambda: save(bare, {"thumb": [HELD]})):
        with pytest.raises(RecordingError, match=rf"bare\.labels\.json: it is a {word}"):
            act()


@pytest.mark.parametrize("content", [b"{", b'{"schema": "holdfast.labels/9"}'])
def test_a_damaged_label_file_is_left_alone(bare, content):
    recording, path = bare
    labels_path(path).write_bytes(content)
    for read in (
        lambda: read_stored(path, recording),
        lambda: save(bare, {"thumb": [HELD]}, revision_of(label_bytes(path))),
    ):
        with pytest.raises(RecordingError, match=r"bare\.labels\.json"):
            read()
    assert labels_path(path).read_bytes() == content


@pytest.mark.parametrize(
    ("finger", "spans", "text"),
    [
        ("pinky", [(3.0, 4.0)], ""),
        ("thumb", [(3.0, 4.0), (3.5, 4.5)], "[3.5, 4.5)"),
        ("thumb", [(-1.0, 4.0)], "[-1, 4)"),
        ("thumb", [(3.0, 99.0)], "[3, 99)"),
    ],
)
def test_labels_in_the_file_that_do_not_fit(bare, finger, spans, text):
    recording, path = bare
    save(bare, {})
    document = json.loads(labels_path(path).read_bytes())
    document.pop("digest", None)
    document["modules"][finger] = [
        {"start": start, "end": end, "state": "stable"} for start, end in spans
    ]
    labels_path(path).write_text(json.dumps(document))
    with pytest.raises(RecordingError) as raised:
        read_stored(path, recording)
    assert str(raised.value).startswith(f"{labels_path(path)}: ")
    assert finger in str(raised.value)
    assert text in str(raised.value)


@pytest.mark.parametrize(
    ("labels", "text"),
    [
        ({"pinky": [HELD]}, "pinky"),
        ({"thumb": [HELD, Label(3.5, 4.5, ContactState.UNSTABLE)]}, r"^thumb: .*\[3\.5, 4\.5\)"),
        ({"index": [Label(3.0, 99.0, ContactState.STABLE)]}, r"^index: .*\[3, 99\)"),
    ],
)
def test_labels_that_contradict(bare, labels, text):
    recording, path = bare
    with pytest.raises(ValueError, match=text):
        validated(recording, labels)
    with pytest.raises(ValueError, match=text):
        save(bare, labels)
    assert not labels_path(path).exists()


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (LabelInput(1, 2, "firm"), "'firm'"),
        (LabelInput(1, 2, "unknown"), "'unknown'"),
        (LabelInput(1, 2, "unstable", "magic"), "'magic'"),
        (LabelInput(2, 1, "stable"), r"\[2, 1\)"),
        (LabelInput(2, 2, "stable"), r"\[2, 2\)"),
        (LabelInput(float("nan"), 2, "stable"), r"\[nan, 2\)"),
        (LabelInput(1, float("inf"), "stable"), r"\[1, inf\)"),
        (LabelInput(1, 2, "stable", confidence=1.5), "confidence"),
    ],
)
def test_invalid_labels(given, text):
    with pytest.raises(ValueError, match=f"^thumb.*{text}"):
        parse_labels({"thumb": [given]})


def test_a_read_only_file(bare):
    recording, path = bare
    first = save(bare, {"thumb": [HELD]})
    assert not is_read_only(path)
    labels_path(path).chmod(0o444)
    assert is_read_only(path)
    with pytest.raises(ReadOnlyError, match=r"bare\.labels\.json"):
        save(bare, {}, first.revision)
    assert read_stored(path, recording) == first


def test_a_failed_write_leaves_the_old_file(bare, monkeypatch):
    recording, path = bare
    first = save(bare, {"thumb": [HELD]})

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(OutputError, match="No space left on device"):
        save(bare, {"thumb": [LOST]}, first.revision)
    assert read_stored(path, recording) == first
    assert sorted(p.name for p in path.parent.iterdir()) == ["bare.labels.json", "bare.parquet"]


def test_one_of_many_simultaneous_saves_succeeds(bare, monkeypatch):
    recording, path = bare
    write = store.write_whole

    def slowly(*given, **words):
        time.sleep(0.05)  # all others have read the revision by now, unless they have to wait
        write(*given, **words)

    monkeypatch.setattr(store, "write_whole", slowly)

    def attempt(number):
        try:
            return save(bare, {"thumb": [HELD]}, note=str(number))
        except ConflictError as conflict:
            return conflict.revision

    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(attempt, range(6)))
    (won,) = (each for each in found if not isinstance(each, str))
    assert read_stored(path, recording) == won
    assert [each for each in found if each is not won] == [won.revision] * 5


def uneven():
    """Two fingers at 100 Hz: the thumb from 0 to 1 s, the index from 0.2 to 0.8 s."""
    tip = sensor("uskin-4x4")
    times = np.arange(101) / 100
    thumb = Tactile(tip, times, np.zeros((len(times), 16, 3)))
    return Recording("uneven", {"thumb": thumb, "index": thumb.slice(20, 81)})


@pytest.mark.parametrize(
    ("given", "thumb", "index"),
    [
        ((0.0, 1.01), (0.0, 1.01), (0.2, 0.81)),  # all of the recording, its last sample too
        ((0.0, 0.5), (0.0, 0.5), (0.2, 0.5)),
        ((0.5, 1.0), (0.5, 1.0), (0.5, 0.81)),
        ((0.3, 0.4), (0.3, 0.4), (0.3, 0.4)),
        ((0.0, 0.2), (0.0, 0.2), None),
        ((0.9, 1.0), (0.9, 1.0), None),
    ],
)
def test_labels_are_cut_to_the_samples_of_their_finger(given, thumb, index):
    recording = uneven()
    label = Label(*given, ContactState.STABLE, confidence=0.5)
    found = cut_to_samples(recording, {"thumb": [label], "index": [label]})
    spans = {name: [(each.start, each.end) for each in own] for name, own in found.items()}
    expected = {"thumb": thumb, "index": index}
    assert spans == {name: [pytest.approx(own)] if own else [] for name, own in expected.items()}
    assert {each.confidence for own in found.values() for each in own} == {0.5}
    validated(recording, found)


@pytest.mark.parametrize("given", [(-0.1, 0.5), (0.5, 1.1)])
def test_labels_outside_the_recording_are_not_cut_but_refused(given):
    label = Label(*given, ContactState.STABLE)
    found = cut_to_samples(uneven(), {"index": [label]})
    assert found == {"index": (label,)}
    with pytest.raises(ValueError, match=r"^index: label .* lies outside the recording"):
        validated(uneven(), found)
