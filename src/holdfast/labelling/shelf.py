"""The recordings that are to be labelled: read when they are asked for, a few at a time."""

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np

from holdfast.errors import RecordingError
from holdfast.features import Tare
from holdfast.features.tare import TareArgument
from holdfast.io import load_recording
from holdfast.labelling.changes import change_points
from holdfast.labelling.fitting import fitted
from holdfast.labelling.poses import Poses, poses_of
from holdfast.labelling.rules import propose
from holdfast.labelling.signals import Signals
from holdfast.labelling.store import Labels, Stored, read_stored, save_stored
from holdfast.labelling.summary import Summary, summary_of
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import sensor

if TYPE_CHECKING:
    from holdfast.labelling.audit import Suspect

IN_MEMORY = 3
"""So many recordings are kept in memory: the one that is looked at, and its neighbours."""

NO_PARAMETERS = ("tracking", "rule")
"""What a page may not ask of a rule: files are named where the service is started."""

Proposals = dict[str, tuple[Label, ...]]


@dataclass(eq=False)
class Work:
    """A recording in memory, and what is computed of it once.

    Attributes:
        path: of its file.
        recording: with the labels inside.
        tare: how the baseline is found.
    """

    path: Path
    recording: Recording
    tare: TareArgument | Tare

    @cached_property
    def signals(self) -> Signals:
        """What is drawn of it."""
        return Signals(self.recording, self.tare)

    @cached_property
    def changes(self) -> Mapping[str, list[float]]:
        """Change points by finger [s]."""
        modules = self.recording.modules
        return {
            name: change_points(each.times, each.values[:, 1:4], modules[name].period).tolist()
            for name, each in self.signals.fingers.items()
        }


