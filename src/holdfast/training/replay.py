"""Replay of the rule of decision with other thresholds, from probabilities computed once."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np

from holdfast.compiled import compiled
from holdfast.contact import NO_CONTACT, UNKNOWN, UNSTABLE
from holdfast.detector.arrays import CANDIDATE, FILTERED, LAST_UNSTABLE, STATE
from holdfast.detector.decision_rule import (
    classify_contact,
    debounce,
    filter_probability,
    hold_unstable,
    new_decision_memory,
)
from holdfast.metrics import Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.model import Debounce, Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers
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
        out = np.zeros(len(finger.times), dtype=np.int8)
        rule = self.debounce
        memory = new_decision_memory(1)
        limits = np.array([
            threshold, rule.hysteresis, rule.hold, rule.min_duration, self.period,
            rule.switching_rate,
        ])  # fmt: skip
        _replay(
            np.array(finger.times), np.array(finger.stable_probability), np.array(finger.states),
            limits, memory.codes[0], memory.values[0], out,
        )  # fmt: skip
        return out


@compiled
def _replay(
    times: Array,
    probability: Array,
    raw: Codes,
    limits: Array,
    codes: Integers,
    decided: Array,
    out: Codes,
) -> None:
    """Fill the states of a finger, by the steps of the detector.

    Args:
        times: (n,) [s].
        probability: (n,) of stability.
        raw: (n,) states without debouncing at the threshold 0: UNKNOWN, NO_CONTACT, STABLE, or
            UNSTABLE of a force that leaves.
        limits: threshold, hysteresis, hold [s], minimum duration [s], period [s] and switching
            [1/s].
        codes: as in `DecisionMemory`; is changed.
        decided: as in `DecisionMemory`; is changed.
        out: (n,) is filled.
    """
    threshold, hysteresis, hold, min_duration, period, switching = limits
    for k in range(len(times)):
        if raw[k] == UNKNOWN:
            codes[STATE] = codes[CANDIDATE] = UNKNOWN
            decided[LAST_UNSTABLE] = decided[FILTERED] = np.nan
        else:
            state = NO_CONTACT
            if raw[k] == NO_CONTACT:
                decided[FILTERED] = np.nan
            else:
                stable = probability[k]
                if switching > 0.0:
                    stable = filter_probability(decided, stable, threshold, switching, times[k])
                state = classify_contact(stable, threshold, hysteresis, codes[STATE])
                if raw[k] == UNSTABLE:
                    state = UNSTABLE
                state = hold_unstable(state, codes[CANDIDATE], decided, hold, times[k], period)
            debounce(codes, decided, state, min_duration, times[k], period)
        out[k] = codes[STATE]
