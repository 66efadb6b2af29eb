"""Workspace of the labelling page: recordings that are read on demand, and their labels."""

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import Any

from holdfast.detection import Tare
from holdfast.detection.plan import TareArgument
from holdfast.errors import RecordingError
from holdfast.io import load_recording
from holdfast.io.file_formats import SUFFIXES, format_module
from holdfast.io.safe_reading import recording_errors
from holdfast.labelling.rules import propose
from holdfast.labelling.rules.forces import fitting_tare
from holdfast.labelling.rules.poses import Poses, poses_of
from holdfast.labelling.server.signals import FingerSignals, Signals, change_points
from holdfast.labelling.server.store import (
    ModuleLabels,
    StoredLabels,
    cut_to_samples,
    read_stored,
    save_stored,
)
from holdfast.recordings import Label, Recording

MAX_RECORDINGS_IN_MEMORY = 3
"""Recordings that are kept in memory: the one on the page and its neighbours."""

REFUSED_PARAMETERS = ("tracking", "rule")
"""Parameters of a rule that a page may not set: files are named only at the start of the server."""

Proposals = dict[str, tuple[Label, ...]]


@dataclass(frozen=True)
class RecordingSummary:
    """A recording as far as its header describes it.

    Attributes:
        name: of the recording.
        duration: approximate [s].
        fingers: names of the modules.
        digest: hash of the samples.
        n_inside: number of labels in the recording file itself.
    """

    name: str
    duration: float
    fingers: tuple[str, ...]
    digest: str
    n_inside: int


@dataclass(eq=False)
class OpenRecording:
    """A recording in memory, with results that are computed once.

    Attributes:
        path: of the file.
        recording: with the labels of the file itself, not of the label file.
        tare: how the baseline is found.
    """

    path: Path
    recording: Recording
    tare: Tare

    @cached_property
    def signals(self) -> Signals:
        """The signals that the page plots."""
        modules = self.recording.modules.items()
        fingers = {name: FingerSignals(module, self.tare) for name, module in modules}
        return Signals(self.recording.start, self.recording.end, fingers)

    @cached_property
    def changes(self) -> Mapping[str, list[float]]:
        """Change points by finger [s]."""
        modules = self.recording.modules
        return {
            name: change_points(finger.times, finger.values[:, 1:4], modules[name].period).tolist()
            for name, finger in self.signals.fingers.items()
        }


