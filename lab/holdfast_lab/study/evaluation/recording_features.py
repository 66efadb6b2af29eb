"""The features that a method computes from the recordings of a corpus, with their labels."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, Cause
from holdfast.features import Tare
from holdfast.metrics import FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.metrics.truth_labels import LabelRule, relabel
from holdfast.recordings import Recording, Tactile, Truth, label_states
from holdfast.sensors.types import Array
from holdfast.training.training_samples import rest_moments
from holdfast_lab.study.evaluation.variation import Variation
from holdfast_lab.study.kept import WORKER_MEMORY
from holdfast_lab.study.methods import HAND, HandSignal, Method, hand_signal
from holdfast_lab.study.plan import Corpus


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
        compared: (n,) samples of each finger at which all compared methods can have an estimate.
        scored_labels: the labels, UNKNOWN at other samples.
        exact_labels: the same without margin, if the truth is known.
        glitches: (n,) samples of each finger whose exact label has the cause glitch.
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
    compared: Mapping[str, Mask]
    scored_labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    glitches: Mapping[str, Mask]
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

    def labels_without_glitches(self) -> dict[str, Codes]:
        """Return the exact labels of each finger with every glitch labelled stable."""
        return {
            name: np.where(self.glitches[name] & (codes != UNKNOWN), STABLE, codes).astype(np.int8)
            for name, codes in self.exact_labels.items()
        }

    def unit_labels(self, unit: str) -> Codes:
        """Return the labels that train a unit: for the hand, at the times of the first finger."""
        if unit != HAND:
            return self.labels[unit]
        hand = self.hand_labels(self.labels)
        return hand.labels[np.searchsorted(hand.times, next(iter(self.times.values())))]


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """What every method uses of one recording: its signals, and its labels at each sample.

    Attributes:
        hand: signals of the fingers.
        labels: label codes of each finger.
        exact_labels: the same without margin, if the truth is known.
        glitches: (n,) samples of each finger whose exact label has the cause glitch.
        at_rest: moments of F_a of each finger in the tare interval, see `rest_moments`.
    """

    hand: HandSignal
    labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    glitches: Mapping[str, Mask]
    at_rest: Mapping[str, tuple[int, float, float]]

    @classmethod
    def of(cls, recording: Recording, tare: Tare, fingers: Sequence[str]) -> "PreparedRecording":
        """Prepare some fingers of a recording."""
        hand = hand_signal(recording, tare, tuple(fingers))
        modules = {name: recording.modules[name] for name in fingers}
        without_contact = modules if tare.without_contact else {}
        exact = relabel(recording, LabelRule(margin=0.0)).modules
        return cls(
            hand=hand,
            labels={name: module.label_states for name, module in modules.items()},
            exact_labels={name: exact[name].label_states for name in fingers},
            glitches={name: _glitch_samples(exact[name]) for name in fingers},
            at_rest={
                name: rest_moments(module, tare, hand.rate)
                for name, module in without_contact.items()
            },
        )

    @property
    def recording(self) -> Recording:
        """The recording."""
        return self.hand.recording

    @property
    def n_bytes(self) -> int:
        """Size of the arrays that it adds to those of the recording [byte]."""
        codes = (self.labels, self.exact_labels, self.glitches)
        n_bytes = sum(array.nbytes for arrays in codes for array in arrays.values())
        return n_bytes + sum(finger.force.nbytes for finger in self.hand.fingers.values())


def corpus_features(
    method: Method, corpus: Corpus, variation: Variation, stride: int = 1, warm_up: float = 0.0
) -> list[RecordingFeatures]:
    """Return the features of all recordings of a corpus that have one of its fingers.

    Args:
        method: computes the features.
        corpus: the recordings.
        variation: applied to each recording first.
        stride: keep the features of every n-th sample. They are computed from all samples.
        warm_up: time at the start of every unbroken stretch that is not scored [s].
    """
    prepared = prepared_recordings(corpus, variation)
    return [recording_features(method, each, stride, warm_up) for each in prepared]


def prepared_recordings(
    corpus: Corpus,
    variation: Variation = Variation(),  # noqa: B008 (frozen)
) -> Iterator[PreparedRecording]:
    """Yield the recordings of a corpus that have one of its fingers, in order.

    A process prepares a recording once, as long as it has memory; see `kept`. A recording that
    is varied is not kept.

    Args:
        corpus: gives the recordings, the fingers and the tare.
        variation: applied to each recording first.
    """
    tare = Tare.parse(corpus.tare)
    for recording in corpus.load():
        if not (fingers := _fingers(corpus, recording)):
            continue
        if variation != Variation():
            yield PreparedRecording.of(variation.apply(recording), tare, fingers)
            continue
        prepare = partial(PreparedRecording.of, recording, tare, fingers)
        key = (*corpus.identity, recording.name, fingers, corpus.tare)
        yield WORKER_MEMORY.get(key, prepare, attrgetter("n_bytes"))


def _fingers(corpus: Corpus, recording: Recording) -> tuple[str, ...]:
    modules = recording.modules
    return tuple(f for f in corpus.fingers if f in modules and modules[f].n_samples)


def _glitch_samples(module: Tactile) -> Mask:
    """Return the samples of a finger whose label has the cause glitch."""
    of_glitch = [label for label in module.labels if label.cause is Cause.GLITCH]
    return np.asarray(label_states(of_glitch, module.times) != UNKNOWN)


def recording_features(
    method: Method, prepared: PreparedRecording, stride: int = 1, warm_up: float = 0.0
) -> RecordingFeatures:
    """Return the features of a recording.

    Args:
        method: computes the features.
        prepared: the recording.
        stride: keep the features of every n-th sample. They are computed from all samples.
        warm_up: time at the start of every unbroken stretch that is not scored [s].
    """
    hand, recording = prepared.hand, prepared.recording
    held = recording.metadata.get("object")
    kept = slice(None, None, stride)
    compared = {name: _after(warm_up, hand, name)[kept] for name in hand.fingers}
    labels = _every(prepared.labels, kept)
    return RecordingFeatures(
        name=recording.name,
        object=None if held is None else str(held),
        truth=recording.truth,
        times={name: finger.times[kept] for name, finger in hand.fingers.items()},
        amplitude={name: finger.amplitude[kept] for name, finger in hand.fingers.items()},
        labels=labels,
        compared=compared,
        scored_labels=_masked(labels, compared),
        exact_labels=_masked(_every(prepared.exact_labels, kept), compared),
        glitches=_every(prepared.glitches, kept),
        at_rest=prepared.at_rest,
        features={
            unit: np.asarray(rows[kept], dtype=np.float32)
            for unit, rows in method.features(hand).items()
        },
    )


def _every(arrays: Mapping[str, npt.NDArray[Any]], kept: slice) -> dict[str, npt.NDArray[Any]]:
    return {name: array[kept] for name, array in arrays.items()}


def _after(warm_up: float, hand: HandSignal, name: str) -> Mask:
    """Return the samples of a finger that come at least `warm_up` [s] after a stretch begins."""
    times = hand.fingers[name].times
    if not warm_up:
        return np.ones(len(times), dtype=np.bool_)
    after = np.zeros(len(times), dtype=np.bool_)
    for rows in hand.fingers[name].stretches:
        after[rows] = times[rows] >= times[rows.start] + warm_up - 0.5 / hand.rate
    return after


def _masked(labels: Mapping[str, Codes], compared: Mapping[str, Mask]) -> dict[str, Codes]:
    return {
        name: np.where(compared[name], codes, UNKNOWN).astype(np.int8)
        for name, codes in labels.items()
    }
