import json
import re
from dataclasses import replace

import pytest

from holdfast.contact import ContactState
from holdfast.errors import RecordingError
from holdfast.io import labels_to_csv, save_labels, save_recording
from holdfast.labelling.labelled_files import read_labels
from holdfast.recordings import Label
from holdfast.removed import REMOVED
from holdfast.synthetic import synthetic_recording


@pytest.fixture(scope="module")
def grasp():
    return synthetic_recording("grasp-3", 3, ("thumb", "index"))


@pytest.fixture(scope="module")
def bare(grasp):
    return grasp.with_labels({})


def labels_in(recording):
    return {name: module.labels for name, module in recording.modules.items()}


def plain(labels):
    """Labels without the fields that a table does not have."""
    return {
        name: [(x.start, x.end, x.state, x.cause) for x in each] for name, each in labels.items()
    }


def as_csv(grasp, folder, ending=".csv"):
    path = folder / f"{grasp.name}{ending}"
    path.write_text(labels_to_csv(labels_in(grasp)))
    return path


def as_recording(grasp, folder, ending=".parquet"):
    path = folder / f"{grasp.name}{ending}"
    save_recording(grasp, path)
    return path


def as_mcap(grasp, folder):
    return as_recording(grasp, folder, ".mcap")


def as_label_file(grasp, folder):
    return save_labels(grasp, folder / f"{grasp.name}.parquet")


KINDS = (as_csv, as_recording, as_mcap, as_label_file)


@pytest.mark.parametrize("write", KINDS)
def test_labels_of_every_kind_of_file_and_in_a_folder(tmp_path, grasp, bare, write):
    for path in (write(grasp, tmp_path), tmp_path):
        assert plain(read_labels(path, bare)) == plain(labels_in(grasp))


def test_a_label_file_comes_before_the_recording(tmp_path, grasp, bare):
    as_recording(grasp, tmp_path)
    drawn = bare.with_labels({"thumb": [Label(0.0, 1.0, ContactState.STABLE)]})
    as_label_file(drawn, tmp_path)
    as_csv(grasp, tmp_path)
    assert list(read_labels(tmp_path, bare)) == ["thumb"]


def test_labels_come_in_order_and_without_fingers_that_have_none(tmp_path, grasp, bare):
    path = tmp_path / "labels.csv"
    path.write_text("finger,start,end,state,cause\nthumb,2,3,stable,\nthumb,1,2,unstable,slip\n")
    assert [x.start for x in read_labels(path, bare)["thumb"]] == [1.0, 2.0]
    assert list(read_labels(path, bare)) == ["thumb"]


def refused(path, recording, text):
    with pytest.raises(RecordingError, match=f"{path}.*{re.escape(text)}"):
        read_labels(path, recording)


@pytest.mark.parametrize("write", [as_label_file, as_recording])
def test_labels_of_another_recording(tmp_path, grasp, write):
    other = replace(grasp, name="other", modules={"thumb": grasp.modules["thumb"]})
    refused(write(grasp, tmp_path), other, grasp.digest[:12])


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.csv", "finger,start,end,state\nthumb,1,3,stable\nthumb,2,4,unstable\n", "[2, 4)"),
        ("a.csv", "finger,start,end,state\npinky,1,3,stable\n", "pinky"),
        ("a.txt", "", ".txt given"),
        ("odd.json", "[]", "is not a label file"),
        ("tasks.json", "[]", REMOVED["labels"]["label-studio"]),
        ("tasks.labels.json", "[]", "`array`"),
    ],
)
def test_files_that_cannot_be_read(tmp_path, bare, name, content, text):
    (tmp_path / name).write_text(content)
    refused(tmp_path / name, bare, text)


def test_labels_that_are_reversed(tmp_path, grasp, bare):
    path = as_label_file(grasp, tmp_path)
    document = json.loads(path.read_text())
    del document["digest"]
    document["modules"]["thumb"][0] |= {"start": 3.0, "end": 1.0}
    path.write_text(json.dumps(document))
    refused(path, bare, "[3.0, 1.0)")


def test_what_is_not_there(tmp_path, bare):
    refused(tmp_path / "no.json", bare, "No such file")
    with pytest.raises(RecordingError, match=f"'grasp-3' in {tmp_path}"):
        read_labels(tmp_path, bare)
