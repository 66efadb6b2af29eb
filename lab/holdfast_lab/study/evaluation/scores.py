"""Scores of one recording by a fitted method, and the decisions that follow at any threshold.

The margin of a finger is its log odds of stability minus the threshold of its classifier. A
finger in contact is stable if its margin is at least the shift of the threshold. A hand is not
stable if one of its fingers is not stable. So the state of a hand depends only on the smallest
margin of the fingers in contact.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from holdfast.contact import (
    NO_CONTACT,
    STABLE,
    UNKNOWN,
    UNSTABLE,
    enough_contacts,
    hand_states,
)
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.sensors.types import Array
from holdfast_lab.study.evaluation.recording_features import RecordingFeatures
from holdfast_lab.study.methods import HAND


@dataclass(frozen=True, eq=False)
class HandScores:
    """Scores of a hand over a recording, before a threshold is applied.

    Attributes:
        times: (n,) [s].
        margin: (n,) smallest margin of the fingers in contact whose margin is known; infinite
            if there is none.
        known: (n,) whether the margin of every finger is known.
        held: (n,) whether enough fingers are in contact to hold an object.
        probability: (n,) smallest probability of stability of the same fingers; NaN if there
            is none, 0 if the object is not held.
    """

    times: Array
    margin: Array
    known: Mask
    held: Mask
    probability: Array

    def states(self, shift: float = 0.0) -> Codes:
        """Return the (n,) states of the hand, by the rule of `holdfast.contact.hand_state`.

        Args:
            shift: added to the threshold of every finger [log odds].
        """
        return hand_states(self.margin < shift, ~self.known, self.held)

    def hold(self, seconds: float) -> "HandScores":
        """Return scores at which a hand stays not stable for a while, as `Debounce.hold` does.

        Samples without a held object, or with an unknown finger, are not changed.

        Args:
            seconds: time after the last sample that was not stable [s].
        """
        if len(self.times) < 2:
            return self
        n = max(1, round(seconds / float(np.median(np.diff(self.times)))))
        padded = np.concatenate([np.full(n - 1, np.inf), self.margin])
        smallest = np.lib.stride_tricks.sliding_window_view(padded, n).min(axis=1)
        return replace(self, margin=np.where(self.held & self.known, smallest, self.margin))

    def decide(self, labels: Codes, shift: float = 0.0) -> FingerDecisions:
        """Return the decisions for the hand with these labels, at a shifted threshold."""
        return FingerDecisions(self.times, labels, self.states(shift), self.probability)


@dataclass(frozen=True, eq=False)
class RecordingScores:
    """Scores of one recording by a fitted method.

    Attributes:
        margins: (n,) log odds of stability minus the threshold, of each unit; NaN if unknown.
        thresholds: of each unit [log odds].
        in_contact: (n,) whether the finger is in contact, of each finger.
    """

    margins: Mapping[str, Array]
    thresholds: Mapping[str, float]
    in_contact: Mapping[str, Mask]

    def decide(self, recording: RecordingFeatures, labels: Mapping[str, Codes]) -> Decisions:
        """Return the decisions for fingers and hand with these labels, at the own thresholds.

        A whole-hand method decides for the hand only.
        """
        hand = self.hand(recording).decide(recording.hand_labels(labels).labels)
        if HAND in self.margins:
            return Decisions(recording.name, {}, hand)
        fingers = {
            name: _decide_finger(finger, *self._unit_scores(name, recording), self.in_contact[name])
            for name, finger in recording.finger_labels(labels).items()
        }
        return Decisions(recording.name, fingers, hand)

    def hand(self, recording: RecordingFeatures) -> HandScores:
        """Return the scores of the hand at every time of any finger.

        A finger keeps the scores of its last sample until its next sample.
        """
        times = np.unique(np.concatenate(list(recording.times.values())))
        last = {
            finger: np.searchsorted(finger_times, times, side="right") - 1
            for finger, finger_times in recording.times.items()
        }
        in_contact = np.array([(at >= 0) & self.in_contact[f][at] for f, at in last.items()])
        held = enough_contacts(in_contact.sum(axis=0), len(last))
        if HAND in self.margins:
            last = {HAND: next(iter(last.values()))}
            in_contact = held[None]
        scores = {unit: self._unit_scores(unit, recording) for unit in last}
        margins = np.array([_values_at(scores[unit][0], at) for unit, at in last.items()])
        probability = np.array([_values_at(scores[unit][1], at) for unit, at in last.items()])
        return HandScores(
            times=times,
            margin=np.where(in_contact & ~np.isnan(margins), margins, np.inf).min(axis=0),
            known=~np.isnan(margins).any(axis=0),
            held=held,
            probability=np.where(held, _smallest(probability, in_contact), 0.0),
        )

    def _unit_scores(self, unit: str, recording: RecordingFeatures) -> tuple[Array, Array]:
        """Return margins and probabilities of a unit; NaN if it has no classifier."""
        margins = self.margins.get(unit)
        if margins is None:
            margins = np.full(len(recording.times[unit]), np.nan)
        return margins, probability_of(margins + self.thresholds.get(unit, 0.0))


def _smallest(probability: Array, in_contact: Mask) -> Array:
    """Return the smallest known probability of the units in contact; NaN if there is none."""
    counted = in_contact & ~np.isnan(probability)
    smallest = np.where(counted, probability, 1.0).min(axis=0)
    return np.where(counted.any(axis=0), smallest, np.nan)


def probability_of(log_odds: Array) -> Array:
    """Return the probabilities of log odds. NaN stays NaN."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -50, 50))))


def _values_at(values: Array, places: npt.NDArray[np.intp]) -> Array:
    return np.where(places >= 0, values[places], np.nan)


def _decide_finger(
    labelled: FingerDecisions, margins: Array, probability: Array, in_contact: Mask
) -> FingerDecisions:
    known = ~np.isnan(margins)
    stable = np.where(margins >= 0.0, STABLE, UNSTABLE)
    states = np.select([~known, ~in_contact], [UNKNOWN, NO_CONTACT], default=stable)
    return FingerDecisions(
        labelled.times,
        labelled.labels,
        states.astype(np.int8),
        np.where(~in_contact & known, 0.0, probability),
    )
