"""Evaluation of models: the decisions of a model beside the labels, and their metrics."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import SLIP_CODE, STABLE, UNKNOWN, Fault
from holdfast.detection import Model, detect
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
from holdfast.metrics.slip_truth import SlipDecisions, slip_truth, truth_without
from holdfast.metrics.truth_labels import (
    LabelRule,
    labels_by_rule,
    labels_by_truth,
    without_margin,
)
from holdfast.parallel import Engine
from holdfast.recordings import Recording, label_states
from holdfast.sensors.types import Integers
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

    If the recording has a truth, or labels by a rule, the decisions have exact labels too, without
    a margin.

    Raises:
        RecordingError: two fingers have the same readings.
        ModelError: the recording has other fingers or sensors.
    """
    return compute_decisions_and_tare(model, recording)[0]


def compute_decisions_and_tare(model: Model, recording: Recording) -> tuple[Decisions, bool]:
    """Return the decisions as `compute_decisions`, and whether the tare was taken under load.

    Raises:
        ModelError: the recording has other fingers or sensors.
    """
    recording.check_modules_differ()
    detection = detect(model, recording)
    loaded = any((trace.faults & TARE_LOADED_BIT).any() for trace in detection.fingers.values())
    by_truth = labels_by_truth(recording, LabelRule(margin=0.0))
    # The truth outranks labels. Labels by a rule leave out a margin about each change; the exact
    # ones have it, so that an onset is where the rule saw it.
    labels = {name: module.labels for name, module in recording.modules.items()} | by_truth
    by_rule = any(map(labels_by_rule, labels.values()))
    exact = {name: without_margin(x) for name, x in labels.items()} if by_rule else by_truth
    fingers = {}
    for name, trace in detection.fingers.items():
        head, slip = model.finger(name).slip, None
        if head is not None and trace.slip_probability is not None:
            # Quiet hold, in which nothing may be reported, is where the true label is STABLE.
            spans = by_truth.get(name)
            quiet = None if spans is None else label_states(spans, trace.times) == STABLE
            slip = SlipDecisions(
                trace.times,
                trace.slip_probability,
                trace.cause == SLIP_CODE,
                head.hold,
                slip_truth(recording, name, trace.times, quiet),
            )
        fingers[name] = FingerDecisions(
            times=trace.times,
            labels=label_states(recording.modules[name].labels, trace.times),
            states=trace.state,
            stable_probability=trace.stable_probability,
            exact_labels=label_states(exact[name], trace.times) if name in exact else None,
            slip=slip,
            onsets="rule" if by_rule else "truth",
            dead=trace.is_dead,
        )
    hand = replace(hand_decisions(fingers, len(model.fingers)), states=detection.hand)
    return Decisions(recording.name, fingers, hand), loaded


def was_trained_on(model: Model, recording: Recording | ScannedRecording) -> bool:
    """Return whether a model was trained on a recording, a part of it, or what it is a part of."""
    training = model.training
    return training is not None and (
        _is_among(recording, [training.recordings]) or training.has_any(recording.blocks)
    )


def was_tuned_on(model: Model, recording: Recording) -> bool:
    """Return whether a threshold of a model was chosen on a recording, or a copy of it."""
    heads = [head for part in model.fingers.values() for head in part.heads]
    chosen = [head.choice.recordings for head in heads if head.choice is not None]
    return _is_among(recording, chosen)


def _is_among(recording: Recording | ScannedRecording, models: Iterable[Mapping[str, str]]) -> bool:
    """Return whether one of the digests is known; older models have those with the times."""
    digests = {recording.digest, recording.readings_digest}
    return any(not digests.isdisjoint(recordings.values()) for recordings in models)


