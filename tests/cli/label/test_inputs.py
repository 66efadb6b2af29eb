from pathlib import Path

from holdfast.cli.label.inputs import RuleOptions

from .helpers import refusal


def test_a_folder_without_a_recording(capsys, tmp_path):
    assert refusal(capsys, tmp_path).startswith(f"no recording in {tmp_path} (0 other entries)")
    (tmp_path / "a.txt").write_text("a")
    line = refusal(capsys, tmp_path / "a.txt")
    assert line.startswith(f"{tmp_path}/a.txt is not a recording: .parquet or .mcap expected")


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
