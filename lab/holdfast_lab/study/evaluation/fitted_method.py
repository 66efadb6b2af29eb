"""A method fitted to some recordings of a corpus, which scores other recordings.

The margin of a finger is its log odds of stability minus the threshold of its classifier. A
finger in contact is stable if its margin is at least the shift of the threshold. A hand is not
stable if one of its fingers is not stable. So the state of a hand depends only on the smallest
margin of the fingers in contact.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import UNSTABLE, enough_contacts, hand_states
from holdfast.metrics import Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.sensors.types import Array
from holdfast.training.classifiers import Samples
from holdfast.training.finger_samples import (
    concatenate,
    contact_threshold,
    labelled_samples,
    thinning_step,
    usable_rows,
)
from holdfast_lab.classifiers import Classifier, ungrouped
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures
from holdfast_lab.study.methods import HAND, Method

MAX_FITTED_SAMPLES = 20_000
"""Maximum samples of a unit that train a classifier. All samples are evaluated."""

Shifts = Mapping[str, Mapping[str, float]]
"""Shifts of a threshold [log odds], by reading of glitches and name of the threshold."""
MIN_PROBABILITY = 1e-12
"""Minimum distance of a probability from 0 and 1, so that log odds are finite."""


@dataclass(frozen=True, eq=False)
class MethodTraining:
    """The recordings that a method can be fitted to, and their samples.

    Attributes:
        method: to fit.
        recordings: of a corpus.
        samples: of each unit. A group is the number of a recording.
        seed: of the fits.
    """

    method: Method
    recordings: Sequence[RecordingFeatures]
    samples: Mapping[str, Samples]
    seed: int = 0

    @classmethod
    def of(
        cls,
        method: Method,
        recordings: Sequence[RecordingFeatures],
        max_samples: int = MAX_FITTED_SAMPLES,
        seed: int = 0,
        *,
        sliding: bool = False,
    ) -> "MethodTraining":
        """Gather the labelled samples of recordings, thinned evenly over the recordings.

        A recording without one of the fingers gives no samples to a whole-hand method.

        Args:
            method: to fit.
            recordings: features of the corpus.
            max_samples: of each unit; all samples that slide are kept beside them.
            seed: of the fits.
            sliding: fit to true rest against sliding, not to the labels of stability.
        """
        # Each recording may give the same number, rounded up.
        most = -(-max_samples // max(len(recordings), 1))
        widths: dict[str, int] = {}
        parts: dict[str, list[Samples]] = {}
        for recording in recordings:
            for unit, rows in recording.features.items():
                widths[unit] = max(widths.get(unit, 0), rows.shape[1])
        for index, recording in enumerate(recordings):
            for unit, rows in recording.features.items():
                labels = recording.slip_labels(unit) if sliding else recording.unit_labels(unit)
                # A hand that lacks a finger has fewer features, which no classifier could share.
                if labels is None or rows.shape[1] != widths[unit]:
                    continue
                usable = usable_rows(rows, labels)
                # Sliding is rare, so all of it is kept, and only the rest is thinned.
                is_kept = sliding & (labels[usable] == UNSTABLE)
                thinned = usable[~is_kept]
                thinned = thinned[:: thinning_step(len(thinned), most)]
                chosen = np.sort(np.concatenate([usable[is_kept], thinned]))
                part = labelled_samples(rows, labels, chosen, index)
                parts.setdefault(unit, []).append(part)
        samples = {unit: concatenate(of_unit) for unit, of_unit in parts.items()}
        return cls(method, recordings, samples, seed)

    @property
    def objects(self) -> list[str | None]:
        """The object of each recording; None if it is not known."""
        return [recording.object for recording in self.recordings]

    def fit(self, indices: Collection[int] | None = None) -> "FittedMethod":
        """Fit the method to some recordings, given by number; by default to all."""
        fitted_to = sorted(range(len(self.recordings)) if indices is None else indices)
        classifiers: dict[str, Classifier] = {}
        for unit, samples in self.samples.items():
            trained = samples.take(np.isin(samples.groups, fitted_to))
            # A unit with one class gets no classifier, and its scores are NaN.
            if not trained.one_class:
                recipe = self.method.recipe
                classifiers[unit] = recipe.fit(ungrouped(trained), self.method.reference, self.seed)
        rest = [self.recordings[index].at_rest for index in fitted_to]
        fingers = dict.fromkeys(finger for moments in rest for finger in moments)
        # A finger that a recording lacks adds nothing to its moments in the others.
        nothing = (0, 0.0, 0.0)
        contact = {
            f: contact_threshold(np.array([r.get(f, nothing) for r in rest])) for f in fingers
        }
        return FittedMethod(classifiers, contact)


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of a finger, or of a hand, before a threshold is applied.

    Attributes:
        times: (n,) [s].
        margin: (n,) smallest known margin of the fingers in contact; infinite if there is none.
        known: (n,) whether the margin of every finger is known.
        grasped: (n,) whether the finger is in contact, or enough fingers to hold an object.
        probability: (n,) smallest probability of stability of the same fingers; NaN if there is
            none, 0 without contact.
    """

    times: Array
    margin: Array
    known: Mask
    grasped: Mask
    probability: Array

    @classmethod
    def of_finger(cls, times: Array, margin: Array, threshold: float, touching: Mask) -> "Scores":
        """Return the scores of a finger.

        Args:
            times: (n,) [s].
            margin: (n,) NaN where it is not known.
            threshold: of its classifier [log odds].
            touching: (n,).
        """
        decided = ~np.isnan(margin)
        probability = np.where(decided & ~touching, 0.0, probability_of(margin + threshold))
        return cls(times, np.where(decided & touching, margin, np.inf), decided, touching,
                   probability)  # fmt: skip

    @classmethod
    def of_hand(cls, fingers: Collection["Scores"]) -> "Scores":
        """Return the scores of a hand at every time of any of its fingers, of at least one.

        A finger keeps the scores of its last sample until its next sample.
        """
        times = np.unique(np.concatenate([finger.times for finger in fingers]))
        last = [np.searchsorted(f.times, times, side="right") - 1 for f in fingers]
        rows = list(zip(fingers, last, strict=True))
        # Row -1, before the first sample of a finger, is masked by `at >= 0`.
        touches = np.array([(at >= 0) & finger.grasped[at] for finger, at in rows])
        decided = np.array([(at >= 0) & finger.known[at] for finger, at in rows])
        margins = np.array([finger.margin[at] for finger, at in rows])
        probability = np.array([finger.probability[at] for finger, at in rows])
        grasped = enough_contacts(touches.sum(axis=0), len(fingers))
        counted = touches & decided
        smallest = np.where(counted, probability, 1.0).min(axis=0)
        smallest = np.where(counted.any(axis=0), smallest, np.nan)
        return cls(
            times,
            np.where(counted, margins, np.inf).min(axis=0),
            np.asarray(decided.all(axis=0)),
            grasped,
            np.where(grasped, smallest, 0.0),
        )

    def states(self, shift: float = 0.0) -> Codes:
        """Return the (n,) states, by the rule of `holdfast.contact.hand_state`.

        Args:
            shift: added to the threshold of every finger [log odds].
        """
        return hand_states(self.margin < shift, ~self.known, self.grasped)

    def hold(self, seconds: float) -> "Scores":
        """Return scores at which a hand stays not stable for a while, as `Debounce.hold` does.

        Samples without a grasped object, or with an unknown finger, are not changed.

        Args:
            seconds: time after the last sample that was not stable [s].
        """
        if len(self.times) < 2:
            return self
        n = max(1, round(seconds / float(np.median(np.diff(self.times)))))
        # Infinity before the start: nothing was unstable yet.
        padded = np.concatenate([np.full(n - 1, np.inf), self.margin])
        smallest = np.lib.stride_tricks.sliding_window_view(padded, n).min(axis=1)
        return replace(self, margin=np.where(self.grasped & self.known, smallest, self.margin))

    def decide(self, labels: Codes, shift: float = 0.0) -> FingerDecisions:
        """Return the decisions with these labels, at a shifted threshold."""
        return FingerDecisions(self.times, labels, self.states(shift), self.probability)


