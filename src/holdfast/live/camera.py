"""Video of a recording: the pictures of a camera, beside the samples and on their clock."""

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from threading import Event, Thread

from holdfast.errors import OutputError, SourceError, require_extras
from holdfast.files import refuse_overwrite
from holdfast.io.stickers import check_video, stamps_path
from holdfast.live.recorder import Recorder
from holdfast.openable import Closable

STALL_TIME = 1.0
"""Time without a picture after which a camera is reported [s]."""
UNSTATED_RATE = 30.0
"""Rate that is written to the file if the camera gives none [Hz]. The stamps are exact."""


class CameraRecorder(Closable):
    """Write the pictures of a camera to an .mp4 file, and their times beside it.

    A thread of its own reads and writes them, so no sample waits. A picture has the time of its
    arrival: exposure and transfer, some 10 to 100 ms, are a constant that `label auto` takes out.

    Args:
        camera: number of the camera, or a video file or stream that stands for one.
        path: of the video.
        force: replace an existing video.

    Attributes:
        n_pictures: pictures written so far.

    Raises:
        SourceError: there is no such camera.
        RecordingError: the file is no video.
        OutputError: the video exists already.
    """

    def __init__(self, camera: str, path: Path, *, force: bool = False) -> None:
        import cv2

        if path.exists():
            refuse_overwrite(path, force=force)
        if is_file := Path(camera).is_file():
            check_video(Path(camera))
        # OpenCV prints on stderr, which would be more than the one line of the error.
        level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        self._film = cv2.VideoCapture(int(camera) if camera.isdecimal() else camera)
        is_read, self._picture = self._film.read()
        cv2.utils.logging.setLogLevel(level)
        if not is_read:
            raise SourceError(
                f"no camera {camera}: the number of a camera (0 is the first), or a video file "
                "or stream expected"
            )
        self._rate = self._film.get(cv2.CAP_PROP_FPS) or UNSTATED_RATE
        # A file has all its pictures at once; a camera sends them one period apart.
        self._pause = 1 / self._rate if is_file else 0.0
        self.n_pictures = 0
        self._path = path
        # When the newest picture was read: `_write` sets it, `_watch` compares it with the clock.
        self._read_at = time.monotonic()
        self._closing = Event()
        self._threads: list[Thread] = []

    def start(self, recorder: Recorder, say: Callable[[str], None] = lambda _: None) -> None:
        """Write from now on.

        Args:
            recorder: of the samples: its clock counts. A camera that stalls or ends becomes a
                marker.
            say: is called with the text of the marker.

        Raises:
            OutputError: the video cannot be written.
        """
        import cv2

        height, width = self._picture.shape[:2]
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._video = cv2.VideoWriter(
            str(self._path), cv2.CAP_FFMPEG, code, self._rate, (width, height)
        )
        if not self._video.isOpened():
            raise OutputError(f"cannot write {self._path}: no such folder, or no codec for .mp4")

        def report(text: str) -> None:
            recorder.add_marker(text)
            say(text)

        clock = recorder.session_time
        self._threads = [
            Thread(target=self._write, args=(clock, report), name="holdfast-camera", daemon=True),
            Thread(target=self._watch, args=(report,), name="holdfast-camera-watch", daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the video; one without pictures is removed."""
        self._closing.set()
        for thread in self._threads:
            thread.join(STALL_TIME)
        if any(thread.is_alive() for thread in self._threads):
            return  # the driver hangs, and a thread still uses both; they end with the process
        self._film.release()
        if self._threads:
            self._video.release()
            if not self.n_pictures:
                self._path.unlink(missing_ok=True)
                stamps_path(self._path).unlink(missing_ok=True)

    def _write(self, clock: Callable[[], float], report: Callable[[str], None]) -> None:
        is_read, picture, due = True, self._picture, time.monotonic()
        with stamps_path(self._path).open("w") as stamps:
            while is_read and not self._closing.is_set():
                self._read_at, stamp = time.monotonic(), clock()
                if math.isfinite(stamp):  # NaN: there is no sample yet
                    self._video.write(picture)
                    stamps.write(f"{stamp:.6f}\n")
                    self.n_pictures += 1
                due += self._pause
                self._closing.wait(max(due - time.monotonic(), 0.0))
                is_read, picture = self._film.read()
        if not is_read:
            report(f"note: the camera ended after {self.n_pictures} pictures")

    def _watch(self, report: Callable[[str], None]) -> None:
        reported = 0.0  # `_read_at` of the stall that was reported last: each becomes one marker
        while self._threads[0].is_alive() and not self._closing.wait(STALL_TIME / 4):
            if time.monotonic() - self._read_at > STALL_TIME and self._read_at != reported:
                reported = self._read_at
                report(f"note: the camera has sent no picture for {STALL_TIME:g} s")


def camera_of(
    camera: str | None, recording: Path, *, force: bool = False
) -> AbstractContextManager[CameraRecorder | None]:
    """Return the camera whose video is written beside a recording; none if none is given."""
    if camera is None:
        return nullcontext()
    require_extras("video")
    return CameraRecorder(camera, recording.with_suffix(".mp4"), force=force)
