"""Folder of the grasps of a guided protocol: its recordings, and what came of each."""

from collections.abc import Iterable
from pathlib import Path

import msgspec

from holdfast.errors import OutputError, RecordingError
from holdfast.files import read_input, write_whole
from holdfast.io.label_files import labels_path
from holdfast.io.stickers import stamps_path
from holdfast.live.teaching.protocol import GraspResult

JOURNAL = "teach.json"
"""Name of the file with the results of all grasps."""
MAX_JOURNAL = 1 << 20
"""Largest file of results [bytes]; 999 grasps take 200 kB."""
ASIDE = "left-out"
"""Name of the folder inside, of grasps that were repeated or skipped: they teach nothing."""


class TeachingFolder:
    """Folder of a protocol. Each result is written at once, so that a break loses nothing.

    Args:
        path: of the folder; the first `save` creates it.
        resume: go on with the protocol of the folder.

    Attributes:
        path: of the folder.
        aside: folder inside, of grasps that teach nothing.
        results: of the grasps that are over, oldest first.

    Raises:
        OutputError: the folder has something else, or a protocol that is not resumed, or cannot
            be written.
        RecordingError: its results cannot be read.
    """

    def __init__(self, path: Path, *, resume: bool) -> None:
        self.path, self._journal, self.aside = path, path / JOURNAL, path / ASIDE
        self.results: list[GraspResult] = []
        if self._journal.exists():
            self.results = self._read()
            if self.results and not resume:
                raise OutputError(
                    f"{path} has {len(self.results)} grasps of a protocol: --resume goes on with "
                    "it, --to FOLDER begins another"
                )
        elif path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise OutputError(f"{path} has no {JOURNAL} and is not empty: another folder expected")
        elif resume:
            raise RecordingError(f"{path} has no {JOURNAL}: there is nothing to resume")

    @property
    def kept(self) -> list[GraspResult]:
        """Results of the grasps that teach."""
        return [result for result in self.results if result.kept]

    def new_path(self, name: str) -> Path:
        """Return the path of the next recording, of a step of that name; no file has it."""
        folders = (self.path, self.aside)
        used = [int(p.name[:3]) for f in folders for p in f.glob("[0-9][0-9][0-9]-*.mcap")]
        return self.path / f"{max(used, default=0) + 1:03d}-{name}.mcap"

    def save(self, results: Iterable[GraspResult]) -> None:
        """Write the results, and move recordings aside that are not kept."""
        self.results = list(results)
        for result in self.results:
            if result.recording and not result.kept:
                self.leave_out(self.path / f"{result.recording}.mcap")
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as cause:
            raise OutputError(f"cannot write to {self.path}: {cause.strerror}") from cause
        write_whole(self._journal, msgspec.json.encode(self.results), force=True)

    def leave_out(self, path: Path) -> None:
        """Move a recording, its labels and its video aside."""
        video = path.with_suffix(".mp4")
        try:
            for file in filter(Path.exists, (path, video, stamps_path(video), labels_path(path))):
                self.aside.mkdir(exist_ok=True)
                file.replace(self.aside / file.name)
        except OSError as cause:
            raise OutputError(f"cannot move {path} to {self.aside}: {cause.strerror}") from cause

    def _read(self) -> list[GraspResult]:
        try:
            return msgspec.json.decode(
                read_input(self._journal, MAX_JOURNAL, follow=False), type=list[GraspResult]
            )
        except (OSError, ValueError) as cause:
            why = cause.strerror if isinstance(cause, OSError) else cause
            raise RecordingError(f"{self._journal} has no results of a protocol: {why}") from cause
