"""Replay of the decision rule with another threshold, from probabilities computed once."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.compiled import compiled
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN
from holdfast.detector.arrays import CANDIDATE, LAST_UNSTABLE, STATE
from holdfast.detector.decision_rule import (
    classify_contact,
    debounce,
    hold_unstable,
    new_decision_memory,
)
from holdfast.metrics import AlarmMatch, Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.events import match_decisions
from holdfast.model import Debounce, Model
from holdfast.recordings import Recording
from holdfast.sensors.types import Array, Integers
from holdfast.training.evaluation import compute_decisions

Codes = npt.NDArray[np.int8]


def with_threshold(model: Model, threshold: float) -> Model:
    """Return the model with another threshold of the probability for all fingers."""
    fingers = {
        name: msgspec.structs.replace(
            part, classifier=msgspec.structs.replace(part.classifier, threshold=threshold)
        )
        for name, part in model.fingers.items()
    }
    return msgspec.structs.replace(model, fingers=fingers)


@dataclass(frozen=True)
class Replay:
    """Decisions about one recording, for any threshold.

    Attributes:
        raw: decisions without debouncing, hold and hysteresis.
        debounce: of the model.
        period: of the samples [s].
        n_model_fingers: number of fingers of the model.
    """

    raw: Decisions
    debounce: Debounce
    period: float
    n_model_fingers: int

    @classmethod
    def of(cls, model: Model, recording: Recording) -> "Replay":
        """Compute the probabilities of a recording.

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        raw = compute_decisions(msgspec.structs.replace(model, debounce=Debounce()), recording)
        n_fingers = len(raw.fingers) if "*" in model.fingers else len(model.fingers)
        period = 1 / (model.rate or recording.rate)
        return cls(raw, model.debounce, period, n_fingers)

    def hand(self, threshold: float) -> FingerDecisions:
        """Return the decisions about the hand at a threshold."""
        fingers = {
            name: replace(finger, states=self._states(finger, threshold))
            for name, finger in self.raw.fingers.items()
        }
        return hand_decisions(fingers, self.n_model_fingers)

    def _states(self, finger: FingerDecisions, threshold: float) -> Codes:
        out = np.zeros(len(finger.times), dtype=np.int8)
        own = self.debounce
        memory = new_decision_memory(1)
        limits = np.array([threshold, own.hysteresis, own.hold, own.min_duration, self.period])
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
        raw: (n,) states without debouncing; UNKNOWN and NO_CONTACT do not depend on the threshold.
        limits: threshold, hysteresis, hold [s], minimum duration [s] and period [s].
        codes: as in `DecisionMemory`; is changed.
        decided: as in `DecisionMemory`; is changed.
        out: (n,) is filled.
    """
    threshold, hysteresis, hold, min_duration, period = limits
    for k in range(len(times)):
        if raw[k] == UNKNOWN:
            codes[STATE] = codes[CANDIDATE] = UNKNOWN
            decided[LAST_UNSTABLE] = np.nan
        else:
            state = NO_CONTACT
            if raw[k] != NO_CONTACT:
                state = classify_contact(probability[k], threshold, hysteresis, codes[STATE])
                state = hold_unstable(state, decided, hold, times[k], period)
            debounce(codes, decided, state, min_duration, times[k], period)
        out[k] = codes[STATE]


def alarms(hand: FingerDecisions) -> AlarmMatch:
    """Return the events and alarms of the hand; none without labels."""
    return match_decisions(hand) if hand.labels.any() else AlarmMatch((), (), 0.0)


def stable_counts(hand: FingerDecisions) -> Mapping[str, int]:
    """Return the number of samples labelled STABLE, and of these decided STABLE."""
    labelled = hand.labels == STABLE
    return {
        "labelled": int(labelled.sum()),
        "decided": int((labelled & (hand.states == STABLE)).sum()),
    }
