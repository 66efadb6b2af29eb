"""What an fitted thinks of one recording, and what is decided from it at any threshold.

A finger in contact is stable where its margin, the log odds of stability over the threshold of
its classifier, is at least the shift. A hand is not stable where a finger is not: so of a hand
only the least margin of the fingers in contact counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions
from holdfast.metrics.decisions import Codes
from holdfast.sensors.types import Array
from holdfast.study.evaluation.recording_features import RecordingFeatures
from holdfast.study.methods import HAND

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class HandScores:
    """A hand over a recording, before a threshold decides.

    Attributes:
        times: (n,) [s].
        least: (n,) the least margin of the fingers in contact whose margin is known; infinite
            where there is none.
        known: (n,) whether the margin of every finger is known.
        alone: (n,) whether too few fingers are in contact to hold anything.
        probability: (n,) the least probability of stability of the same fingers, 0 where too
            few are in contact; NaN where there is none.
    """

    times: Array
    least: Array
    known: Mask
    alone: Mask
    probability: Array

    def states(self, shift: float = 0.0) -> Codes:
        """(n,) the states of the hand, as its fingers' would make them."""
        choices = [
            (self.least < shift, UNSTABLE),
            (~self.known, UNKNOWN),
            (self.alone, NO_CONTACT),
        ]
        states = np.select([c for c, _ in choices], [s for _, s in choices], default=STABLE)
        return states.astype(np.int8)

    def held(self, seconds: float) -> "HandScores":
        """The score of a hand that goes on not to be stable for a while, as `Debounce.hold` does.

        Not where too few fingers are in contact, nor where a finger is not known.

        Args:
            seconds: after the last sample at which it was not stable [s].
        """
        if len(self.times) < 2:
            return self
        n = max(1, round(seconds / float(np.median(np.diff(self.times)))))
        padded = np.concatenate([np.full(n - 1, np.inf), self.least])
        least = np.lib.stride_tricks.sliding_window_view(padded, n).min(axis=1)
        return replace(self, least=np.where(self.alone | ~self.known, self.least, least))

    def decide(self, labels: Codes, shift: float = 0.0) -> FingerDecisions:
        """The hand's decisions beside those labels."""
        return FingerDecisions(self.times, labels, self.states(shift), self.probability)


@dataclass(frozen=True, eq=False)
class RecordingScores:
    """What an fitted thinks of one recording.

    Attributes:
        margins: of each unit, (n,) log odds of stability over its own threshold; NaN where
            there is none.
        thresholds: of each unit [log odds].
        touching: of each finger, (n,) whether it is in contact.
    """

    margins: Mapping[str, Array]
    thresholds: Mapping[str, float]
    touching: Mapping[str, Mask]

    def decide(self, seen: RecordingFeatures, labels: Mapping[str, Codes]) -> Decisions:
        """The decisions of the fingers at their own thresholds beside those labels, and the hand's.

        A method that judges the hand as a whole has no fingers there.
        """
        hand = self.hand(seen).decide(seen.hand(labels).labels)
        if HAND in self.margins:
            return Decisions(seen.name, {}, hand)
        fingers = {
            name: _decide(finger, *self._finger(seen, name), ~self.touching[name])
            for name, finger in seen.undecided(labels).items()
        }
        return Decisions(seen.name, fingers, hand)

    def hand(self, seen: RecordingFeatures) -> HandScores:
        """The hand, at every time of any finger; each holds its last sample."""
        times = np.unique(np.concatenate(list(seen.times.values())))
        held = {f: np.searchsorted(own, times, side="right") - 1 for f, own in seen.times.items()}
        touching = np.array([(at >= 0) & self.touching[f][at] for f, at in held.items()])
        alone = touching.sum(axis=0) < min(2, len(held))
        if HAND in self.margins:
            at = next(iter(held.values()))
            own = self.thresholds[HAND]
            margins = _hold(self.margins[HAND], at)[None]
            probability = probability_of(margins + own)
            touching = ~alone[None]
            started = at[None] >= 0
        else:
            pairs = {f: self._finger(seen, f) for f in held}
            margins = np.array([_hold(pairs[f][0], at) for f, at in held.items()])
            probability = np.array([_hold(pairs[f][1], at) for f, at in held.items()])
            started = np.array([at >= 0 for at in held.values()])
        told = touching & ~np.isnan(margins)
        none = np.where(told.any(axis=0), 0.0, np.nan)
        return HandScores(
            times=times,
            least=np.where(told, margins, np.inf).min(axis=0),
            known=np.all(started & ~np.isnan(margins), axis=0),
            alone=alone,
            probability=np.where(alone, 0.0, np.where(told, probability, 1.0).min(axis=0) + none),
        )

    def _finger(self, seen: RecordingFeatures, finger: str) -> tuple[Array, Array]:
        """Margins and probabilities of a finger; NaN where its classifier is missing."""
        nothing = np.full(len(seen.times[finger]), np.nan)
        margins = self.margins.get(finger, nothing)
        return margins, probability_of(margins + self.thresholds.get(finger, 0.0))


def probability_of(log_odds: Array) -> Array:
    """The probabilities of log odds; NaN stays."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -50, 50))))


def _hold(values: Array, at: npt.NDArray[np.intp]) -> Array:
    return np.where(at >= 0, values[at], np.nan)


def _decide(
    given: FingerDecisions, margins: Array, probability: Array, free: Mask
) -> FingerDecisions:
    known = ~np.isnan(margins)
    stable = np.where(margins >= 0.0, STABLE, UNSTABLE)
    states = np.select([~known, free], [UNKNOWN, NO_CONTACT], default=stable).astype(np.int8)
    return FingerDecisions(
        given.times, given.labels, states, np.where(free & known, 0.0, probability)
    )
