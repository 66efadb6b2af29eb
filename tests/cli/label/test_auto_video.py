"""`holdfast label auto tracking` with a video; its content is that of a test."""

import re

import numpy as np
import pytest

from holdfast.io import load_labels, save_recording
from holdfast.labelling.rules import video
from labelling.rules.test_video import BAD_FILMS, SLIPS, recording, sticker_track

from .helpers import refusal, run, run_json

pytest.importorskip("cv2")


@pytest.fixture
def pulls(tmp_path, monkeypatch):
    """A recording, with a video beside it."""
    asked = []

    def read(path, fps):
        asked.append((path, fps))
        times, found = sticker_track()
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


def test_options_that_do_not_fit(capsys, pulls):
    path, _ = pulls
    words = ("--video", "a.mp4", "--track", "object=/aruco")
    assert "'/aruco'" in refusal(capsys, "auto", "tracking", path, *words)
    path.with_suffix(".mp4").unlink()
    assert "--video FILE" in refusal(capsys, "auto", "tracking", path, "--fps", 30)


@pytest.mark.parametrize("case", ["hidden", "other time"])
def test_a_film_that_shows_no_slips_is_one_line_and_labels_nothing(
    capsys, pulls, monkeypatch, case
):
    path, _ = pulls
    made, message = BAD_FILMS[case]
    times, found = made()
    monkeypatch.setattr(video, "read_stickers", lambda *_: (times, np.zeros(len(times)), found))
    assert re.search(message, refusal(capsys, "auto", "tracking", path))
    assert not path.with_name("pulls.labels.json").exists()
