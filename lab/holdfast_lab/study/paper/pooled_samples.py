"""The labelled samples of one finger, pooled over all recordings of a corpus.

Each sample belongs to one of 25 parts, which is drawn at random from its recording and position.
The part does not depend on finger, window and features.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.detection import FEATURE_NAMES, Tare, haar_features
from holdfast.resampling import at_rate
from holdfast.sensors.types import Integers
from holdfast.training.classifiers import Samples
from holdfast.training.classifiers.folds import random_folds
from holdfast.training.finger_samples import concatenate, labelled_samples, usable_rows
from holdfast_lab.study.methods import FingerSignal, hand_signal
from holdfast_lab.study.methods.wavelets import detail_energy
from holdfast_lab.study.plan import Corpus

N_POOLED_PARTS = 25

ENERGY_NAME = "energy"
"""Zhang's feature: the energy of the Haar details of F_x."""
COLUMNS = (*FEATURE_NAMES, ENERGY_NAME)


@dataclass(frozen=True, eq=False)
class SamplePool:
    """The labelled samples of one finger of all recordings.

    Attributes:
        samples: with all features of `COLUMNS`; the groups are the recordings.
        parts: (n,) random part of each sample, 0 to 24.
        objects: of each recording; None if it is not known.
    """

    samples: Samples
    parts: Integers
    objects: tuple[str | None, ...]

    def select(self, names: Sequence[str]) -> Samples:
        """Return the samples with some of the features."""
        columns = [COLUMNS.index(name) for name in names]
        return self.samples._replace(features=self.samples.features[:, columns])


def pool_samples(
    corpus: Corpus,
    rate: float,
    finger: str,
    window: int,
    seed: int,
) -> SamplePool:
    """Return the labelled samples of a finger in a corpus.

    Args:
        corpus: of recordings; the last four are kept in memory.
        rate: to which recordings with another rate are resampled [Hz].
        finger: name of the finger.
        window: N_w [samples].
        seed: of the parts.
    """
    # An empty part first, for a corpus in which no recording has the finger.
    samples = [Samples(np.empty((0, len(COLUMNS))), np.empty(0, bool), np.empty(0, np.int64))]
    parts = [np.empty(0, dtype=np.int64)]
    forces = _corpus_forces(corpus, rate)
    for number, recording in enumerate(forces):
        if finger not in recording.fingers:
            continue
        signal, states = recording.fingers[finger]
        features = np.full((len(signal.times), len(COLUMNS)), np.nan)
        normal = signal.normal_magnitude
        for stretch in signal.stretches:
            features[stretch, :-1] = haar_features(signal.force[stretch], window)
            features[stretch, -1] = detail_energy(normal[stretch], window)
        rows = usable_rows(features, states)
        samples.append(labelled_samples(features, states, rows, number))
        # All samples are dealt, used or not, so that a part is the same for every window.
        drawn = random_folds(len(states), N_POOLED_PARTS, np.random.default_rng([seed, number]))
        parts.append(drawn[rows])
    objects = tuple(recording.object for recording in forces)
    return SamplePool(concatenate(samples), np.concatenate(parts), objects)


class _RecordingForces(NamedTuple):
    """Forces and label codes of the labelled fingers of a recording, without its readings."""

    fingers: dict[str, tuple[FingerSignal, npt.NDArray[np.int8]]]
    object: str | None


@lru_cache(maxsize=4)
def _corpus_forces(corpus: Corpus, rate: float) -> tuple[_RecordingForces, ...]:
    """Return the forces of all recordings; a worker reads a corpus once for all its tasks."""
    forces = []
    for original in corpus.load():
        recording = at_rate(original, rate)
        hand = hand_signal(recording, Tare.parse(corpus.tare))
        fingers = {}
        for name, signal in hand.fingers.items():
            # Without its readings, which are most of the memory: the features need forces alone.
            no_taxels = np.empty((len(signal.times), 0, 3))
            bare = replace(signal, with_baseline=no_taxels, baseline=np.empty((0, 3)))
            fingers[name] = bare, recording.modules[name].label_states
        held_object = recording.metadata.get("object")
        name_of_object = None if held_object is None else str(held_object)
        forces.append(_RecordingForces(fingers, name_of_object))
    return tuple(forces)
