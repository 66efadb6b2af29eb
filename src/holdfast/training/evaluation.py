"""Evaluation of models: the decisions of a model beside the labels, and their metrics."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from holdfast.contact import SIGNAL_FAULTS, UNKNOWN, Fault
from holdfast.detector import detect
from holdfast.metrics import Decisions, FingerDecisions, Metrics, summarise
from holdfast.metrics.decisions import hand_decisions
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.model import Model
from holdfast.recordings import Recording, label_states
from holdfast.training.splits import Integers

TARE_LOADED = 1 << SIGNAL_FAULTS.index(Fault.TARE_LOADED)
"""Bit of the fault of a tare that was taken under load."""


def compute_decisions(model: Model, recording: Recording) -> Decisions:
    """Return the decisions of a model about a recording, with the labels.

    If the recording has a truth, the decisions have exact labels too, without a margin.

    Raises:
        ModelError: the recording has other fingers or sensors.
    """
    return judge(model, recording)[0]


def judge(model: Model, recording: Recording) -> tuple[Decisions, bool]:
    """Return the decisions as `compute_decisions`, and whether the tare was taken under load.

    Raises:
        ModelError: the recording has other fingers or sensors.
    """
    detection = detect(model, recording)
    loaded = any((trace.faults & TARE_LOADED).any() for trace in detection.fingers.values())
    exact = labels_by_truth(recording, LabelRule(margin=0.0))
    fingers = {
        name: FingerDecisions(
            times=trace.times,
            labels=label_states(recording.modules[name].labels, trace.times),
            states=trace.state,
            stable_probability=trace.stable_probability,
            exact_labels=label_states(exact[name], trace.times) if name in exact else None,
        )
        for name, trace in detection.fingers.items()
    }
    hand = replace(hand_decisions(fingers, len(model.fingers)), states=detection.hand)
    return Decisions(recording.name, fingers, hand), loaded


def evaluate(model: Model, recordings: Iterable[Recording], seed: int = 0) -> Metrics:
    """Compute the metrics of a model on recordings, which are read one at a time.

    Args:
        model: to evaluate.
        recordings: labelled.
        seed: of the bootstrap.

    Raises:
        ModelError: a recording has other fingers or sensors.
    """
    return summarise((compute_decisions(model, recording) for recording in recordings), seed=seed)


def combine_decisions(
    decisions: Sequence[Decisions], units_of: Callable[[int], Integers], n_model_fingers: int
) -> Decisions:
    """Combine the decisions of several models about one recording.

    The decision about a sample is that of the model whose index is the unit of the sample.

    Args:
        decisions: of each model, about the same recording.
        units_of: returns the unit of each of n samples; a sample of unit -1 loses its label.
        n_model_fingers: number of fingers of the models.
    """
    fingers = {}
    for name, first in decisions[0].fingers.items():
        every = np.arange(len(first.times))
        unit = units_of(len(every))
        states = np.stack([each.fingers[name].states for each in decisions])
        probabilities = np.stack([each.fingers[name].stable_probability for each in decisions])
        fingers[name] = replace(
            first,
            labels=np.where(unit < 0, UNKNOWN, first.labels),
            exact_labels=(
                None
                if first.exact_labels is None
                else np.where(unit < 0, UNKNOWN, first.exact_labels)
            ),
            states=states[unit, every],
            stable_probability=probabilities[unit, every],
        )
    return Decisions.of(decisions[0].name, fingers, n_model_fingers)
