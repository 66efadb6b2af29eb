"""A folder of labelled recordings as a value: by name and digest, small enough to send about."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np

from holdfast.contact import STABLE, UNKNOWN
from holdfast.errors import RecordingError, TrainingError
from holdfast.features import Tare
from holdfast.io import Dataset, load_dataset
from holdfast.recordings import Recording
from holdfast.training.survey import survey


class Corpus(msgspec.Struct, frozen=True):
    """A folder of labelled recordings; workers get this, and read the files themselves.

    Attributes:
        name: what the study calls it: "main", "fresh", "others", ...
        folder: where the recordings are.
        recordings: their names, sorted.
        digest: over their samples, labels, metadata and truth.
        fingers: that have labels of both classes, in the order of the device.
        rate: the median over the recordings [Hz].
        tare: how the baseline is found, as `--tare` takes it.
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

    def load(self) -> Dataset:
        """The recordings, each read when it is asked for.

        Raises:
            RecordingError: the folder, or a recording of the corpus, is not there.
        """
        if not Path(self.folder).is_dir():
            raise RecordingError(
                f"there is no folder {self.folder} here with the recordings of {self.name!r}: "
                "every worker has to find them at the same path"
            )
        paths = {path.stem: path for path in load_dataset(self.folder).paths}
        if gone := [name for name in self.recordings if name not in paths]:
            raise RecordingError(
                f"{len(gone)} of the {len(self.recordings)} recordings of {self.name!r} are not "
                f"in {self.folder} (any more): {gone[0]}"
            )
        return Dataset([paths[name] for name in self.recordings])


class StudyPlan(msgspec.Struct, frozen=True):
    """All that the tasks of a study follow from.

    Attributes:
        corpora: by role: "main" always; "fresh" (the same objects, other seeds), "others"
            (other objects), "gentle" and "vigorous" (other profiles) where there are.
        real: recordings of a real hand; None where there are none.
        quick: fewer windows, methods and trials.
        seed: of everything random.
    """

    corpora: dict[str, Corpus]
    real: Corpus | None = None
    quick: bool = False
    seed: int = 0

    @property
    def main(self) -> Corpus:
        """What is trained on."""
        return self.corpora["main"]


def scan_corpus(name: str, folder: str | Path, tare: str = "0.5") -> Corpus:
    """The corpus of a folder, after one pass over its recordings.

    Args:
        name: what the study calls it.
        folder: of recordings.
        tare: how the baseline is found.

    Raises:
        RecordingError: no recording there, or one that cannot be read.
        TrainingError: no labels, labels of one class, or fewer than two labelled recordings:
            nothing could be told from that.
        ValueError: an unknown tare.
    """
    dataset = load_dataset(folder)
    digest = hashlib.blake2b(digest_size=16)
    n_labelled: dict[str, Counter[bool]] = {}
    n_samples: list[int] = []

    def looked_at() -> Iterator[Recording]:
        for recording in dataset:
            n_samples.extend(len(module.times) for module in recording.modules.values())
            digest.update(content_digest(recording))
            _count(recording, n_labelled)
            yield recording

    found = survey(looked_at())
    labelled = [entry.name for entry in found.entries if entry.n_labelled]
    if len(labelled) < 2:
        raise TrainingError(
            f"{folder}: one recording with labels given ({labelled[0]}); at least two are "
            "needed, for what trains must not test"
        )
    return Corpus(
        name=name,
        folder=str(Path(folder).resolve()),
        recordings=dataset.names,
        digest=digest.hexdigest(),
        fingers=_judgeable(n_labelled, folder),
        rate=found.rate,
        tare=str(Tare.parse(tare)),
        n_samples=sum(n_samples),
    )


def content_digest(recording: Recording) -> bytes:
    """A hash of all that a study looks at: samples, labels, metadata, truth."""
    labels = [(finger, module.labels) for finger, module in recording.modules.items()]
    metadata = sorted(recording.metadata.items())
    state = hashlib.blake2b(repr((recording.name, recording.digest, labels, metadata)).encode())
    if truth := recording.truth:
        arrays = [("times", truth.times), *truth.hand.items()]
        arrays += [(f"{finger} {name}", array) for finger, each in truth.fingers.items()
                   for name, array in each.items()]  # fmt: skip
        for key, array in arrays:
            state.update(f"{key} {array.dtype} {array.shape}".encode())
            state.update(np.ascontiguousarray(array).tobytes())
    return state.digest()


def _count(recording: Recording, n_labelled: dict[str, Counter[bool]]) -> None:
    """Adds the labelled samples of every finger, stable and not."""
    for finger, module in recording.modules.items():
        if module.labels:
            states = module.label_states
            known = states[states != UNKNOWN]
            n_labelled.setdefault(finger, Counter()).update((known == STABLE).tolist())


def _judgeable(n_labelled: dict[str, Counter[bool]], folder: str | Path) -> tuple[str, ...]:
    """The fingers that have both classes.

    Raises:
        TrainingError: none has.
    """
    fingers = tuple(f for f, counts in n_labelled.items() if counts[True] and counts[False])
    if not fingers:
        stable, other = (sum(n[kind] for n in n_labelled.values()) for kind in (True, False))
        raise TrainingError(
            f"{folder}: {stable} samples labelled stable and {other} labelled not stable given; "
            "a finger with both is needed"
        )
    return fingers
