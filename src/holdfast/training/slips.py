"""Training of slip rules: samples that slide or hold still, and the threshold of the decision."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat

import msgspec
import numpy as np

from holdfast.classifiers.logreg import LogisticRegression
from holdfast.classifiers.slip import SlipRule, SlipThresholds
from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.features.stream import extract
from holdfast.metrics.slip_thresholds import (
    THRESHOLDS,
    Curve,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_intervals,
    slip_summary,
    total_curve,
)
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.metrics.slips import SlipCounts, found_shares
from holdfast.model import ANY_FINGER, Model
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.training.dataset_scan import OneRecording
from holdfast.training.progress import Progress
from holdfast.training.training_samples import (
    FingerSamples,
    RecordingSamples,
    SamplesPlan,
    concatenate_parts,
    labelled_samples,
    pool_fingers,
    resample_if_needed,
    sensors_of,
    stream_plan,
    usable_rows,
)

SLIP_SMOOTHING, SLIP_HOLD = 0.02, 0.1
"""Smoothing and hold time of the slip rules that `holdfast train` writes [s]."""
SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which the threshold is set."""
MIN_SLIDING_SAMPLES = 50
"""Fewer sliding samples train no slip rule."""


@dataclass(frozen=True)
class SlipSamples:
    """Training samples of a slip rule.

    Attributes:
        own: of the finger; class 1 slides. All that slide are kept, and some that hold still.
        n_still: number of samples that hold still, before thinning.
    """

    own: FingerSamples
    n_still: int

    def fit(self, held: Collection[int]) -> SlipRule | None:
        """Fit a rule to the samples that are not in held units, with a threshold of 0.5.

        Returns:
            The rule; None with too few sliding samples, or none that hold still.
        """
        samples = self.own.without(held)
        if samples.one_class or samples.stable.sum() < MIN_SLIDING_SAMPLES:
            return None
        recipe = LogisticRegression()
        fitted = recipe.fit(samples, recipe.reference, 0)
        kept = np.count_nonzero(~self.own.samples.stable)
        thinning = np.log(self.n_still / kept)  # odds of sliding fall by the samples left out
        classifier = msgspec.structs.replace(
            fitted, offset=fitted.offset - float(thinning), threshold=0.5
        )
        return SlipRule(classifier, SLIP_SMOOTHING, SLIP_HOLD)


def gather_slip_samples(
    recordings: Sequence[Recording], plan: SamplesPlan, engine: Engine, progress: Progress
) -> dict[str, SlipSamples]:
    """Return the training samples of the slip rule of every finger, or of all under `"*"`.

    Args:
        recordings: the same that were scanned.
        plan: of the dataset.
        engine: that reads the recordings.
        progress: iterates over the recordings.

    Returns:
        By finger; none without a truth or labels of slips.
    """
    parts: dict[str, dict[int, RecordingSamples]] = {finger: {} for finger in plan.scan.sensors}
    calls = ((place, OneRecording(recordings, place)) for place in plan.places)
    read = engine.map_ordered(_samples_of_part, calls, shared=(plan,))
    for place, fingers in zip(plan.places, progress(read, "slips", len(plan.places)), strict=True):
        for finger, samples in fingers.items():
            parts[finger][place] = samples
    n = len(plan.scan.recordings)
    by_finger = {f: concatenate_parts(part, n) for f, part in parts.items() if part}
    if plan.setting.is_shared and by_finger:
        by_finger = {ANY_FINGER: pool_fingers(by_finger)}
    return {
        finger: SlipSamples(own, own.n_usable - int(own.samples.stable.sum()))
        for finger, own in by_finger.items()
        if own.samples.stable.any()
    }


def _samples_of_part(
    plan: SamplesPlan, place: int, part: Sequence[Recording]
) -> dict[str, RecordingSamples]:
    """Return the samples of one recording by finger; class 1 slides."""
    scan, setting = plan.scan, plan.setting
    (recording,) = part
    if not scan.relative:
        recording = resample_if_needed(recording, scan.rate)
    rate = scan.model_rate or recording.rate
    stream = stream_plan(sensors_of(recording, scan), setting.features, setting, rate)
    fingers = {}
    for finger, rows in extract(stream, recording).items():
        module = recording.modules[finger]
        truth = slip_truth(recording, finger, module.times)
        if truth is None:
            continue
        states = np.full(module.n_samples, UNKNOWN, dtype=np.int8)
        states[truth.codes == SLIDING], states[truth.codes == STILL] = STABLE, UNSTABLE
        usable = usable_rows(rows.features, states)
        step = scan.recordings[place].step * plan.step
        still = usable[states[usable] == UNSTABLE][::step]
        kept = np.sort(np.concatenate([usable[states[usable] == STABLE], still]))
        fingers[finger] = RecordingSamples(
            None if scan.relative else module.sensor,
            labelled_samples(rows.features, states, kept, int(plan.data_split.group_of[place])),
            plan.data_split.units_of(place, module.n_samples)[kept],
            module.times[kept] - recording.start,
            (0.0, 0.0, 0.0),
            len(usable),
        )
    return fingers


