"""Evaluation of models: the decisions of a model beside the labels, and their metrics."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from holdfast.classifiers.cause import SLIP_CODE
from holdfast.contact import STABLE, UNKNOWN, Fault
from holdfast.detector import FingerTrace, detect
from holdfast.metrics import (
    Decisions,
    FingerDecisions,
    Metrics,
    RecordingResults,
    ResultTotal,
    score_recording,
    summarise,
)
from holdfast.metrics.decisions import hand_decisions
from holdfast.metrics.slip_truth import NOT_HELD, SlipDecisions, SlipTruth, slip_truth
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.model import Model
from holdfast.parallel import Engine
from holdfast.recordings import Label, Recording, label_states
from holdfast.sensors.types import Array, Flags, Integers
from holdfast.training.dataset_scan import (
    OneRecording,
    Progress,
    ScannedRecording,
    show_nothing,
)
from holdfast.training.verdict import LoadedTares, verdict

TARE_LOADED_BIT = 1 << tuple(Fault).index(Fault.TARE_LOADED)
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
    loaded = any((trace.faults & TARE_LOADED_BIT).any() for trace in detection.fingers.values())
    exact = labels_by_truth(recording, LabelRule(margin=0.0))
    fingers = {
        name: FingerDecisions(
            times=trace.times,
            labels=label_states(recording.modules[name].labels, trace.times),
            states=trace.state,
            stable_probability=trace.stable_probability,
            exact_labels=label_states(exact[name], trace.times) if name in exact else None,
            slip=_slip_decisions(model, recording, name, trace, exact.get(name)),
        )
        for name, trace in detection.fingers.items()
    }
    hand = replace(hand_decisions(fingers, len(model.fingers)), states=detection.hand)
    return Decisions(recording.name, fingers, hand), loaded


def _slip_decisions(
    model: Model,
    recording: Recording,
    finger: str,
    trace: FingerTrace,
    exact: tuple[Label, ...] | None,
) -> SlipDecisions | None:
    """Return the decisions about the slips of a finger; None without a slip rule."""
    rule = model.finger(finger).slip
    if rule is None or trace.slip_probability is None:
        return None
    quiet = None if exact is None else label_states(exact, trace.times) == STABLE
    return SlipDecisions(
        trace.times,
        trace.slip_probability,
        trace.cause == SLIP_CODE,
        rule.hold,
        slip_truth(recording, finger, trace.times, quiet),
    )


def was_trained_on(model: Model, recording: Recording | ScannedRecording) -> bool:
    """Return whether a model was trained on a recording, by the digest of its samples."""
    return model.training is not None and recording.digest in model.training.recordings.values()


@dataclass(frozen=True)
class Evaluation:
    """Metrics of a model, and what they depend on.

    Attributes:
        metrics: of all recordings.
        unseen: of the recordings that the model was not trained on, without intervals where
            there are others.
        trained_on: names of the recordings that the model was trained on.
        tares: recordings whose tare was taken under load, of those that are unseen.
        decisions: about each recording, if they are kept.
    """

    metrics: Metrics
    unseen: Metrics
    trained_on: list[str]
    tares: LoadedTares
    decisions: list[Decisions]

    @property
    def verdict(self) -> str | None:
        """What the model is good for; None if it was trained on all labelled recordings."""
        n, n_unseen = len(self.metrics.recordings), len(self.unseen.recordings)
        if n_unseen == n:
            return verdict(self.unseen, self.tares)
        if self.unseen.pooled.n + self.unseen.pooled.n_undecided == 0:
            return None
        sentence = verdict(self.unseen, self.tares)
        return f"{sentence} From {n_unseen} of {n} recordings: the model was trained on the others."


def evaluate(
    model: Model,
    recordings: Iterable[Recording],
    seed: int = 0,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
) -> Metrics:
    """Compute the metrics of a model on recordings, which are read one at a time.

    Args:
        model: to evaluate.
        recordings: labelled; of an iterator, they are evaluated in this process.
        seed: of the bootstrap.
        engine: that reads the recordings. On a cluster, all machines need the recordings at the
            same paths.

    Raises:
        ModelError: a recording has other fingers or sensors.
        EngineError: the engine cannot be used.
    """
    if isinstance(recordings, Sequence):
        return evaluate_recordings(model, recordings, seed, engine).metrics
    return summarise((compute_decisions(model, recording) for recording in recordings), seed=seed)


def evaluate_recordings(
    model: Model,
    recordings: Sequence[Recording],
    seed: int = 0,
    engine: Engine = Engine(),  # noqa: B008 (a tuple: it cannot change)
    *,
    progress: Progress = show_nothing,
    keep: bool = False,
) -> Evaluation:
    """Evaluate a model as `evaluate`, and return what the metrics depend on.

    Args:
        model: as in `evaluate`.
        recordings: as in `evaluate`.
        seed: as in `evaluate`.
        engine: as in `evaluate`.
        progress: iterates over the recordings.
        keep: keep the decisions about every sample, for a figure.

    Raises:
        ModelError: a recording has other fingers or sensors.
        EngineError: the engine cannot be used.
    """
    parts = ((OneRecording(recordings, place),) for place in range(len(recordings)))
    trained_on: list[str] = []
    tares: list[bool] = []
    kept: list[Decisions] = []
    total, unseen = ResultTotal(), ResultTotal(intervals=False)
    evaluated = engine.map_ordered(_evaluate_part, parts, shared=(model, keep))
    for results, loaded, known, decisions in progress(evaluated, "evaluating", len(recordings)):
        total.add(results)
        kept.extend(decisions)
        if known:
            trained_on.append(results.metrics.name)
        else:
            unseen.add(results)
            tares.append(loaded)
    metrics = total.metrics(seed=seed)
    return Evaluation(
        metrics,
        unseen.metrics() if trained_on else metrics,
        trained_on,
        LoadedTares(sum(tares), len(tares)),
        kept,
    )


def _evaluate_part(
    model: Model, keep: bool, part: Sequence[Recording]
) -> tuple[RecordingResults, bool, bool, list[Decisions]]:
    """Return results, loaded tare, whether it was trained on, and the decisions if kept."""
    (recording,) = part
    decisions, loaded = judge(model, recording)
    known = was_trained_on(model, recording)
    return score_recording(decisions), loaded, known, [decisions] if keep else []


def _combined_slips(
    decisions: Sequence[SlipDecisions | None], unit: Integers
) -> SlipDecisions | None:
    """Return the decisions about slips of several models, each about its own samples.

    Samples of unit -1 have no decision, and no truth: models were trained beside them.
    """
    known = [slip for slip in decisions if slip is not None]
    if not known or len(known) < len(decisions):
        return None
    every, left_out = np.arange(len(unit)), unit < 0
    probability = np.stack([slip.probability for slip in known])[unit, every]
    return replace(
        known[0],
        probability=np.where(left_out, np.nan, probability),
        raised=np.stack([slip.raised for slip in known])[unit, every] & ~left_out,
        truth=_truth_without(known[0].times, known[0].truth, left_out),
    )


def _truth_without(times: Array, truth: SlipTruth | None, left_out: Flags) -> SlipTruth | None:
    """Return the truth without some samples, and without the slips that begin in them."""
    if truth is None or not left_out.any():
        return truth
    onsets = np.searchsorted(times, [slip.onset for slip in truth.slips]).clip(max=len(times) - 1)
    return replace(
        truth,
        codes=np.where(left_out, NOT_HELD, truth.codes).astype(np.int8),
        quiet=truth.quiet & ~left_out,
        slips=tuple(slip for slip, k in zip(truth.slips, onsets, strict=True) if not left_out[k]),
    )


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
        states = np.stack([decision.fingers[name].states for decision in decisions])
        probabilities = np.stack(
            [decision.fingers[name].stable_probability for decision in decisions]
        )
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
            slip=_combined_slips([decision.fingers[name].slip for decision in decisions], unit),
        )
    return Decisions.of(decisions[0].name, fingers, n_model_fingers)
