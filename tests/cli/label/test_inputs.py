from pathlib import Path

import pytest

from holdfast.cli.label.inputs import RuleOptions

from .helpers import refusal, run_json


def test_poses_of_a_bag(monkeypatch):
    given = []
    monkeypatch.setattr(
        "holdfast.labelling.rules.poses.poses_from_bag",
        lambda *words: given.append(words) or "poses",
    )
    options = RuleOptions(
        "0.5",
        Path("run.bag"),
        tracks=["object = /aruco/pose", "thumb=tip"],
        parameters=["speed=0.01"],
    )
    assert options.arguments("tracking") == {"tare": "0.5", "speed": 0.01, "tracking": "poses"}
    assert given == [(Path("run.bag"), "/aruco/pose", {"thumb": "tip"})]


@pytest.mark.parametrize("name", ["audit", "compare"])
def test_a_folder_may_have_the_name_of_a_command_that_was_removed(
    capsys, tmp_path, monkeypatch, name
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert refusal(capsys, name).startswith(f"no recording in {name} ")


def test_a_sheet_of_markers(capsys, tmp_path):
    pytest.importorskip("cv2")
    sheet = tmp_path / "sheet.pdf"
    assert run_json(capsys, "markers", sheet) == {"sheet": str(sheet)}
    assert sheet.read_bytes().startswith(b"%PDF-1.4")
