import json
from dataclasses import replace

import pytest

from holdfast.contact import ContactState
from holdfast.errors import RecordingError
from holdfast.io import labels_to_csv, save_labels, save_recording
from holdfast.labelling.labelled_files import read_labels
from holdfast.recordings import Label
from holdfast.removed import REMOVED
from labelling.tiny import tiny_recording


@pytest.fixture(scope="module")
def grasp():
    return tiny_recording(3)


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
def test_labels_of_every_kind_of_file(tmp_path, grasp, bare, write):
    path = write(grasp, tmp_path)
    assert plain(read_labels(path, bare)) == plain(labels_in(grasp))


@pytest.mark.parametrize("write", KINDS)
def test_labels_of_every_kind_of_file_in_a_folder(tmp_path, grasp, bare, write):
    write(grasp, tmp_path)
    assert plain(read_labels(tmp_path, bare)) == plain(labels_in(grasp))


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


def refusal(path, recording):
    with pytest.raises(RecordingError) as error:
        read_labels(path, recording)
    return str(error.value).replace(f"{path}", "PATH")


@pytest.mark.parametrize("write", [as_label_file, as_recording])
def test_labels_of_another_recording(tmp_path, grasp, write):
    other = replace(tiny_recording(5), name="other")
    path = write(grasp, tmp_path)
    assert refusal(path, other) == (
        f"PATH labels another recording ('grasp-3', hash {grasp.digest[:12]}) than 'other' "
        f"(hash {other.digest[:12]})"
    )


def test_labels_that_overlap(tmp_path, bare):
    path = tmp_path / "labels.csv"
    path.write_text("finger,start,end,state,cause\nthumb,1,3,stable,\nthumb,2,4,unstable,\n")
    assert refusal(path, bare) == "PATH: labels overlap: [1, 3) s and [2, 4) s"


def test_labels_that_are_reversed(tmp_path, grasp, bare):
    path = as_label_file(grasp, tmp_path)
    document = json.loads(path.read_text())
    del document["digest"]
    document["modules"]["thumb"][0] |= {"start": 3.0, "end": 1.0}
    path.write_text(json.dumps(document))
    assert refusal(path, bare) == "PATH: a label ends after its start; [3.0, 1.0) s given"


def test_labels_of_a_finger_that_is_not_there(tmp_path, bare):
    path = tmp_path / "labels.csv"
    path.write_text("finger,start,end,state,cause\npinky,1,3,stable,\n")
    assert refusal(path, bare) == (
        "PATH: labels for pinky given; recording 'grasp-3' has thumb, index"
    )


def test_a_folder_without_labels_of_it(tmp_path, bare):
    assert refusal(tmp_path, bare) == (
        "no labels of 'grasp-3' in PATH; grasp-3 with one of .labels.json, .parquet, .mcap, "
        ".labels.csv, .csv expected"
    )


def test_files_without_labels(tmp_path, bare):
    assert refusal(tmp_path / "labels.txt", bare) == (
        "cannot read labels from PATH: .txt given; .labels.json, .csv, .parquet or .mcap expected"
    )
    assert refusal(tmp_path / "no.json", bare) == "cannot read PATH: No such file or directory"
    (tmp_path / "odd.json").write_text("[]")
    assert refusal(tmp_path / "odd.json", bare).startswith("PATH is not a label file: ")


def test_json_of_label_studio(tmp_path, bare):
    for name, end in (("tasks.json", REMOVED["labels"]["label-studio"]),
                      ("tasks.labels.json", "got `array`")):  # fmt: skip
        (tmp_path / name).write_text("[]")
        text = refusal(tmp_path / name, bare)
        assert text.startswith("PATH is not a label file: ")
        assert text.endswith(end)
