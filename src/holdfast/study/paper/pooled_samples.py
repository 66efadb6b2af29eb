"""The labelled samples of one finger, of all recordings of a corpus together.

A sample's part, one of 25, is drawn by its recording and place, whatever the finger, window and
features.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Samples
from holdfast.features import FEATURE_NAMES, Tare, haar_features
from holdfast.sensors.types import Array
from holdfast.study.methods import FingerSignal, hand_signal
from holdfast.study.methods.wavelets import detail_energy
from holdfast.study.plan import Corpus
from holdfast.training.design import at_rate, concatenate, labelled_samples, usable_rows

N_PARTS = 25

ENERGY = "energy"
"""Zhang's feature: the energy of the Haar details of F_x."""
COLUMNS = (*FEATURE_NAMES, ENERGY)

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Pool:
    """The labelled samples of one finger, of all recordings together.

    Attributes:
        samples: with all `COLUMNS`; groups are the recordings.
        parts: (n,) from 0 to 24, at random.
        objects: of each recording; None where it does not say.
    """

    samples: Samples
    parts: Integers
    objects: tuple[str | None, ...]

    def only(self, names: Sequence[str]) -> Samples:
        """The samples with some of the features."""
        columns = [COLUMNS.index(name) for name in names]
        return self.samples._replace(features=self.samples.features[:, columns])


def pooled(corpus: Corpus, rate: float, finger: str, window: int, seed: int) -> Pool:
    """The labelled samples of a finger in a corpus.

    Args:
        corpus: that is read, or was lately.
        rate: that recordings are brought to where theirs is another [Hz].
        finger: whose.
        window: N_w.
        seed: of the parts.
    """
    samples = [Samples(np.empty((0, len(COLUMNS))), np.empty(0, bool), np.empty(0, np.int64))]
    parts = [np.empty(0, dtype=np.int64)]
    hands = _hands(corpus, rate)
    for place, hand in enumerate(hands):
        if finger not in hand.fingers:
            continue
        signal, states = hand.fingers[finger]
        features = _columns(signal, window)
        rows = usable_rows(features, states)
        samples.append(labelled_samples(features, states, rows, place))
        drawn = np.random.default_rng([seed, place]).integers(N_PARTS, size=len(states))
        parts.append(drawn[rows])
    objects = tuple(hand.object for hand in hands)
    return Pool(concatenate(samples), np.concatenate(parts), objects)


class _Hand(NamedTuple):
    """Forces and label codes of the labelled fingers of a recording, without its readings."""

    fingers: dict[str, tuple[FingerSignal, npt.NDArray[np.int8]]]
    object: str | None


@lru_cache(maxsize=4)
def _hands(corpus: Corpus, rate: float) -> tuple[_Hand, ...]:
    """Each recording of a corpus is read once for all tasks that a worker does."""
    return tuple(_hand_of(corpus, rate))


def _hand_of(corpus: Corpus, rate: float) -> Iterator[_Hand]:
    for given in corpus.load():
        recording = at_rate(given, rate)
        hand = hand_signal(recording, Tare.parse(corpus.tare))
        fingers = {
            name: (_without_readings(signal), recording.modules[name].label_states)
            for name, signal in hand.fingers.items()
        }
        thing = recording.metadata.get("object")
        yield _Hand(fingers, None if thing is None else str(thing))


def _without_readings(signal: FingerSignal) -> FingerSignal:
    nothing = np.empty((len(signal.times), 0, 3))
    return FingerSignal(signal.sensor, signal.times, nothing, signal.force, signal.rate)


def _columns(signal: FingerSignal, window: int) -> Array:
    """(n, 7) all `COLUMNS`; NaN without a full window."""
    table = np.full((len(signal.times), len(COLUMNS)), np.nan)
    normal = signal.normal_magnitude
    for rows in signal.stretches:
        table[rows, :-1] = haar_features(signal.force[rows], window)
        table[rows, -1] = detail_energy(normal[rows], window)
    return table