class Shelf:
    """Recordings by their place in a list; from any thread.

    Args:
        paths: of the recordings.
        author: who labels, where nobody else is named.
        clock: gives the time as ISO 8601 text.
        tare: how baselines are found.
        poses: path of a CSV file of poses, or poses, for the rule `tracking`.
        suspects: that an audit of these recordings found.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        *,
        author: str,
        clock: Callable[[], str],
        tare: TareArgument | Tare = 0.5,
        poses: str | Path | Poses | None = None,
        suspects: "Sequence[Suspect]" = (),
    ) -> None:
        self.paths = tuple(paths)
        self.author = author
        self._clock = clock
        self._tare = Tare.parse(tare)
        self._poses = poses
        self._suspects = tuple(suspects)
        self._proposals: dict[int, Proposals] = {}
        self._summaries: dict[tuple[Path, int, int], Summary] = {}
        self._works: OrderedDict[tuple[Path, int, int], Work] = OrderedDict()
        self._reading = RLock()
        self._saving = RLock()
        self._computing = RLock()  # compiled kernels that run in parallel must not meet
        self._changing = RLock()  # of its own: nobody waits for change points who zooms

    def summary(self, place: int) -> Summary:
        """What is known of a recording without reading its samples, if its header tells.

        Raises:
            RecordingError: it cannot be read.
        """
        path = self.paths[place]
        key = _key(path)
        if key not in self._summaries:
            self._summaries[key] = summary_of(path)
        return self._summaries[key]

    def work(self, place: int) -> Work:
        """A recording in memory; that which was longest not asked for leaves it.

        Raises:
            RecordingError: it cannot be read.
        """
        path = self.paths[place]
        key = _key(path)
        with self._reading:
            if key not in self._works:
                while len(self._works) >= IN_MEMORY:
                    self._works.popitem(last=False)
                self._works[key] = Work(path, load_recording(path, labels=False), self._tare)
            self._works.move_to_end(key)
            return self._works[key]

    def signals(self, place: int) -> Signals:
        """What is drawn of a recording.

        Raises:
            RecordingError: it cannot be read.
        """
        work = self.work(place)
        with self._computing:
            return work.signals

    def warm_up(self) -> None:
        """Loads what is compiled, which takes as long as reading a recording."""
        tip = sensor("uskin-4x4")
        still = Tactile(tip, np.arange(32) / tip.rate, np.zeros((32, tip.n_taxels, 3)))
        with self._computing:
            Signals(Recording("warm-up", {"finger": still}))

    def changes(self, place: int) -> dict[str, list[float]]:
        """Change points of a recording by finger [s].

        Raises:
            RecordingError: it cannot be read.
        """
        work = self.work(place)
        with self._computing:
            _ = work.signals
        with self._changing:
            return dict(work.changes)

    def stored(self, place: int) -> Stored:
        """The labels of a recording that are on the disk.

        Raises:
            RecordingError: the recording or its label file cannot be read.
        """
        work = self.work(place)
        with self._saving:
            return read_stored(work.path, work.recording)

    def save(self, place: int, labels: Labels, *, revision: str, author: str, note: str) -> Stored:
        """Saves the labels of a recording, each cut to its finger's time, at this time.

        Raises:
            HoldfastError: as `save_stored`.
            ValueError: as `save_stored`.
        """
        work = self.work(place)
        with self._saving:
            return save_stored(
                work.path, work.recording, fitted(work.recording, labels),
                revision=revision, author=author or self.author, time=self._clock(), note=note,
            )  # fmt: skip

    def propose(
        self, place: int, rule: str, parameters: Mapping[str, Any]
    ) -> tuple[str, Proposals]:
        """The rule that was asked, and what it proposes; it is kept.

        Args:
            place: of the recording.
            rule: one of `RULES`; empty for tracking where there are poses, else signal.
            parameters: of the rule, but none of `NO_PARAMETERS`.

        Raises:
            RecordingError: the recording has not what the rule rests on.
            ValueError: an unknown rule or parameter.
        """
        if refused := [name for name in NO_PARAMETERS if name in parameters]:
            raise ValueError(f"parameter {refused[0]!r} given, which a page may not give")
        work = self.work(place)
        with self._computing:
            chosen = rule or default_rule(work.recording, self._poses)
            given: dict[str, Any] = {"tare": self._tare, **parameters}
            if chosen == "tracking":
                given["tracking"] = self._poses
            self._proposals[place] = propose(chosen, work.recording, **given)
        return chosen, self._proposals[place]

    def proposals(self, place: int) -> Proposals:
        """What was proposed for a recording; nothing where no rule was asked."""
        return self._proposals.get(place, {})

    def suspects(self, name: str) -> "list[Suspect]":
        """What an audit found in the recording of that name."""
        return [suspect for suspect in self._suspects if suspect.recording == name]

    def video(self, place: int, index: int) -> Path | None:
        """Where a video of a recording is; None where there is none.

        Raises:
            RecordingError: the recording cannot be read.
        """
        work = self.work(place)
        media = work.recording.media
        return beside(work.path, media[index][0]) if index < len(media) else None


def default_rule(recording: Recording, poses: str | Path | Poses | None = None) -> str:
    """The rule with the best evidence that there is: tracking with poses, signal without."""
    if poses is not None:
        return "tracking"
    try:
        poses_of(recording)
    except RecordingError:
        return "signal"
    return "tracking"


def beside(path: Path, name: str) -> Path | None:
    """The file of that name in the folder of the recording at `path`, or below it; else None."""
    folder = path.parent.resolve()
    try:
        file = (folder / name).resolve()
        return file if file.is_relative_to(folder) and file.is_file() else None
    except (OSError, ValueError):  # a name that no file can have
        return None


def _key(path: Path) -> tuple[Path, int, int]:
    """A file as it is now.

    Raises:
        RecordingError: there is none.
    """
    try:
        state = path.stat()
    except OSError as cause:
        raise RecordingError(f"cannot read {path}: {cause.strerror}") from cause
    return path, state.st_mtime_ns, state.st_size
