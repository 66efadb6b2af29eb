import os
import re
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import Cause, ContactState
from holdfast.errors import RecordingError
from holdfast.io import (
    labels_from_csv,
    labels_path,
    labels_to_csv,
    load_labels,
    load_recording,
    read_chunks,
    save_labels,
    save_recording,
)
from holdfast.recordings import Label
from traps import traps

MINE = (
    Label(0.5, 1.0, ContactState.UNSTABLE, Cause.SLIP, "video", 0.7, "me"),
    Label(1.0, 2.0, ContactState.STABLE, None, "video", 1.0, "me"),
)


@pytest.fixture
def saved(make_recording, tmp_path):
    """A recording on disk with labels beside it, and its path."""
    recording = make_recording().with_labels({"thumb": MINE})
    path = tmp_path / "can.parquet"
    save_recording(make_recording(), path)
    save_labels(recording, path, author="me", time="2026-11-21T10:00:00Z", notes="ä first try")
    return recording, path


def test_labels_beside_win_over_those_inside(saved, make_recording):
    _, path = saved
    loaded = load_recording(path)
    assert loaded.modules["thumb"].labels == MINE
    assert loaded.modules["index/1"].labels == ()
    inside = load_recording(path, labels=False)
    assert inside.modules["thumb"].labels == make_recording().modules["thumb"].labels


def test_the_file_says_who_when_and_what(saved):
    recording, path = saved
    file = load_labels(labels_path(path))
    assert (file.author, file.time) == ("me", "2026-11-21T10:00:00Z")
    assert (file.notes, file.name) == ("ä first try", "can_1")
    assert file.recording == recording.digest


@pytest.mark.parametrize("cause", [Cause.GLITCH, Cause.SLIP])
@pytest.mark.parametrize("state", [ContactState.UNSTABLE, ContactState.STABLE])
def test_a_cause_in_a_file_of_an_older_version_reads_as_what_it_was(saved, cause, state):
    recording, path = saved
    label = Label(0.5, 1.0, state, cause)
    save_labels(recording.with_labels({"thumb": [label]}), path, force=True)
    beside = labels_path(path)
    older = msgspec.json.decode(beside.read_bytes())
    del older["digest"]  # older versions wrote none
    beside.write_bytes(msgspec.json.encode(older))
    assert load_recording(path).modules["thumb"].labels == (label,)


def test_labels_of_another_recording_are_refused(saved, make_recording):
    _, path = saved
    save_recording(make_recording(seed=1), path, force=True)
    first, second = make_recording().digest[:12], make_recording(seed=1).digest[:12]
    with pytest.raises(RecordingError, match=f"{labels_path(path)} .*{first}.*{second}"):
        load_recording(path)


def changed(path, change):
    data = msgspec.json.decode(path.read_bytes())
    data.pop("digest")
    change(data)
    path.write_bytes(msgspec.json.encode(data))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda d: d.update(extra=1), "`extra`"),
        (lambda d: d.update(schema="holdfast.labels/2"), "'holdfast.labels/2'"),
        (lambda d: d["modules"]["thumb"][0].update(state="fine"), "'fine'"),
        (lambda d: d["modules"]["thumb"][0].update(start="now"), "`float`"),
        (lambda d: d["modules"]["thumb"][0].update(end=0.1), "[0.5, 0.1)"),
        (lambda d: d["modules"]["thumb"][0].update(confidence=2), "confidence"),
        (lambda d: d["modules"]["thumb"][1].update(end=1e3), "1000"),
        (lambda d: d["modules"].update(pinky=[]), "pinky"),
    ],
)
def test_wrong_label_files_are_refused(saved, change, text):
    _, path = saved
    changed(labels_path(path), change)
    with pytest.raises(RecordingError, match=re.escape(text)) as caught:
        load_recording(path)
    assert "can.labels.json" in str(caught.value)


def test_csv_goes_out_and_comes_in(tmp_path):
    path = tmp_path / "labels.csv"
    numpy = replace(MINE[0], start=np.float64(0.5), end=np.float32(1.0))
    path.write_text(labels_to_csv({"thumb": (numpy, MINE[1]), "index": MINE[:1]}))
    assert path.read_text().splitlines()[:2] == [
        "finger,start,end,state,cause",
        "thumb,0.5,1.0,unstable,slip",
    ]
    labels = labels_from_csv(path, author="me")
    assert list(labels) == ["thumb", "index"]
    got = labels["thumb"]
    assert [(x.start, x.end, x.state, x.cause) for x in got] == [
        (x.start, x.end, x.state, x.cause) for x in MINE
    ]
    assert got[0].author == "me"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("finger,start,end\nthumb,0,1\n", "state"),
        ("finger,start,end,state\nthumb,a,1,stable\n", "'a'"),
        ("finger,start,end,state\nthumb,0,1,fine\n", "'FINE'"),
        ("finger,start,end,state\nthumb,1,0,stable\n", r"\[1.0, 0.0\)"),
    ],
)
def test_wrong_csv_is_refused(tmp_path, text, message):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(RecordingError, match=rf"a\.csv, row 2: .*{message}"):
        labels_from_csv(tmp_path / "a.csv")


@pytest.mark.parametrize("read", [load_labels, labels_from_csv])
def test_files_that_cannot_be_read(tmp_path, read):
    path = tmp_path / "a"
    with pytest.raises(RecordingError, match="No such file"):
        read(path)
    path.write_text("finger,start\n1")
    with pytest.raises(RecordingError, match=str(path)):
        read(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(RecordingError, match="a pipe"):
        read(path)


@traps
def test_no_label_file_is_read_but_a_file(saved, word, trap):
    path = saved[1]
    labels_path(path).unlink()
    trap(labels_path(path))
    for read in (load_recording, lambda path: list(read_chunks(path, 100))):
        with pytest.raises(RecordingError, match=rf"labels\.json: it is a {word}"):
            read(path)


@pytest.mark.slow
def test_any_flipped_bit_is_found(make_recording, tmp_path):
    recording = make_recording(150)
    path = save_labels(recording, tmp_path / "a.parquet", author="ada", notes="ü", time="2026")
    raw = path.read_bytes()
    modules = load_labels(path).modules
    n_harmless = 0
    for bit in range(0, 8 * len(raw), 7):
        damaged = bytearray(raw)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            assert load_labels(path).modules == modules
            n_harmless += 1
        except RecordingError:
            continue
    assert n_harmless < 25  # 2.0 and 2.00, or a space and another space


def test_a_file_without_a_digest_is_read_and_an_edited_one_is_refused(make_recording, tmp_path):
    recording = make_recording(150)
    path = save_labels(recording, tmp_path / "a.parquet", author="ada")
    text = path.read_text()
    path.write_text(text.replace('"ada"', '"bob"'))
    with pytest.raises(RecordingError, match=f'{path} .*"digest"'):
        load_labels(path)
    lines = [line for line in text.replace('"ada"', '"bob"').splitlines() if '"digest"' not in line]
    path.write_text("\n".join(lines).replace('"notes": "",', '"notes": ""'))
    assert load_labels(path).author == "bob"