@dataclass(frozen=True)
class Evaluation:
    """Metrics of a model, and what they depend on.

    Attributes:
        metrics: of all recordings.
        unseen: of the recordings that the model was not trained on, each once.
        trained_on: names of the recordings that the model was trained on.
        copies: of each recording whose readings are those of an earlier one: its name, and that
            of the other.
        in_sample: whether a threshold of the model was chosen on one that is unseen.
        reports_slips: whether the model ever reports a slip.
        tares: recordings whose tare was taken under load, of those that are unseen.
        decisions: about each recording, if they are kept.
    """

    metrics: Metrics
    unseen: Metrics
    trained_on: list[str]
    copies: list[tuple[str, str]]
    in_sample: bool
    reports_slips: bool
    tares: LoadedTares
    decisions: list[Decisions]

    @property
    def verdict(self) -> str | None:
        """The verdict on the model; None if it was trained on all labelled recordings."""
        n, n_unseen = len(self.metrics.recordings), len(self.unseen.recordings)
        if self.trained_on and self.unseen.pooled.n + self.unseen.pooled.n_undecided == 0:
            return None
        sentence = verdict(
            self.unseen, self.tares, in_sample=self.in_sample, reports_slips=self.reports_slips
        )
        others = ["the model was trained on the others"] * bool(self.trained_on)
        others += ["copies count once"] * bool(self.copies)
        note = f" From {n_unseen} of {n} recordings: {', '.join(others)}." if others else ""
        return sentence + note


def evaluate(
    model: Model | str | Path,
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
    model = Model.of(model)
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
    parts = ((OneRecording(recordings, index),) for index in range(len(recordings)))
    trained_on: list[str] = []
    tares: list[bool] = []
    kept: list[Decisions] = []
    copies: list[tuple[str, str]] = []
    originals: dict[str, str] = {}
    in_sample = False
    total, unseen = ResultTotal(), ResultTotal()
    evaluated = engine.map_ordered(_evaluate_part, parts, shared=(model, keep))
    for results, origin, decisions in progress(evaluated, "evaluating", len(recordings)):
        name = results.metrics.name
        total.add(results)
        kept.extend(decisions)
        is_copy = origin.digest in originals
        if is_copy:
            copies.append((name, originals[origin.digest]))
        originals.setdefault(origin.digest, name)
        # All figures have every recording; the verdict rests on what is new to the model, once.
        if origin.trained_on:
            trained_on.append(name)
        elif not is_copy:
            unseen.add(results)
            tares.append(origin.loaded)
            in_sample |= origin.tuned_on
    metrics = total.metrics(seed=seed)
    return Evaluation(
        metrics,
        unseen.metrics(seed=seed) if trained_on or copies else metrics,
        trained_on,
        copies,
        in_sample,
        model.reports_slips,
        LoadedTares(sum(tares), len(tares)),
        kept,
    )


def _evaluate_part(
    model: Model, keep: bool, part: Sequence[Recording]
) -> tuple[RecordingResults, "_Origin", list[Decisions]]:
    """Return results, where the recording comes from, and the decisions if they are kept."""
    (recording,) = part
    decisions, loaded = compute_decisions_and_tare(model, recording)
    trained, tuned_on = was_trained_on(model, recording), was_tuned_on(model, recording)
    origin = _Origin(recording.readings_digest, loaded, trained, tuned_on)
    return score_recording(decisions), origin, [decisions] if keep else []


class _Origin(NamedTuple):
    """Digest of a recording, whether its tare is loaded, and what the model took from it."""

    digest: str
    loaded: bool
    trained_on: bool
    tuned_on: bool


def _combined_slips(
    decisions: Sequence[SlipDecisions | None], unit: Integers
) -> SlipDecisions | None:
    """Return the decisions about slips of several models, each about its own samples.

    Samples of unit -1 have no decision, and no truth: models were trained beside them.
    """
    slips = [slip for slip in decisions if slip is not None]
    if not slips or len(slips) < len(decisions):
        return None
    every, left_out, truth = np.arange(len(unit)), unit < 0, slips[0].truth
    probability = np.stack([slip.probability for slip in slips])[unit, every]
    return replace(
        slips[0],
        probability=np.where(left_out, np.nan, probability),
        raised=np.stack([slip.raised for slip in slips])[unit, every] & ~left_out,
        truth=None if truth is None else truth_without(slips[0].times, truth, left_out),
    )


def combine_decisions(
    decisions: Sequence[Decisions], units_of: Callable[[int], Integers], n_model_fingers: int
) -> Decisions:
    """Combine the decisions of several models about one recording.

    A sample is decided by the model whose index is the unit of the sample.

    Args:
        decisions: of each model, about the same recording.
        units_of: returns the unit of each of n samples; a sample of unit -1 loses its label.
        n_model_fingers: number of fingers of the models.
    """
    fingers = {}
    for name, first in decisions[0].fingers.items():
        # Row by row of a stack (n_models, n): the model of its unit. Models were trained beside
        # samples of unit -1, so these lose their labels, and what is picked for them never counts.
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
