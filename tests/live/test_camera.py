"""A camera beside a recording: a video file stands for it."""

import threading
import time

import numpy as np
import pytest

from holdfast.errors import OutputError, SourceError
from holdfast.io.stickers import picture_stamps
from holdfast.live import camera as module
from holdfast.live.camera import CameraRecorder
from live.build import PATIENCE, wait_for

cv2 = pytest.importorskip("cv2")


@pytest.fixture
def film(tmp_path):
    """Six pictures, brighter one by one, a hundredth of a second apart."""
    path = tmp_path / "camera.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 100.0, (64, 48))
    for k in range(6):
        writer.write(np.full((48, 64, 3), 40 * k, np.uint8))
    writer.release()
    return path


class Session:
    """What a camera needs of a recorder: the clock, and markers."""

    def __init__(self, clock):
        self.session_time = clock
        self.markers = []
        self.add_marker = self.markers.append


def brightness(path):
    video = cv2.VideoCapture(str(path))
    values = []
    while (read := video.read())[0]:
        values.append(round(read[1].mean() / 40))
    return values


def test_pictures_are_kept_with_the_times_of_the_session(film, tmp_path):
    out, said = tmp_path / "run.mp4", []
    session = Session(iter(np.arange(1.5, 9)).__next__)
    with CameraRecorder(str(film), out) as camera:
        camera.start(session, said.append)
        wait_for(lambda: said)
    assert said == session.markers
    assert "6 pictures" in said[0]
    assert brightness(out) == [0, 1, 2, 3, 4, 5]
    assert picture_stamps(out).tolist() == [1.5, 2.5, 3.5, 4.5, 5.5, 6.5]


def test_a_video_without_pictures_is_removed(film, tmp_path):
    with CameraRecorder(str(film), tmp_path / "run.mp4") as camera:
        camera.start(Session(lambda: np.nan))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.mp4"]


def test_a_camera_that_stalls_is_reported_once(film, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "STALL_TIME", 0.02)
    go_on = threading.Event()

    def clock():
        go_on.wait(PATIENCE)
        return 1.0 + time.monotonic()

    with CameraRecorder(str(film), tmp_path / "run.mp4") as camera:
        session = Session(clock)
        camera.start(session)
        wait_for(lambda: session.markers)
        go_on.wait(0.1)  # it looks several times
        assert len(session.markers) == 1
        go_on.set()


def test_a_missing_camera_is_one_line(tmp_path, capfd):
    with pytest.raises(SourceError, match=r"none\.mp4"):
        CameraRecorder(str(tmp_path / "none.mp4"), tmp_path / "run.mp4")
    assert capfd.readouterr() == ("", "")


def test_a_video_that_cannot_be_written_and_one_that_exists(film, tmp_path):
    out = tmp_path / "run.mp4"
    out.touch()
    with pytest.raises(OutputError, match=r"run\.mp4"):
        CameraRecorder(str(film), out)
    CameraRecorder(str(film), out, force=True).close()
    with (
        CameraRecorder(str(film), tmp_path / "none" / "run.mp4") as camera,
        pytest.raises(OutputError, match=r"cannot write .*run\.mp4"),
    ):
        camera.start(Session(time.monotonic))
