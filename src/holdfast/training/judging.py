"""Recordings beside their labels: what a model says of them, as the metrics take it."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from holdfast.detector import detect
from holdfast.metrics import Decisions, FingerDecisions, Metrics, summarise
from holdfast.metrics.decisions import hand_decisions
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast.training.splits import Integers


def decisions_of(model: Model, recording: Recording) -> Decisions:
    """What the model decides about a recording, beside the labels.

    Raises:
        ModelError: the recording has other fingers or sensors.
    """
    detection = detect(model, recording)
    fingers = {
        name: FingerDecisions(
            times=trace.times,
            labels=label_states(recording.modules[name].labels, trace.times),
            states=trace.state,
            stable_probability=trace.stable_probability,
        )
        for name, trace in detection.fingers.items()
    }
    hand = replace(hand_decisions(fingers, len(model.fingers)), states=detection.hand)
    return Decisions(recording.name, fingers, hand)


def evaluate(model: Model, recordings: Iterable[Recording], seed: int = 0) -> Metrics:
    """The metrics of a model on recordings, taken one at a time.

    Args:
        model: that judges.
        recordings: labelled.
        seed: of the bootstrap.

    Raises:
        ModelError: a recording has other fingers or sensors.
    """
    return summarise((decisions_of(model, recording) for recording in recordings), seed=seed)


def pick(
    judged: Sequence[Decisions], units_of: Callable[[int], Integers], n_model_fingers: int
) -> Decisions:
    """One recording's decisions, each sample's from the judge that its unit names.

    Args:
        judged: the same recording by several models.
        units_of: the unit of each of n samples.
        n_model_fingers: how many fingers the models have.
    """
    fingers = {}
    for name, first in judged[0].fingers.items():
        every = np.arange(len(first.times))
        unit = units_of(len(every))
        states = np.stack([each.fingers[name].states for each in judged])
        probabilities = np.stack([each.fingers[name].stable_probability for each in judged])
        fingers[name] = replace(
            first, states=states[unit, every], stable_probability=probabilities[unit, every]
        )
    return Decisions.of(judged[0].name, fingers, n_model_fingers)
