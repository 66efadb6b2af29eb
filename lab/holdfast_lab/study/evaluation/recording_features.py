"""The features that a method computes from the recordings of a corpus, with their labels."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.detection import Tare
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
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.recordings import Recording, Truth, cut_labels, label_states
from holdfast.sensors.types import Array
from holdfast.training.training_samples import rest_moments
from holdfast_lab.study.evaluation.alarm_labels import AlarmLabels, labels_by_reading
from holdfast_lab.study.kept import WORKER_MEMORY
from holdfast_lab.study.methods import HAND, HandSignal, Method, hand_signal
from holdfast_lab.study.plan import Corpus


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
        calm_labels: the exact ones, with glitches of the hand's controller labelled stable.
        slips: truth of the scored samples, of each finger whose slips are known.
        at_rest: moments of F_a of each finger in the tare interval, see `rest_moments`.
        features: (n, n_features) of each unit; empty until a method computes them. Those of
            `HAND` are at the times of the first finger.
    """

    name: str
    object: str | None
    truth: Truth | None
    times: Mapping[str, Array]
    amplitude: Mapping[str, Array]
    labels: Mapping[str, Codes]
    scored_labels: Mapping[str, Codes]
    exact_labels: Mapping[str, Codes]
    calm_labels: Mapping[str, Codes]
    slips: Mapping[str, SlipTruth]
    at_rest: Mapping[str, tuple[int, float, float]]
    features: Mapping[str, npt.NDArray[Any]]

    @classmethod
    def of(cls, hand: HandSignal) -> "RecordingFeatures":
        """Return the labels and the truth of the fingers of a hand, all samples scored."""
        recording, fingers = hand.recording, hand.fingers
        modules = {name: recording.modules[name] for name in fingers}
        exact = relabel(recording, LabelRule(margin=0.0)).modules
        labels = {name: module.label_states for name, module in modules.items()}
        exact_labels = {name: exact[name].label_states for name in fingers}
        calm_labels, slips = {}, {}
        for name, module in modules.items():
            codes = exact_labels[name]
            of_glitch = [label for label in exact[name].labels if label.cause is Cause.GLITCH]
            # UNKNOWN stays UNKNOWN: a sample that nobody labelled is not made stable by a glitch.
            glitch = label_states(of_glitch, module.times) != UNKNOWN
            calm_labels[name] = np.where(glitch & (codes != UNKNOWN), STABLE, codes)
            slips[name] = slip_truth(recording, name, module.times, codes == STABLE)
        grasped_object = recording.metadata.get("object")
        return cls(
            name=recording.name,
            object=None if grasped_object is None else str(grasped_object),
            truth=recording.truth,
            times={name: finger.times for name, finger in fingers.items()},
            amplitude={name: finger.amplitude for name, finger in fingers.items()},
            labels=labels,
            scored_labels=labels,
            exact_labels=exact_labels,
            calm_labels=calm_labels,
            slips={name: truth for name, truth in slips.items() if truth is not None},
            # A tare that is taken in contact says nothing of the noise without contact.
            at_rest={
                name: rest_moments(module, hand.tare, hand.rate)
                for name, module in modules.items()
                if hand.tare.without_contact
            },
            features={},
        )

    def scored_at(self, scored: Mapping[str, Mask]) -> "RecordingFeatures":
        """Return the recording, scored where the mask of a finger is True."""
        changed: dict[str, Any] = {
            field: {
                name: np.where(scored[name], codes, UNKNOWN)
                for name, codes in getattr(self, field).items()
            }
            for field in ("scored_labels", "exact_labels", "calm_labels")
        }
        slips = {
            name: truth_without(self.times[name], truth, ~scored[name])
            for name, truth in self.slips.items()
        }
        return replace(self, slips=slips, **changed)

    @cached_property
    def alarm_labels(self) -> dict[str, AlarmLabels]:
        """Exact labels of the hand by which alarms are counted, for each of `READINGS`."""
        event, calm = (label_hand(self.times, x) for x in (self.exact_labels, self.calm_labels))
        return labels_by_reading(event, calm)

    def unit_labels(self, unit: str) -> Codes:
        """Return the labels that train a unit: for the hand, at the times of the first finger."""
        if unit != HAND:
            return self.labels[unit]
        hand = label_hand(self.times, self.labels)
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
            # Position 0 stands for the times before the first sample of the finger.
            padded = np.append(np.int8(NOT_HELD), self.slips[finger].codes)
            at = np.searchsorted(self.times[finger], times, side="right")
            codes = np.maximum(codes, padded[at])
        states = np.select([codes == STILL, codes == SLIDING], [STABLE, UNSTABLE], default=UNKNOWN)
        return states.astype(np.int8)


