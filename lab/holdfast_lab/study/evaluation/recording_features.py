"""The features that a method computes from the recordings of a corpus, with their labels."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.features import Tare
from holdfast.metrics import FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.metrics.slip_truth import (
    NOT_HELD,
    SLIDING,
    STILL,
    SlipTruth,
    slip_truth,
    truth_without,
)
from holdfast.metrics.truth_labels import LabelRule, relabel
from holdfast.recordings import Recording, Truth, label_states
from holdfast.sensors.types import Array
from holdfast.training.training_samples import rest_moments
from holdfast_lab.study.evaluation.variation import Variation
from holdfast_lab.study.kept import WORKER_MEMORY
from holdfast_lab.study.methods import HAND, HandSignal, Method, hand_signal
from holdfast_lab.study.plan import Corpus

UNCHANGED = Variation()


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """What every method uses of one recording: its signals, and its labels at each sample.

    Attributes:
        hand: signals of the fingers.
        labels: label codes of each finger.
        exact_labels: the same without margin, if the truth is known.
        glitches: (n,) samples of each finger whose exact label has the cause glitch.
        slips: truth of each finger whose slips are known.
        at_rest: moments of F_a of each finger in the tare interval, see `rest_moments`.
    """

    hand: HandSignal
    labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    glitches: Mapping[str, Mask]
    slips: Mapping[str, SlipTruth]
    at_rest: Mapping[str, tuple[int, float, float]]

    @classmethod
    def of(cls, recording: Recording, tare: Tare, fingers: Sequence[str]) -> "PreparedRecording":
        """Prepare some fingers of a recording."""
        hand = hand_signal(recording, tare, tuple(fingers))
        modules = {name: recording.modules[name] for name in fingers}
        exact = relabel(recording, LabelRule(margin=0.0)).modules
        exact_labels = {name: exact[name].label_states for name in fingers}
        glitches, slips = {}, {}
        for name, module in modules.items():
            of_glitch = [label for label in exact[name].labels if label.cause is Cause.GLITCH]
            glitches[name] = label_states(of_glitch, module.times) != UNKNOWN
            slips[name] = slip_truth(recording, name, module.times, exact_labels[name] == STABLE)
        rest = modules if tare.without_contact else {}
        return cls(
            hand,
            {name: module.label_states for name, module in modules.items()},
            exact_labels,
            glitches,
            {name: truth for name, truth in slips.items() if truth is not None},
            {name: rest_moments(module, tare, hand.rate) for name, module in rest.items()},
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
        n_bytes += sum(truth.codes.nbytes + truth.quiet.nbytes for truth in self.slips.values())
        return n_bytes + sum(finger.force.nbytes for finger in self.hand.fingers.values())


@dataclass(frozen=True, eq=False)
class RecordingFeatures:
    """Features, labels and truth of one recording, without its readings.

    A unit is what has one classifier: a finger, or `HAND` for a whole-hand method. Scored are the
    samples at which all compared methods can have an estimate.

    Attributes:
        name: of the recording.
        object: the object in the hand; None if the recording does not name it.
        truth: of the recording.
        times: sample times of each finger [s].
        amplitude: F_a of each finger [unit of the readings]; NaN where there is no force.
        labels: label codes of each finger.
        scored_labels: the same, UNKNOWN at samples that are not scored.
        exact_labels: the same without margin, if the truth is known.
        glitches: (n,) samples of each finger whose exact label has the cause glitch.
        slips: truth of the scored samples, of each finger whose slips are known.
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
    scored_labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    glitches: Mapping[str, Mask]
    slips: Mapping[str, SlipTruth]
    at_rest: Mapping[str, tuple[int, float, float]]
    features: Mapping[str, npt.NDArray[Any]]

    def hand_labels(self, labels: Mapping[str, Codes]) -> FingerDecisions:
        """Return the hand with the label that follows from these finger labels."""
        fingers = {
            name: FingerDecisions(times, labels[name], labels[name], np.full(len(times), np.nan))
            for name, times in self.times.items()
        }
        return hand_decisions(fingers, len(fingers))

    def unit_labels(self, unit: str) -> Codes:
        """Return the labels that train a unit: for the hand, at the times of the first finger."""
        if unit != HAND:
            return self.labels[unit]
        hand = self.hand_labels(self.labels)
        return hand.labels[np.searchsorted(hand.times, next(iter(self.times.values())))]

    def slip_labels(self, unit: str) -> Codes | None:
        """Return STABLE where a unit is still, UNSTABLE where it slides; None if it is not known.

        The hand slides if one of its fingers slides.
        """
        fingers = list(self.slips) if unit == HAND else [unit] if unit in self.slips else []
        if not fingers:
            return None
        times = self.times[unit] if unit != HAND else next(iter(self.times.values()))
        codes = np.full(len(times), NOT_HELD, dtype=np.int8)
        for finger in fingers:
            own = np.append(np.int8(NOT_HELD), self.slips[finger].codes)
            at = np.searchsorted(self.times[finger], times, side="right")
            codes = np.maximum(codes, own[at])
        states = np.select([codes == STILL, codes == SLIDING], [STABLE, UNSTABLE], default=UNKNOWN)
        return states.astype(np.int8)


