"""The recordings that a study uses, as small values that can be sent to workers."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import overload

import msgspec
import numpy as np

from holdfast.contact import STABLE, UNKNOWN
from holdfast.detection import Tare
from holdfast.errors import RecordingError, TrainingError
from holdfast.io import Dataset, load_dataset
from holdfast.metrics.truth_labels import fingers_with_truth
from holdfast.recordings import Recording
from holdfast.training.dataset_scan import scan_dataset
from holdfast_lab.study.kept import WORKER_MEMORY, recording_bytes


class Corpus(msgspec.Struct, frozen=True):
    """Description of a folder of labelled recordings, whose files workers read themselves.

    Attributes:
        name: of the corpus in the study: "main", "fresh", "others", ...
        folder: of the recordings.
        recordings: their names, sorted.
        digest: of their samples, labels, metadata and ground truth.
        fingers: with labels of both classes, in the order of the device.
        rate: median over the recordings [Hz].
        tare: how the baseline is found, as an argument of `--tare`.
        n_samples: of all fingers and pads together.
    """

    name: str
    folder: str
    recordings: tuple[str, ...]
    digest: str
    fingers: tuple[str, ...]
    rate: float
    tare: str = "0.5"
    n_samples: int = 0

    def load(self) -> "CorpusRecordings":
        """Return the recordings; each is read when it is first used by this process.

        Raises:
            RecordingError: the folder, or a recording of the corpus, does not exist.
        """
        if not Path(self.folder).is_dir():
            raise RecordingError(
                f"the folder {self.folder} with the recordings of {self.name!r} does not exist "
                "here: every worker needs it at the same path"
            )
        # Recordings that were added to the folder later are left out.
        paths = {path.stem: path for path in load_dataset(self.folder).paths}
        if gone := [name for name in self.recordings if name not in paths]:
            raise RecordingError(
                f"{len(gone)} of the {len(self.recordings)} recordings of {self.name!r} are no "
                f"longer in {self.folder}: {gone[0]}"
            )
        return CorpusRecordings(self, Dataset([paths[name] for name in self.recordings]))

    @property
    def identity(self) -> tuple[str, str]:
        """Folder and digest that identify the corpus and its version."""
        return self.folder, self.digest

    @property
    def is_simulated(self) -> bool:
        """Whether the twin made the recordings."""
        return self.load()[0].metadata.get("source") == "twin"

    @property
    def has_truth(self) -> bool:
        """Whether exact labels can be made for all fingers of the first recording."""
        first = self.load()[0]
        return len(fingers_with_truth(first)) == len(first.modules)


@dataclass(frozen=True)
class CorpusRecordings(Sequence[Recording]):
    """The recordings of a corpus, in order; see `kept`."""

    corpus: Corpus
    files: Dataset

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the recordings, in order."""
        return self.files.names

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, index: int) -> Recording: ...
    @overload
    def __getitem__(self, index: slice) -> "CorpusRecordings": ...
    def __getitem__(self, index: int | slice) -> "Recording | CorpusRecordings":
        if isinstance(index, slice):
            return CorpusRecordings(self.corpus, self.files[index])
        # With the digest: a folder that was made anew is read anew.
        key = (*self.corpus.identity, self.files.paths[index])
        return WORKER_MEMORY.get(key, lambda: self.files[index], recording_bytes)


class StudyPlan(msgspec.Struct, frozen=True):
    """Everything that determines the tasks of a study.

    Attributes:
        corpora: by role: "main" always, and of the following those that exist: "fresh" (the same
            objects, other seeds), "others" (other objects), "gentle" and "vigorous" (other
            profiles), "glitch-0" and "glitch-1" (other objects, with so many glitches of the hand's
            controller a minute), "aged" (other objects, skins aged by four months), "impacts"
            (other objects, the hand and its object are knocked), "slips" (other objects, slips that
            no push causes), and "taught" (what a user would record to teach a hand).
        real: recordings of a real hand; None if there are none.
        quick: fewer windows, methods and trials.
        full: with slips of fingers and the models that ship.
        seed: of all random numbers.
    """

    corpora: dict[str, Corpus]
    real: Corpus | None = None
    quick: bool = False
    seed: int = 0
    full: bool = False

    @property
    def main(self) -> Corpus:
        """The corpus that methods are trained on."""
        return self.corpora["main"]


def scan_corpus(name: str, folder: str | Path, tare: str = "0.5") -> Corpus:
    """Read the recordings of a folder once and return the corpus.

    Args:
        name: of the corpus in the study.
        folder: of recordings.
        tare: how the baseline is found.

    Raises:
        RecordingError: the folder has no recording, or one that cannot be read.
        TrainingError: there are no labels, labels of one class only, or fewer than two labelled
            recordings.
        ValueError: the tare is unknown.
    """
    dataset = load_dataset(folder)
    digest = hashlib.blake2b(digest_size=16)
    n_labelled: dict[str, Counter[bool]] = {}
    n_samples: list[int] = []

    # All that is needed of a recording is taken on its way to the scan: files are read once.
    def counted() -> Iterator[Recording]:
        for recording in dataset:
            n_samples.extend(len(module.times) for module in recording.modules.values())
            digest.update(content_digest(recording))
            for finger, module in recording.modules.items():
                if module.labels:
                    states = module.label_states[module.label_states != UNKNOWN]
                    n_labelled.setdefault(finger, Counter()).update((states == STABLE).tolist())
            yield recording

    scan = scan_dataset(counted())
    labelled = [entry.name for entry in scan.recordings if entry.n_labelled]
    if len(labelled) < 2:
        raise TrainingError(
            f"{folder}: one recording with labels given ({labelled[0]}); at least two are "
            "needed, because test recordings must not be used for training"
        )
    fingers = tuple(f for f, counts in n_labelled.items() if counts[True] and counts[False])
    if not fingers:
        stable, other = (sum(n[kind] for n in n_labelled.values()) for kind in (True, False))
        raise TrainingError(
            f"{folder}: {stable} samples labelled stable and {other} labelled not stable given; "
            "a finger with both is needed"
        )
    return Corpus(
        name=name,
        folder=str(Path(folder).resolve()),
        recordings=dataset.names,
        digest=digest.hexdigest(),
        fingers=fingers,
        rate=scan.rate,
        tare=str(Tare.parse(tare)),
        n_samples=sum(n_samples),
    )


def content_digest(recording: Recording) -> bytes:
    """Return a hash of everything that a study uses: samples, labels, metadata, ground truth."""
    labels = [(finger, module.labels) for finger, module in recording.modules.items()]
    metadata = sorted(recording.metadata.items())
    state = hashlib.blake2b(repr((recording.name, recording.digest, labels, metadata)).encode())
    if truth := recording.truth:
        arrays = [("times", truth.times), *truth.hand.items()]
        arrays += [(f"{finger} {name}", array) for finger, arrays_of_finger in truth.fingers.items()
                   for name, array in arrays_of_finger.items()]  # fmt: skip
        for key, array in arrays:
            # With type and shape: equal bytes of other arrays must not give the same digest.
            state.update(f"{key} {array.dtype} {array.shape}".encode())
            state.update(np.ascontiguousarray(array).tobytes())
    return state.digest()
