"""Label Studio as a plug-in: `holdfast label export` and `label import`, and `read_labels`."""

import json

import pytest

from cli.label.conftest import folder
from cli.label.helpers import refusal, run_json
from holdfast.io import labels_path, load_labels, load_recording
from holdfast.labelling.exchange.read_labels import read_labels
from holdfast_interop.label_studio.writing import save_label_studio
from labelling.exchange.test_read_labels import labels_in, plain
from labelling.tiny import tiny_recording

__all__ = ["folder"]


@pytest.fixture(scope="module")
def grasp():
    return tiny_recording(3)


@pytest.fixture(scope="module")
def bare(grasp):
    return grasp.with_labels({})


def as_label_studio(grasp, folder):
    return save_label_studio([tiny_recording(4), grasp], folder)


def test_labels_of_an_export_and_of_a_folder_with_it(tmp_path, grasp, bare):
    path = as_label_studio(grasp, tmp_path)
    for place in (path, tmp_path):
        assert plain(read_labels(place, bare)) == plain(labels_in(grasp))


def test_an_annotator_may_be_chosen(tmp_path, grasp, bare):
    path = as_label_studio(grasp, tmp_path)
    tasks = json.loads(path.read_text())
    result = tasks[1]["annotations"][0]["result"]
    tasks[1]["annotations"] = [
        {"completed_by": 1, "result": result[:1]},
        {"completed_by": 2, "result": result},
    ]
    path.write_text(json.dumps(tasks))
    assert len(read_labels(path, bare, "1")["thumb"]) == 1
    assert len(read_labels(tmp_path, bare, "2")["thumb"]) == 4


def test_labels_go_to_label_studio_and_back(capsys, folder):
    out = folder.parent / "studio"
    found = run_json(capsys, "--export", "label-studio", out, folder)
    assert (out / "label-studio.json") in map(type(out), found["written"])
    assert "exists already" in refusal(capsys, "--export", "label-studio", out, folder)
    before = {path.stem: load_recording(path).modules["thumb"].labels for path in folder.iterdir()}
    taken = run_json(capsys, "--import", out / "label-studio.json", folder, "--author", "bob")
    assert [each["name"] for each in taken["recordings"]] == ["one", "two"]
    for path in sorted(folder.glob("[ot]*.[pm]*")):
        labels = load_recording(path).modules["thumb"].labels
        assert [(x.start, x.end, x.state, x.cause) for x in labels] == [
            (x.start, x.end, x.state, x.cause) for x in before[path.stem]
        ]
        assert load_labels(labels_path(path)).author == "bob"
