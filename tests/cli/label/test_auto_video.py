"""`holdfast label auto tracking` with a video; its content is that of a test."""

import numpy as np
import pytest

from holdfast.io import load_labels, save_recording
from holdfast.labelling.rules import video
from labelling.rules.test_video import SLIPS, places, recording

from .helpers import refusal, run, run_json

pytest.importorskip("cv2")


@pytest.fixture
def pulls(tmp_path, monkeypatch):
    """A recording, with a video beside it."""
    asked = []

    def read(path, fps):
        asked.append((path, fps))
        times, found = places()
        return times, np.zeros(len(times)), found

    monkeypatch.setattr(video, "read_stickers", read)
    path = tmp_path / "pulls.mcap"
    save_recording(recording(), path)
    path.with_suffix(".mp4").write_bytes(b"film")
    return path, asked


def test_the_video_beside_a_recording_is_used(capsys, pulls):
    path, asked = pulls
    (found,) = run_json(capsys, "auto", "tracking", path.parent)["recordings"]
    assert asked == [(path.with_suffix(".mp4"), None)]
    slips = [one for one in found["labels"]["index"] if one["cause"] == "slip"]
    assert [slip["start"] for slip in slips] == pytest.approx([s for s, _ in SLIPS], abs=0.02)
    assert load_labels(path.with_name("pulls.labels.json")).author == "rule:tracking"


def test_a_video_is_given(capsys, pulls):
    path, asked = pulls
    words = ("--video", "other.mp4", "--fps", 30, "--track", "object=0", "--track", "index=2")
    assert run(capsys, "auto", "tracking", path, *words, "--dry-run")[0] == 0
    assert [(str(video), fps) for video, fps in asked] == [("other.mp4", 30.0)]


REFUSED = {
    "another rule": (("signal", "--video", "a.mp4"), "--video is for the rule tracking; rule 'sig"),
    "both": (
        ("tracking", "--video", "a.mp4", "--poses", "POSES"),
        "--poses and --video given; only one of them expected",
    ),
    "a motion too": (
        ("tracking", "--video", "a.mp4", "--motion", "a.csv"),
        "--motion is for the rule tracking, without --poses and --video",
    ),
    "a column of nothing": (
        ("tracking", "--column", "a"),
        "--column is one of --motion FILE.csv, which is missing",
    ),
    "words for numbers": (
        ("tracking", "--video", "a.mp4", "--track", "object=/aruco"),
        "--track BODY=NUMBER expected with a video, '/aruco' given",
    ),
}


@pytest.mark.parametrize(("words", "message"), REFUSED.values(), ids=REFUSED)
def test_options_that_do_not_fit(capsys, pulls, words, message):
    path, _ = pulls
    poses = path.with_name("poses.csv")
    poses.write_text("time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0.1,0,0,1,0,0,0\n")
    words = [str(poses) if word == "POSES" else word for word in words]
    assert refusal(capsys, "auto", words[0], path, *words[1:]).startswith(message)


def test_a_rate_without_a_video(capsys, pulls):
    path, _ = pulls
    path.with_suffix(".mp4").unlink()
    message = refusal(capsys, "auto", "tracking", path, "--fps", 30)
    assert message == "--fps is for a video: give --video FILE"
