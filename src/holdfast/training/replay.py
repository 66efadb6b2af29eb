"""Replay of the rule of decision with other thresholds, from probabilities computed once."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np

from holdfast.detection import Debounce, Model
from holdfast.kernel import _extension
from holdfast.metrics import Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.recordings import Recording
from holdfast.training.evaluation import compute_decisions


@dataclass(frozen=True)
class ThresholdReplay:
    """Decisions about one recording, for any threshold.

    Attributes:
        raw: decisions without debouncing, hold and hysteresis, at the threshold 0: what is UNSTABLE
            then is so by its force, whatever the threshold.
        debounce: of the model.
        period: of the samples [s].
        n_model_fingers: number of fingers of the model.
    """

    raw: Decisions
    debounce: Debounce
    period: float
    n_model_fingers: int

    @classmethod
    def of(cls, model: Model, recording: Recording) -> "ThresholdReplay":
        """Compute the probabilities of a recording.

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        plain = msgspec.structs.replace(model.with_threshold("stable", 0.0), debounce=Debounce())
        raw = compute_decisions(plain, recording)
        period = 1 / (model.rate or recording.rate)
        return cls(raw, model.debounce, period, model.n_fingers(raw.fingers))

    def hand(self, threshold: float) -> FingerDecisions:
        """Return the decisions about the hand at a threshold."""
        fingers = {
            name: replace(finger, states=self.states(finger, threshold))
            for name, finger in self.raw.fingers.items()
        }
        return hand_decisions(fingers, self.n_model_fingers)

    def states(self, finger: FingerDecisions, threshold: float) -> Codes:
        """Return the states of a finger at a threshold."""
        # In C: every threshold is tried on every recording.
        out = np.zeros(len(finger.times), dtype=np.int8)
        rule = self.debounce
        limits = np.array([
            threshold, rule.hysteresis, rule.hold, rule.min_duration, self.period,
            rule.switching_rate,
        ])  # fmt: skip
        times, probability = np.array(finger.times), np.array(finger.stable_probability)
        _extension.replay(times, probability, np.array(finger.states, dtype=np.int8), limits, out)
        return out
