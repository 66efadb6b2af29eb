"""Estimates of `builtin:any` on recordings of a real hand: as it ships, adapted, and from nothing.

Features, tare, contact threshold and hold time are those of the model file.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from holdfast.contact import STABLE, TIME_TOLERANCE, UNKNOWN, UNSTABLE, enough_contacts
from holdfast.detection import Model
from holdfast.errors import ModelError, TrainingError
from holdfast.metrics import FingerDecisions, hand_decisions
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast.training import Setting, compute_decisions, train
from holdfast.training.setting import Split
from holdfast_lab.study.comparison.real_estimates import (
    MAX_REAL_FOLDS,
    Column,
    RecordingEstimates,
    load_fingers,
    n_folds,
    unit_estimates,
)
from holdfast_lab.study.evaluation.evaluate_method import held_out_folds
from holdfast_lab.study.plan import Corpus

SHIPPED = "builtin:any"
"""The model that ships, which was never trained on a real hand."""

Making = Literal["untouched", "adapted to one", "adapted to all", "from nothing"]
"""How the model is made: as it ships; adapted to one of the other recordings, or to all of them;
with its features, but fitted to all other recordings without its weights."""


def model_estimates(making: Making, real: Corpus, seed: int) -> list[RecordingEstimates]:
    """Return the estimates of the model about each recording, made without that recording.

    Adapting is `holdfast train --init builtin:any`. Where the other recordings cannot adapt the
    model, because a class is missing, it stays as it ships. A model from nothing has the reference
    parameters, as the methods of the study have.

    Args:
        making: how the model is made.
        real: the recordings.
        seed: of the folds, and of the choice of one of the other recordings.
    """
    recordings = load_fingers(real)
    estimates: dict[int, RecordingEstimates] = {}
    # The folds of all other methods.
    named = [recording.metadata.get("object") for recording in recordings]
    objects = [None if name is None else str(name) for name in named]
    for left_out in held_out_folds(objects, "recording", n_folds(real), seed):
        others = [recording for index, recording in enumerate(recordings) if index not in left_out]
        # Another draw in each fold, the same in every run.
        model = model_made(making, others, seed + min(left_out))
        estimates |= {index: _estimates(model, recordings[index]) for index in left_out}
    return [estimates[index] for index in sorted(estimates)]


def model_made(making: Making, others: Sequence[Recording], seed: int) -> Model | None:
    """Return the model for a fold; None if it cannot be fitted from nothing."""
    shipped = Model.load(SHIPPED)
    if making == "untouched":
        return shipped
    adapting = Setting.adapting(shipped)
    if making == "from nothing":
        return trained_model(others, replace(adapting, init=None, trials=0))
    if making == "adapted to one":
        # Drawn from those that have both classes on every finger: no other can adapt the model.
        able = []
        for other in others:
            codes = [module.label_states for module in other.modules.values()]
            if all(len(np.unique(of_finger[of_finger != UNKNOWN] == STABLE)) == 2
                   for of_finger in codes):  # fmt: skip
                able.append(other)
        others = [able[np.random.default_rng(seed).integers(len(able))]] if able else []
    return trained_model(others, adapting) or shipped


def trained_model(recordings: Sequence[Recording], setting: Setting) -> Model | None:
    """Return the model that `holdfast train` makes; None if it cannot with these recordings.

    Its cross-validation is by recording where that is possible and fast. It is not used here.
    """
    split: Split = "recording" if 2 <= len(recordings) <= MAX_REAL_FOLDS else "random"
    try:
        return train(recordings, replace(setting, split=split)).model
    except (ModelError, TrainingError):
        return None


def _estimates(model: Model | None, recording: Recording) -> RecordingEstimates:
    """Return the estimates of a model; all are unknown if it is not for such a recording."""
    try:
        decided = {} if model is None else compute_decisions(model, recording).fingers
    except ModelError:
        decided = {}
    fingers = {n: latest_decisions(decided.get(n), m.times) for n, m in recording.modules.items()}
    hand = hand_decisions(fingers, len(fingers))
    at_hand = [latest_decisions(finger, hand.times) for finger in fingers.values()]
    return RecordingEstimates(
        recording.name,
        {name: unit_estimates(f.stable_probability, f.states) for name, f in fingers.items()},
        unit_estimates(smallest_probability(at_hand), hand.states),
        Column.of(hand.states),
        Column.of(np.all([unit.states != UNKNOWN for unit in at_hand], axis=0)),
    )


def latest_decisions(decided: FingerDecisions | None, times: Array) -> FingerDecisions:
    """Return the latest decision at each time, without labels; UNKNOWN before the first."""
    unlabelled = np.full(len(times), UNKNOWN, dtype=np.int8)
    if decided is None:
        return FingerDecisions(times, unlabelled, unlabelled, np.full(len(times), np.nan))
    at = np.searchsorted(decided.times, times + TIME_TOLERANCE, side="right")
    # Position 0 stands for the times before the first decision.
    states = np.append(np.int8(UNKNOWN), decided.states)[at]
    probability = np.append(np.nan, decided.stable_probability)[at]
    return FingerDecisions(times, unlabelled, states, probability)


def smallest_probability(fingers: Sequence[FingerDecisions]) -> Array:
    """Return the smallest probability of the fingers in contact.

    If too few are in contact to hold an object, it is the smallest of all fingers: a finger that
    is called NO_CONTACT keeps its probability, as in all metrics.
    """
    probability = np.array([finger.stable_probability for finger in fingers])
    states = np.array([finger.states for finger in fingers])
    touching = (states == STABLE) | (states == UNSTABLE)
    grasped = enough_contacts(touching.sum(axis=0), len(fingers))
    counted = np.where(grasped, touching, states != UNKNOWN)
    return np.asarray(np.where(counted, probability, 1.0).min(axis=0))