def label_hand(times: Mapping[str, Array], labels: Mapping[str, Codes]) -> FingerDecisions:
    """Return the labels of a hand that follow from those of its fingers, as its decisions.

    Args:
        times: (n,) of each finger [s].
        labels: (n,) codes of each finger.
    """
    fingers = {
        name: FingerDecisions(stamps, labels[name], labels[name], np.full(len(stamps), np.nan))
        for name, stamps in times.items()
    }
    return hand_decisions(fingers, len(fingers))


class PreparedRecording(NamedTuple):
    """Signals of one recording, and its labels at each sample, for all methods."""

    hand: HandSignal
    labelled: RecordingFeatures

    @classmethod
    def of(cls, recording: Recording, tare: Tare, fingers: tuple[str, ...]) -> Self:
        """Prepare some fingers of a recording."""
        hand = hand_signal(recording, tare, fingers)
        return cls(hand, RecordingFeatures.of(hand))

    @property
    def n_bytes(self) -> int:
        """Size of the arrays that it adds to those of the recording [byte]."""
        data = self.labelled
        arrays: list[npt.NDArray[Any]] = [finger.force for finger in self.hand.fingers.values()]
        for by_finger in (data.amplitude, data.labels, data.exact_labels, data.calm_labels):
            arrays += by_finger.values()
        arrays += [array for truth in data.slips.values() for array in (truth.codes, truth.quiet)]
        return sum(array.nbytes for array in arrays)


def corpus_features(
    method: Method,
    corpus: Corpus,
    warm_up: float = 0.0,
) -> list[RecordingFeatures]:
    """Return the features of all recordings of a corpus that have one of its fingers.

    Args:
        method: computes the features.
        corpus: the recordings.
        warm_up: time at the start of every unbroken stretch that is not scored [s].
    """
    featured = []
    for hand, labelled in prepared_recordings(corpus):
        scored: dict[str, Mask] = {}
        for name, finger in hand.fingers.items():
            times = finger.times
            scored[name] = np.full(len(times), not warm_up)
            # Features start anew after every gap, so every stretch has its own warm-up. Half a
            # sample period is allowed for the rounding of times.
            for rows in finger.stretches if warm_up else ():
                begin = times[rows.start] + warm_up - 0.5 / hand.rate
                scored[name][rows] = times[rows] >= begin
        features = {
            unit: np.asarray(rows, dtype=np.float32) for unit, rows in method.features(hand).items()
        }
        featured.append(replace(labelled.scored_at(scored), features=features))
    return featured


def prepared_recordings(corpus: Corpus) -> Iterator[PreparedRecording]:
    """Yield the recordings of a corpus that have one of its fingers, in order.

    A process prepares a recording once, as long as it has memory; see `kept`.

    Args:
        corpus: gives the recordings, the fingers and the tare.
    """
    tare = Tare.parse(corpus.tare)
    for recording in corpus.load():
        modules = recording.modules
        fingers = tuple(f for f in corpus.fingers if f in modules and modules[f].n_samples)
        if not fingers:
            continue
        prepare = partial(PreparedRecording.of, recording, tare, fingers)
        key = (*corpus.identity, recording.name, fingers, corpus.tare)
        yield WORKER_MEMORY.get(key, prepare, attrgetter("n_bytes"))


def relabel(recording: Recording, rule: LabelRule) -> Recording:
    """Return the recording with labels made from its truth.

    Fingers without a truth keep their labels. Labels are cut to the samples: a sensor may start
    later than the truth.

    Args:
        recording: to label.
        rule: thresholds and margins.
    """
    labels = labels_by_truth(recording, rule)
    modules = {
        name: replace(module, labels=cut_labels(labels[name], module)) if name in labels else module
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules) if labels else recording
