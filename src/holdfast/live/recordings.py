"""Recordings of a session, one at a time, begun and ended by whoever watches."""

import re
import time
from pathlib import Path
from threading import Lock

from holdfast.errors import OutputError
from holdfast.live.recorder import Recorder
from holdfast.live.session import Session
from holdfast.live.stream_detector import StreamUpdate

_NAME = re.compile(r"\w[\w .-]{0,99}", re.ASCII)


class SessionRecorder:
    """Begins, marks and ends recordings of a session; from any thread.

    Args:
        session: that is recorded.
        folder: where the files go; None where none are wanted.
    """

    def __init__(self, session: Session, folder: Path | None) -> None:
        self._session = session
        self._folder = folder
        self._lock = Lock()
        self.current: Recorder | None = None

    @property
    def possible(self) -> bool:
        """Whether there is a folder for them."""
        return self._folder is not None

    def begin(self, name: str = "") -> Path:
        """Begins a recording; where it goes.

        Args:
            name: of the file, without a suffix; the date and time by default.

        Raises:
            OutputError: one is being made, there is one of that name, no file can be called
                so, or the disk refuses.
        """
        with self._lock:
            recorder = self._recorder(name or time.strftime("%Y%m%d-%H%M%S"))
            self.current = recorder
            self._session.add_listener(self._put)
            return recorder.path

    def mark(self, text: str) -> None:
        """Sets a marker.

        Raises:
            OutputError: nothing is being recorded.
        """
        self._running("start a recording, then mark it").mark(text)

    def end(self) -> Recorder:
        """Ends the recording, and gives what made it.

        Raises:
            OutputError: nothing is being recorded, the disk refuses, or no sample came (then
                there is no file).
        """
        with self._lock:
            recorder = self._running("there is nothing to stop")
            self.current = None
            self._session.remove_listener(self._put)
            recorder.close()
            if not recorder.status.n_samples:
                recorder.path.unlink(missing_ok=True)
                raise OutputError(f"no sample came: {recorder.path} is not kept")
            return recorder

    def _running(self, hint: str) -> Recorder:
        if self.current is None:
            raise OutputError(f"nothing is being recorded: {hint}")
        return self.current

    def _put(self, said: StreamUpdate) -> None:
        recorder = self.current
        if recorder is not None and said.arrival is not None:
            recorder.put(said.arrival)

    def _recorder(self, name: str) -> Recorder:
        if self._folder is None:
            raise OutputError("no folder for recordings: start with --record-to FOLDER")
        if self.current is not None:
            raise OutputError(f"{self.current.path} is being recorded already")
        if not _NAME.fullmatch(name):
            raise OutputError(f"a name of letters, digits, _, - and . expected, {name!r} given")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as cause:
            raise OutputError(f"cannot write to {self._folder}: {cause.strerror}") from cause
        source = self._session.source
        path = self._folder / f"{name}.mcap"
        return Recorder(path, source.sensors, metadata=dict(source.metadata))
