"""The features that a method computes from the recordings of a corpus, with their labels."""

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
from holdfast.study.evaluation.variation import Variation, relabel
from holdfast.study.methods import HAND, Method, hand_signal
from holdfast.study.plan import Corpus
from holdfast.training.training_samples import rest_moments


@dataclass(frozen=True, eq=False)
class RecordingFeatures:
    """Features, labels and truth of one recording, without its readings.

    A unit is what has one classifier: a finger, or `HAND` for a whole-hand method.

    Attributes:
        name: of the recording.
        object: the object in the hand; None if the recording does not name it.
        truth: of the recording.
        times: sample times of each finger [s].
        amplitude: F_a of each finger [unit of the readings]; NaN where there is no force.
        labels: label codes of each finger.
        exact_labels: label codes of each finger without margin, if the truth is known.
        at_rest: moments of F_a of each finger in the tare interval, see `rest_moments`.
        features: (n, n_features) of each unit. Those of `HAND` are at the times of the first
            finger.
    """

    name: str
    object: str | None
    truth: Truth | None
    times: Mapping[str, Array]
    amplitude: Mapping[str, Array]
    labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    at_rest: Mapping[str, tuple[int, float, float]]
    features: Mapping[str, npt.NDArray[Any]]

    def finger_labels(self, labels: Mapping[str, Codes]) -> dict[str, FingerDecisions]:
        """Return the fingers with these labels and no decision."""
        return {
            name: FingerDecisions(
                times,
                labels[name],
                np.zeros(len(times), dtype=np.int8),
                np.full(len(times), np.nan),
            )
            for name, times in self.times.items()
        }

    def hand_labels(self, labels: Mapping[str, Codes]) -> FingerDecisions:
        """Return the hand with the label that follows from these finger labels."""
        return hand_decisions(self.finger_labels(labels), len(labels))

    def unit_labels(self, unit: str) -> Codes:
        """Return the labels that train a unit: for the hand, at the times of the first finger."""
        if unit != HAND:
            return self.labels[unit]
        hand = self.hand_labels(self.labels)
        return hand.labels[np.searchsorted(hand.times, next(iter(self.times.values())))]


def corpus_features(
    method: Method, corpus: Corpus, variation: Variation, stride: int = 1
) -> list[RecordingFeatures]:
    """Return the features of all recordings of a corpus that have one of its fingers.

    Args:
        method: computes the features.
        corpus: the recordings.
        variation: applied to each recording first.
        stride: keep the features of every n-th sample. They are computed from all samples.
    """
    found = []
    for recording in corpus.load():
        varied = variation.apply(recording)
        fingers = _fingers(corpus, varied)
        if fingers:
            found.append(_recording_features(method, corpus, varied, fingers, stride))
    return found


def _fingers(corpus: Corpus, recording: Recording) -> tuple[str, ...]:
    modules = recording.modules
    return tuple(f for f in corpus.fingers if f in modules and modules[f].n_samples)


def _recording_features(
    method: Method, corpus: Corpus, recording: Recording, fingers: Sequence[str], stride: int
) -> RecordingFeatures:
    hand = hand_signal(recording, Tare.parse(corpus.tare), tuple(fingers))
    modules = {name: recording.modules[name] for name in fingers}
    without_contact = modules if hand.tare.without_contact else {}
    held = recording.metadata.get("object")
    return RecordingFeatures(
        name=recording.name,
        object=None if held is None else str(held),
        truth=recording.truth,
        times={name: finger.times[::stride] for name, finger in hand.fingers.items()},
        amplitude={name: finger.amplitude[::stride] for name, finger in hand.fingers.items()},
        labels=_label_codes(recording, fingers, stride),
        exact_labels=_label_codes(relabel(recording, 0.0), fingers, stride),
        at_rest={
            name: rest_moments(module, hand.tare, hand.rate)
            for name, module in without_contact.items()
        },
        features={
            unit: np.asarray(rows[::stride], dtype=np.float32)
            for unit, rows in method.features(hand).items()
        },
    )


def _label_codes(recording: Recording, fingers: Sequence[str], stride: int) -> dict[str, Codes]:
    modules = {name: recording.modules[name] for name in fingers}
    return {n: label_states(each.labels, each.times)[::stride] for n, each in modules.items()}