def corpus_features(
    method: Method,
    corpus: Corpus,
    variation: Variation = UNCHANGED,
    stride: int = 1,
    warm_up: float = 0.0,
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
    corpus: Corpus, variation: Variation = UNCHANGED
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
        modules = recording.modules
        fingers = tuple(f for f in corpus.fingers if f in modules and modules[f].n_samples)
        if not fingers:
            continue
        if variation != UNCHANGED:
            yield PreparedRecording.of(variation.apply(recording), tare, fingers)
            continue
        prepare = partial(PreparedRecording.of, recording, tare, fingers)
        key = (*corpus.identity, recording.name, fingers, corpus.tare)
        yield WORKER_MEMORY.get(key, prepare, attrgetter("n_bytes"))


def recording_features(
    method: Method, prepared: PreparedRecording, stride: int = 1, warm_up: float = 0.0
) -> RecordingFeatures:
    """Return the features of a recording; the arguments are those of `corpus_features`."""
    hand, recording = prepared.hand, prepared.recording
    grasped_object = recording.metadata.get("object")
    kept = slice(None, None, stride)
    times = {name: finger.times[kept] for name, finger in hand.fingers.items()}
    scored = {name: _scored(hand, name, warm_up)[kept] for name in hand.fingers}
    labels = {name: codes[kept] for name, codes in prepared.labels.items()}
    exact = {name: codes[kept] for name, codes in prepared.exact_labels.items()}
    slips = {
        name: replace(truth, codes=truth.codes[kept], quiet=truth.quiet[kept])
        for name, truth in prepared.slips.items()
    }
    return RecordingFeatures(
        name=recording.name,
        object=None if grasped_object is None else str(grasped_object),
        truth=recording.truth,
        times=times,
        amplitude={name: finger.amplitude[kept] for name, finger in hand.fingers.items()},
        labels=labels,
        scored_labels={
            name: np.where(scored[name], codes, UNKNOWN) for name, codes in labels.items()
        },
        exact_labels={
            name: np.where(scored[name], codes, UNKNOWN) for name, codes in exact.items()
        },
        glitches={name: mask[kept] for name, mask in prepared.glitches.items()},
        slips={
            name: truth_without(times[name], truth, ~scored[name]) for name, truth in slips.items()
        },
        at_rest=prepared.at_rest,
        features={
            unit: np.asarray(rows[kept], dtype=np.float32)
            for unit, rows in method.features(hand).items()
        },
    )


def _scored(hand: HandSignal, name: str, warm_up: float) -> Mask:
    """Return the samples of a finger that come at least `warm_up` [s] after a stretch begins."""
    times = hand.fingers[name].times
    scored = np.full(len(times), not warm_up)
    for rows in hand.fingers[name].stretches if warm_up else ():
        scored[rows] = times[rows] >= times[rows.start] + warm_up - 0.5 / hand.rate
    return scored