def probability_of(log_odds: Array) -> Array:
    """Return the probabilities of log odds. NaN stays NaN."""
    # Clipped, because the exponential of a larger number overflows; 50 is certain already.
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -50, 50))))


class ScoredRecording(NamedTuple):
    """A recording and its scores by a fitted method.

    Attributes:
        recording: that is scored.
        fingers: those of a whole-hand method have the latest margin of the hand.
        hand: at every time of any finger.
        whole_hand: whether the method decides for the hand only.
        shifts: of the fitted method.
        fold: of the fitted method.
    """

    recording: RecordingFeatures
    fingers: Mapping[str, Scores]
    hand: Scores
    whole_hand: bool
    shifts: Shifts
    fold: int

    def decide(self, labels: Mapping[str, Codes]) -> Decisions:
        """Return the decisions for fingers and hand with these labels, at the own thresholds.

        A whole-hand method has one finger, `HAND`.

        Args:
            labels: (n,) codes of each finger.
        """
        fingers = {name: scores.decide(labels[name]) for name, scores in self.fingers.items()}
        hand = self.hand.decide(hand_decisions(fingers, len(fingers)).labels)
        return Decisions(self.recording.name, {HAND: hand} if self.whole_hand else fingers, hand)


@dataclass(frozen=True, eq=False)
class FittedMethod:
    """A method fitted to some recordings.

    Attributes:
        classifiers: of each unit whose training samples had both classes.
        contact_thresholds: F_a of each finger below which there is no contact; None if unknown.
        shifts: of the threshold, for each of `READINGS` and each threshold of `BY_RATE`; chosen on
            the same recordings.
        fold: number of the fold that is left out.
    """

    classifiers: Mapping[str, Classifier]
    contact_thresholds: Mapping[str, float | None]
    shifts: Shifts = field(default_factory=dict)
    fold: int = 0

    def scores(self, recording: RecordingFeatures) -> ScoredRecording:
        """Return the scores of a recording; NaN for a unit without a matching classifier."""
        # By unit, the margins and the threshold of its classifier [log odds].
        margins: dict[str, tuple[Array, float]] = {}
        for unit, rows in recording.features.items():
            classifier = self.classifiers.get(unit)
            if classifier is None or classifier.n_features != rows.shape[1]:
                margins[unit] = np.full(len(rows), np.nan), 0.0
            else:
                threshold = float(_log_odds(classifier.threshold))
                margins[unit] = _log_odds(classifier.probability(rows)) - threshold, threshold
        first = next(iter(recording.times.values()))

        def score(unit: str, times: Array, touching: Mask) -> Scores:
            margin, threshold = margins[unit if unit in margins else HAND]
            # The margins of the hand are at the times of its first finger: take the latest.
            if unit not in margins or unit == HAND:
                at = np.searchsorted(first, times, side="right") - 1
                margin = np.where(at >= 0, margin[at], np.nan)
            return Scores.of_finger(times, margin, threshold, touching)

        fingers = {}
        for name, times in recording.times.items():
            lowest = self.contact_thresholds.get(name) or 0.0
            # Not `>=`: a finger whose force is NaN is not known to be without contact.
            fingers[name] = score(name, times, ~(recording.amplitude[name] < lowest))
        hand = Scores.of_hand(fingers.values())
        if HAND in margins:
            hand = score(HAND, hand.times, hand.grasped)
        return ScoredRecording(recording, fingers, hand, HAND in margins, self.shifts, self.fold)


def _log_odds(probability: npt.ArrayLike) -> Any:  # noqa: ANN401 (an array or a number, as given)
    p = np.clip(probability, MIN_PROBABILITY, 1 - MIN_PROBABILITY)
    return np.log(p / (1 - p))