class Workspace:
    """Recordings to be labelled, by their index in a list. Methods may be called by any thread.

    Args:
        paths: of the recordings.
        author: default author of labels.
        clock: returns the current time as ISO 8601 text.
        tare: how baselines are found; by default as `fitting_tare` chooses for each recording.
        poses: path of a CSV file of poses, or poses, for the rule `tracking`.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        *,
        author: str,
        clock: Callable[[], str],
        tare: TareArgument | Tare | None = None,
        poses: str | Path | Poses | None = None,
    ) -> None:
        self.paths = tuple(paths)
        self.author = author
        self._clock = clock
        self._tare = None if tare is None else Tare.parse(tare)
        self._poses = poses
        # The latest proposals by index, which `propose` replaces; summaries and open recordings by
        # version of the file, so that a file that changes is read again.
        self._proposals: dict[int, Proposals] = {}
        self._summaries: dict[tuple[Path, int, int], RecordingSummary] = {}
        self._open: OrderedDict[tuple[Path, int, int], OpenRecording] = OrderedDict()
        self._read_lock = RLock()  # of `_open`: a recording is in memory once
        self._save_lock = RLock()  # a revision is not read while it is being written
        self._compute_lock = RLock()  # two requests do not compute the signals of one recording
        self._changes_lock = RLock()  # separate: zooming does not wait for change points

    def summary(self, index: int) -> RecordingSummary:
        """Return the summary of a recording, from its header where the header is complete.

        Raises:
            RecordingError: the recording cannot be read.
        """
        path = self.paths[index]
        key = _file_version(path)
        if key not in self._summaries:
            self._summaries[key] = summary_of(path)
        return self._summaries[key]

    def open(self, index: int) -> OpenRecording:
        """Return a recording in memory. The least recently used one is dropped to make room.

        Raises:
            RecordingError: the recording cannot be read.
        """
        path = self.paths[index]
        key = _file_version(path)
        with self._read_lock:
            if key not in self._open:
                while len(self._open) >= MAX_RECORDINGS_IN_MEMORY:
                    self._open.popitem(last=False)
                recording = load_recording(path, labels=False)
                with self._compute_lock:
                    tare = fitting_tare(recording, self._tare)
                self._open[key] = OpenRecording(path, recording, tare)
            self._open.move_to_end(key)
            return self._open[key]

    def signals(self, index: int) -> Signals:
        """Return the signals that the page plots of a recording.

        Raises:
            RecordingError: the recording cannot be read.
        """
        opened = self.open(index)
        with self._compute_lock:
            return opened.signals

    def changes(self, index: int) -> dict[str, list[float]]:
        """Return the change points of a recording by finger [s].

        Raises:
            RecordingError: the recording cannot be read.
        """
        opened = self.open(index)
        with self._compute_lock:
            _ = opened.signals
        with self._changes_lock:
            return dict(opened.changes)

    def stored(self, index: int) -> StoredLabels:
        """Read the labels of a recording from the disk.

        Raises:
            RecordingError: the recording or its label file cannot be read.
        """
        opened = self.open(index)
        with self._save_lock:
            return read_stored(opened.path, opened.recording)

    def save(
        self, index: int, labels: ModuleLabels, *, revision: str, author: str, note: str
    ) -> StoredLabels:
        """Save the labels of a recording with the current time, each cut to its finger's samples.

        Raises:
            HoldfastError: see `save_stored`.
            ValueError: see `save_stored`.
        """
        opened = self.open(index)
        with self._save_lock:
            return save_stored(
                opened.path, opened.recording, cut_to_samples(opened.recording, labels),
                revision=revision, author=author or self.author, time=self._clock(), note=note,
            )  # fmt: skip

    def propose(
        self, index: int, rule: str, parameters: Mapping[str, Any]
    ) -> tuple[str, Proposals]:
        """Apply a rule to a recording, and keep its proposals.

        Args:
            index: of the recording.
            rule: one of `RULES`; if empty, `tracking` where there are poses, else `signal`.
            parameters: of the rule, without `REFUSED_PARAMETERS`.

        Returns:
            The name of the rule, and its labels by finger.

        Raises:
            RecordingError: the recording lacks what the rule needs.
            ValueError: the rule or a parameter is unknown or refused.
        """
        if refused := [name for name in REFUSED_PARAMETERS if name in parameters]:
            raise ValueError(f"parameter {refused[0]!r} given; a page may not set it")
        opened = self.open(index)
        with self._compute_lock:
            chosen = rule or default_rule(opened.recording, self._poses)
            arguments: dict[str, Any] = {"tare": opened.tare, **parameters}
            if chosen == "tracking":
                arguments["tracking"] = self._poses
            self._proposals[index] = propose(chosen, opened.recording, **arguments)
        return chosen, self._proposals[index]

    def proposals(self, index: int) -> Proposals:
        """Return the latest proposals for a recording; empty before any rule was applied."""
        return self._proposals.get(index, {})

    def video(self, index: int, video_index: int) -> Path | None:
        """Return the path of a video of a recording; None if there is none.

        Raises:
            RecordingError: the recording cannot be read.
        """
        opened = self.open(index)
        media = opened.recording.media
        return beside(opened.path, media[video_index][0]) if video_index < len(media) else None


def default_rule(recording: Recording, poses: str | Path | Poses | None = None) -> str:
    """Return `tracking` for a recording with poses, else `signal`."""
    if poses is not None:
        return "tracking"
    try:
        poses_of(recording)
    except RecordingError:
        return "signal"
    return "tracking"


def beside(path: Path, name: str) -> Path | None:
    """Return the file `name` in the folder of `path` or below it; None if there is none."""
    folder = path.parent.resolve()
    try:
        file = (folder / name).resolve()
        return file if file.is_relative_to(folder) and file.is_file() else None
    except (OSError, ValueError):  # not a valid file name
        return None


def summary_of(path: Path) -> RecordingSummary:
    """Read the summary of a recording: its header, or all of it if the header is incomplete.

    Raises:
        RecordingError: the recording cannot be read.
    """
    header, complete = None, False
    if path.suffix in SUFFIXES:
        with recording_errors(path):
            header, groups, complete = format_module(path.suffix).read_groups(path)
            getattr(groups, "close", lambda: None)()
    if header is None or not (complete and header.digest):
        # No header, or one of a recording that was cut off: only the samples say how long it is.
        recording = load_recording(path, labels=False)
        modules = recording.modules
        n_inside = sum(len(module.labels) for module in modules.values())
        return RecordingSummary(
            recording.name, recording.duration, tuple(modules), recording.digest, n_inside
        )
    durations = [
        max((module.n_samples or 0) - 1, 0) / float(module.sensor["rate"])
        for module in header.modules.values()
    ]
    return RecordingSummary(
        header.name if path.stem == header.file else path.stem,  # a renamed file is another
        max(durations, default=0.0),
        tuple(header.modules),
        header.digest,
        sum(len(module.labels) for module in header.modules.values()),
    )


def _file_version(path: Path) -> tuple[Path, int, int]:
    """Return the path, modification time and size of a file.

    Raises:
        RecordingError: the file does not exist.
    """
    try:
        state = path.stat()
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    return path, state.st_mtime_ns, state.st_size