@dataclass(frozen=True)
class ChosenThreshold:
    """Threshold of the slip rules of a model, and the metrics out of fold.

    Attributes:
        place: of the threshold in `THRESHOLDS`; None if no threshold has few enough false alarms.
        counts: of all recordings at this threshold; at the highest if there is none.
        metrics: out of fold, each recording by the threshold of the others.
    """

    place: int | None
    counts: SlipCounts
    metrics: SlipSummary

    @property
    def reason(self) -> str:
        """Why there is no threshold; empty if there is one."""
        if self.place is not None:
            return ""
        minutes = self.counts.held_seconds / 60
        return (
            f"no threshold of slips has at most {SLIP_FALSE_ALARMS:g} false alarms a minute in "
            f"{minutes:.2g} min of held time; the model gets no slip rule"
        )


def choose_slip_threshold(
    curves: Sequence[Mapping[str, Curve]], groups: Sequence[int], seed: int
) -> ChosenThreshold | None:
    """Choose the threshold of slips from decisions out of fold.

    Args:
        curves: of each finger, of each recording.
        groups: unit of each recording; the threshold of its metrics is chosen without it.
        seed: of the bootstrap.

    Returns:
        The threshold; None if no recording has decisions about known slips.
    """
    used = [(curve, group) for curve, group in zip(curves, groups, strict=True) if curve]
    if not used:
        return None
    by_recording = [total_curve(list(fingers.values())) for fingers, _ in used]
    choice = ThresholdChoice(SLIP_FALSE_ALARMS)
    own = [group for _, group in used]
    places = held_out_places(by_recording, own, choice).tolist()
    counts = [
        {name: curve[place] for name, curve in fingers.items()}
        for (fingers, _), place in zip(used, places, strict=True)
    ]
    pooled = total_curve(by_recording)
    place = choose_threshold(pooled, SLIP_FALSE_ALARMS)
    intervals = slip_intervals(by_recording, choice, seed=seed)
    metrics = slip_summary(counts, intervals, threshold_chosen=True)
    if metrics is None:
        return None
    return ChosenThreshold(place, pooled[-1 if place is None else place], metrics)


def with_slip_threshold(model: Model, chosen: ChosenThreshold | None) -> Model:
    """Return the model whose slip rules have a threshold; without slip rules if there is none."""
    rules: Iterator[tuple[str, SlipRule | None]]
    if chosen is None or chosen.place is None:
        rules = zip(model.fingers, repeat(None))
    else:
        record = threshold_record(chosen.counts)
        rules = (
            (
                name,
                part.slip and _with_threshold(part.slip, float(THRESHOLDS[chosen.place]), record),
            )
            for name, part in model.fingers.items()
        )
    fingers = {
        name: msgspec.structs.replace(model.fingers[name], slip=rule) for name, rule in rules
    }
    return msgspec.structs.replace(model, fingers=fingers)


def _with_threshold(rule: SlipRule, threshold: float, record: SlipThresholds) -> SlipRule:
    classifier = msgspec.structs.replace(rule.classifier, threshold=threshold)
    return msgspec.structs.replace(rule, classifier=classifier, thresholds=record)


def threshold_record(
    counts: SlipCounts,
    requested: float = SLIP_FALSE_ALARMS,
    recordings: Mapping[str, str] | None = None,
) -> SlipThresholds:
    """Return how a threshold was chosen, for the model file."""
    minutes = counts.held_seconds / 60
    return SlipThresholds(
        requested=requested,
        false_alarms_per_minute=counts.false_held / minutes,
        found=found_shares(counts.delays)["0.1"],
        n_slips=len(counts.delays),
        held_minutes=minutes,
        recordings=dict(recordings or {}),
    )
