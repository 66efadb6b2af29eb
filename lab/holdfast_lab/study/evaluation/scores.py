"""Scores of a finger or a hand over a recording, and the decisions that follow at any threshold.

The margin of a finger is its log odds of stability minus the threshold of its classifier. A
finger in contact is stable if its margin is at least the shift of the threshold. A hand is not
stable if one of its fingers is not stable. So the state of a hand depends only on the smallest
margin of the fingers in contact.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from holdfast.contact import enough_contacts, hand_states
from holdfast.metrics import FingerDecisions
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.sensors.types import Array


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
    def of_finger(cls, times: Array, margin: Array, threshold: float, in_contact: Mask) -> "Scores":
        """Return the scores of a finger.

        Args:
            times: (n,) [s].
            margin: (n,) NaN where it is not known.
            threshold: of its classifier [log odds].
            in_contact: (n,).
        """
        known = ~np.isnan(margin)
        probability = np.where(known & ~in_contact, 0.0, probability_of(margin + threshold))
        return cls(times, np.where(known & in_contact, margin, np.inf), known, in_contact,
                   probability)  # fmt: skip

    @classmethod
    def of_hand(cls, fingers: Collection["Scores"]) -> "Scores":
        """Return the scores of a hand at every time of any of its fingers, of at least one.

        A finger keeps the scores of its last sample until its next sample.
        """
        times = np.unique(np.concatenate([finger.times for finger in fingers]))
        last = [np.searchsorted(f.times, times, side="right") - 1 for f in fingers]
        rows = list(zip(fingers, last, strict=True))
        touches = np.array([(at >= 0) & finger.grasped[at] for finger, at in rows])
        known = np.array([(at >= 0) & finger.known[at] for finger, at in rows])
        margins = np.array([finger.margin[at] for finger, at in rows])
        probability = np.array([finger.probability[at] for finger, at in rows])
        grasped = enough_contacts(touches.sum(axis=0), len(fingers))
        counted = touches & known
        smallest = np.where(counted, probability, 1.0).min(axis=0)
        smallest = np.where(counted.any(axis=0), smallest, np.nan)
        return cls(
            times,
            np.where(counted, margins, np.inf).min(axis=0),
            np.asarray(known.all(axis=0)),
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
        padded = np.concatenate([np.full(n - 1, np.inf), self.margin])
        smallest = np.lib.stride_tricks.sliding_window_view(padded, n).min(axis=1)
        return replace(self, margin=np.where(self.grasped & self.known, smallest, self.margin))

    def decide(self, labels: Codes, shift: float = 0.0) -> FingerDecisions:
        """Return the decisions with these labels, at a shifted threshold."""
        return FingerDecisions(self.times, labels, self.states(shift), self.probability)


def probability_of(log_odds: Array) -> Array:
    """Return the probabilities of log odds. NaN stays NaN."""
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(log_odds, -50, 50))))
