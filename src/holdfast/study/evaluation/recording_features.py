"""Recordings of a corpus as a method sees them: features of all, readings of none."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.features import Tare
from holdfast.metrics import FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.recordings import Recording, Truth, label_states
from holdfast.sensors.types import Array
from holdfast.study.evaluation.variation import Variation, relabelled
from holdfast.study.methods import HAND, Method, hand_signal
from holdfast.study.plan import Corpus
from holdfast.training.design import rest_moments


@dataclass(frozen=True, eq=False)
class RecordingFeatures:
    """One recording as a method sees it.

    Attributes:
        name: of the recording.
        object: that was held; None where the recording does not say.
        truth: of the recording.
        times: of each finger [s].
        amplitude: F_a of each finger; NaN where there is no force [unit of the readings].
        labels: codes of each finger.
        exact: codes of each finger by labels without margin, where the truth is known.
        at_rest: of each finger, the moments of F_a in the tare stretch.
        features: of each unit: of the fingers, or of `HAND` at the times of the first finger.
    """

    name: str
    object: str | None
    truth: Truth | None
    times: Mapping[str, Array]
    amplitude: Mapping[str, Array]
    labels: Mapping[str, Codes]
    exact: Mapping[str, Codes]
    at_rest: Mapping[str, tuple[int, float, float]]
    features: Mapping[str, npt.NDArray[Any]]

    def undecided(self, labels: Mapping[str, Codes]) -> dict[str, FingerDecisions]:
        """The fingers with those labels, and nothing decided."""
        return {
            name: FingerDecisions(
                times,
                labels[name],
                np.zeros(len(times), dtype=np.int8),
                np.full(len(times), np.nan),
            )
            for name, times in self.times.items()
        }

    def hand(self, labels: Mapping[str, Codes]) -> FingerDecisions:
        """The hand with the label that follows from those of its fingers, and nothing decided."""
        return hand_decisions(self.undecided(labels), len(labels))

    def unit_labels(self, unit: str) -> Codes:
        """The labels that a unit learns from; those of the hand at its first finger's times."""
        if unit != HAND:
            return self.labels[unit]
        hand = self.hand(self.labels)
        return hand.labels[np.searchsorted(hand.times, next(iter(self.times.values())))]


def corpus_features(
    method: Method, corpus: Corpus, change: Variation, stride: int = 1
) -> list[RecordingFeatures]:
    """The recordings of a corpus that have its fingers, as a method sees them.

    Args:
        method: whose features.
        corpus: of recordings.
        change: of each of them.
        stride: only every so many-th decision is looked at; features see all samples.
    """
    seen = []
    for recording in corpus.load():
        changed = change.apply(recording)
        fingers = _fingers(corpus, changed)
        if fingers:
            seen.append(_look(method, corpus, changed, fingers, stride))
    return seen


def _fingers(corpus: Corpus, recording: Recording) -> tuple[str, ...]:
    modules = recording.modules
    return tuple(f for f in corpus.fingers if f in modules and modules[f].n_samples)


def _look(
    method: Method, corpus: Corpus, recording: Recording, fingers: Sequence[str], stride: int
) -> RecordingFeatures:
    hand = hand_signal(recording, Tare.parse(corpus.tare), tuple(fingers))
    modules = {name: recording.modules[name] for name in fingers}
    rested = modules if hand.tare.without_contact else {}
    held = recording.metadata.get("object")
    features = {
        unit: np.asarray(rows[::stride], dtype=np.float32)
        for unit, rows in method.features(hand).items()
    }
    return RecordingFeatures(
        name=recording.name,
        object=None if held is None else str(held),
        truth=recording.truth,
        times={name: finger.times[::stride] for name, finger in hand.fingers.items()},
        amplitude={name: finger.amplitude[::stride] for name, finger in hand.fingers.items()},
        labels=_codes(recording, fingers, stride),
        exact=_codes(relabelled(recording, 0.0), fingers, stride),
        at_rest={name: rest_moments(each, hand.tare, hand.rate) for name, each in rested.items()},
        features=features,
    )


def _codes(recording: Recording, fingers: Sequence[str], stride: int) -> dict[str, Codes]:
    modules = {name: recording.modules[name] for name in fingers}
    return {n: label_states(each.labels, each.times)[::stride] for n, each in modules.items()}
