"""Estimates of every compared method on recordings of a real hand, sample by sample.

Each recording is estimated by a fit that did not use it. The estimates are kept as they are, so
that all methods can be scored on the samples at which every one of them has an estimate.
"""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import STABLE, UNKNOWN, UNSTABLE, Cause
from holdfast.metrics.decisions import Codes
from holdfast.metrics.masks import Mask
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.sensors.types import Array
from holdfast_lab.study.evaluation.evaluate_method import (
    HOLD_TIME,
    EvaluationEffort,
    EvaluationJob,
    score_splits,
)
from holdfast_lab.study.evaluation.recording_features import label_hand
from holdfast_lab.study.methods import HAND
from holdfast_lab.study.plan import Corpus

MAX_REAL_FOLDS = 20
"""Maximum number of folds. With more recordings, a fold leaves several out."""


class Column(msgspec.Struct, frozen=True):
    """A one-dimensional array that can be stored.

    Example:
        >>> Column.of(np.array([0.5, np.nan])).array.tolist()
        [0.5, nan]
    """

    dtype: str
    data: bytes

    @classmethod
    def of(cls, array: npt.NDArray[Any]) -> "Column":
        """Return the column of an array."""
        return cls(array.dtype.str, array.tobytes())

    @property
    def array(self) -> npt.NDArray[Any]:
        """The (n,) array, read-only."""
        return np.frombuffer(self.data, dtype=self.dtype)


class UnitEstimates(msgspec.Struct, frozen=True):
    """Estimates of a finger, or of the hand, one for each of its samples.

    Attributes:
        probability: of stability; NaN where it is not known.
        states: codes of the states.
    """

    probability: Column
    states: Column


class RecordingEstimates(msgspec.Struct, frozen=True):
    """Estimates of one method about one recording.

    Attributes:
        name: of the recording.
        fingers: at the times of each finger; none of a whole-hand method.
        hand: at every time of any finger.
        alarm_states: codes of the states of the hand whose changes are the alarms.
        known: whether there is an estimate of every finger, at the times of the hand.
    """

    name: str
    fingers: dict[str, UnitEstimates]
    hand: UnitEstimates
    alarm_states: Column
    known: Column


class UnitLabels(msgspec.Struct, frozen=True):
    """Labels of a finger, or of the hand, one for each of its samples.

    Attributes:
        times: [s].
        codes: of the labelled states.
        slip: whether the label is slip.
    """

    times: Column
    codes: Column
    slip: Column


class RecordingLabels(msgspec.Struct, frozen=True):
    """Labels of one recording: of its fingers, and of the hand at every time of any finger."""

    name: str
    fingers: dict[str, UnitLabels]
    hand: UnitLabels


def recording_labels(real: Corpus) -> list[RecordingLabels]:
    """Return the labels of every recording that has one of the fingers of the corpus."""
    labels = []
    for recording in load_fingers(real):
        times, codes, slip = {}, {}, {}
        for name, module in recording.modules.items():
            times[name] = module.times
            codes[name] = label_states(module.labels, module.times)
            # An unstable label without a cause counts as slip.
            slips = [label for label in module.labels if label.cause in (Cause.SLIP, None)]
            slip[name] = np.asarray(label_states(slips, module.times) == UNSTABLE)
        hand = label_hand(times, codes)
        # The hand slips where a finger does: the rule of the hand, with slip as the only cause.
        sliding = {name: np.where(mask, UNSTABLE, STABLE) for name, mask in slip.items()}
        hand_slip = label_hand(times, sliding).labels == UNSTABLE
        fingers = {name: _unit_labels(times[name], codes[name], slip[name]) for name in times}
        of_hand = _unit_labels(hand.times, hand.labels, hand_slip)
        labels.append(RecordingLabels(recording.name, fingers, of_hand))
    return labels


def load_fingers(real: Corpus) -> list[Recording]:
    """Return the recordings of a corpus with its fingers only.

    A recording without any of these fingers is left out.
    """
    shortened = []
    for recording in real.load():
        modules: dict[str, Tactile] = {
            name: recording.modules[name]
            for name in real.fingers
            if name in recording.modules and recording.modules[name].n_samples
        }
        if modules:
            shortened.append(replace(recording, modules=modules))
    return shortened


def n_folds(real: Corpus) -> int:
    """Return the number of folds: one for each recording, but at most `MAX_REAL_FOLDS`."""
    return min(len(real.recordings), MAX_REAL_FOLDS)


def method_estimates(method: str, real: Corpus, seed: int) -> list[RecordingEstimates]:
    """Return the estimates of a method about each recording, by a fit without that recording.

    The method decides at its own threshold. Its alarms are those of states that are held for
    `HOLD_TIME`, so that one slip is one alarm.

    Args:
        method: its name.
        real: the recordings.
        seed: of all random numbers.
    """
    effort = EvaluationEffort(folds=n_folds(real), inner=1)
    job = EvaluationJob(method, real, ("recording",), effort=effort, seed=seed)
    estimates = []
    for scored in (
        scored_recording for _, split in score_splits(job) for scored_recording in split
    ):
        recording, hand = scored.recording, scored.hand
        fingers = {
            name: unit_estimates(f.stable_probability, f.states)
            for name, f in scored.decide(recording.labels).fingers.items()
            if name != HAND
        }
        estimates.append(
            RecordingEstimates(
                recording.name,
                fingers,
                unit_estimates(hand.probability, hand.states()),
                Column.of(hand.hold(HOLD_TIME).states()),
                Column.of(hand.known),
            )
        )
    return estimates


def unit_estimates(probability: Array, states: Codes) -> UnitEstimates:
    """Return the estimates of a finger or a hand from (n,) arrays."""
    return UnitEstimates(Column.of(probability), Column.of(states))


def _unit_labels(times: Array, codes: Codes, slip: Mask) -> UnitLabels:
    return UnitLabels(Column.of(times), Column.of(codes), Column.of(slip & (codes != UNKNOWN)))
