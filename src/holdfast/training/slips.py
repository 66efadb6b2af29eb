"""Training of slip rules: samples that slide or hold still, and the threshold of the decision."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from holdfast.classifiers.fitting import Samples, standardise
from holdfast.classifiers.logreg import LogisticRegression
from holdfast.classifiers.slip import MAX_DEVIATION, SlipRule, SlipThresholds
from holdfast.contact import STABLE, UNKNOWN, UNSTABLE
from holdfast.errors import ModelError, TrainingError
from holdfast.features import FeatureSpec
from holdfast.features.stream import StreamPlan, extract
from holdfast.metrics import RecordingResults, score_recording
from holdfast.metrics.slip_thresholds import (
    MAX_RAISED_QUIET,
    THRESHOLDS,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slip_truth import SLIDING, STILL, SlipTruth, slip_truth
from holdfast.metrics.slips import SlipCounts, SlipCurve, SlipMetrics, found_shares, slip_metrics
from holdfast.model import ANY_FINGER, Model
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.resampling import true_updates
from holdfast.sensors.types import Array, Flags
from holdfast.training.dataset_scan import OneRecording, Progress
from holdfast.training.evaluation import compute_decisions
from holdfast.training.slip_speed import SpeedSamples, speed_samples
from holdfast.training.training_samples import (
    FingerSamples,
    SamplesPlan,
    join_samples,
    labelled_samples,
    pool_fingers,
    resample_if_needed,
    sensors_of,
    usable_rows,
)

SLIP_SMOOTHING, SLIP_RULE_HOLD = 0.02, 0.05
"""Smoothing and hold time of the slip rules that `holdfast train` writes [s]."""
SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which the threshold is set."""
EARLY_DURATION = 0.1
"""Time after the onset of a slip whose samples train the rule: later it is found already [s]."""
QUIET_STEP = 10
"""Only every tenth sample of quiet hold trains, beside all that are disturbed: the rule must tell
a slip from a push."""
MIN_SLIDING_SAMPLES = 50
"""Fewer sliding samples train no slip rule."""
N_SHOWN = 3
"""Thresholds that are shown on either side of the chosen one."""

NO_SLIP_DECISIONS = (
    "no decision about a slip out of fold, from which a threshold could be chosen; the model gets "
    "no slip rule"
)

Steps = Callable[[Iterable[Recording]], Iterable[Recording]]


@dataclass(frozen=True)
class SlipSamples:
    """Training samples of a slip rule.

    Attributes:
        own: of the finger; class 1 slides. All that slide are kept, and some that hold still.
        n_still: number of samples that hold still, before thinning.
        speeds: samples of the speed rule; None if no speed is known.
    """

    own: FingerSamples
    n_still: int
    speeds: SpeedSamples | None = None

    @property
    def n_sliding(self) -> int:
        """Number of samples that slide."""
        return int(self.own.samples.stable.sum())

    def fit(
        self, held: Collection[int], features: Sequence[FeatureSpec] | None = None
    ) -> SlipRule | None:
        """Fit a rule to the samples that are not in held units, with a threshold of 0.5.

        For a model of one hand all samples weigh alike: balanced classes fit the middle, and the
        threshold lies far in the tail. On real recordings that made a model of any hand worse.

        Args:
            held: units whose samples are left out.
            features: of the samples, for a rule with features of its own and with squares, which
                estimates the speed, too, where it is known; those of the classifier of
                stability, without squares, by default.

        Returns:
            The rule; None with too few sliding samples, or none that hold still.
        """
        samples = self.own.without(held)
        if samples.one_class or samples.stable.sum() < MIN_SLIDING_SAMPLES:
            return None
        weight = "balanced" if self.own.sensor is None else None
        rule = _fitted_rule(samples, weight, None if features is None else tuple(features))
        kept = np.count_nonzero(~self.own.samples.stable)
        thinning = np.log(self.n_still / kept)  # odds of sliding fall by the samples left out
        offset = rule.classifier.offset - float(thinning)
        classifier = msgspec.structs.replace(rule.classifier, offset=offset, threshold=0.5)
        rule = msgspec.structs.replace(rule, classifier=classifier)
        return rule if features is None else self.with_speed(rule, held)

    def with_speed(self, rule: SlipRule, held: Collection[int]) -> SlipRule:
        """Return a rule that estimates the speed, too, if enough samples have one.

        Args:
            rule: with the features of the samples.
            held: units whose samples are left out.
        """
        speed = None if self.speeds is None else self.speeds.fit(held)
        return rule if speed is None else msgspec.structs.replace(rule, speed=speed)


def _fitted_rule(
    samples: Samples, class_weight: str | None, features: tuple[FeatureSpec, ...] | None
) -> SlipRule:
    """Return a rule fitted to samples; with squares if it gets features of its own."""
    recipe = LogisticRegression()
    parameters = {**recipe.reference, "class_weight": class_weight}
    if features is None:
        return SlipRule(recipe.fit(samples, parameters, 0), SLIP_SMOOTHING, SLIP_RULE_HOLD)
    # The classifier of [u, min(|u|, 5)^2], with u = (phi - mean) / scale, in terms of phi.
    mean, scale, standard = standardise(samples.features)
    squares = np.minimum(np.abs(standard), MAX_DEVIATION) ** 2
    fitted = recipe.fit(samples._replace(features=np.hstack([standard, squares])), parameters, 0)
    weights, n = np.array(fitted.coefficients) / np.array(fitted.scale), len(features)
    linear = msgspec.structs.replace(
        fitted,
        mean=tuple(mean.tolist()),
        scale=tuple(scale.tolist()),
        coefficients=tuple(weights[:n].tolist()),
        intercept=fitted.intercept - float(weights @ np.array(fitted.mean)),
    )
    return SlipRule(
        linear, SLIP_SMOOTHING, SLIP_RULE_HOLD, None, features, tuple(weights[n:].tolist())
    )


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
    parts: dict[str, list[FingerSamples]] = {finger: [] for finger in plan.scan.sensors}
    speeds: dict[str, list[SpeedSamples]] = {finger: [] for finger in plan.scan.sensors}
    calls = ((place, OneRecording(recordings, place)) for place in plan.places)
    read = engine.map_ordered(_samples_of_part, calls, shared=(plan,))
    for fingers in progress(read, "slips", len(plan.places)):
        for finger, (samples, speed) in fingers.items():
            parts[finger].append(samples)
            speeds[finger] += [speed] if speed is not None else []
    no_rest = np.zeros((len(plan.scan.recordings), 3))
    by_finger = {finger: join_samples(part, no_rest) for finger, part in parts.items() if part}
    if plan.setting.is_shared and by_finger:
        by_finger = {ANY_FINGER: pool_fingers(by_finger)}
        speeds = {ANY_FINGER: [part for finger in speeds.values() for part in finger]}
    return {
        finger: SlipSamples(
            own,
            own.n_usable - int(own.samples.stable.sum()),
            SpeedSamples.joined(speeds[finger]) if speeds[finger] else None,
        )
        for finger, own in by_finger.items()
        if own.samples.stable.any()
    }


def _samples_of_part(
    plan: SamplesPlan, place: int, part: Sequence[Recording]
) -> dict[str, tuple[FingerSamples, SpeedSamples | None]]:
    """Return the samples of one recording by finger; class 1 slides.

    A model of one hand learns the first 0.1 s of slips, and to tell them from pushes. On real
    recordings that misled a model of any hand, so it learns all that slides and all that does not.
    """
    scan, setting = plan.scan, plan.setting
    recording = true_updates(part[0])
    if not scan.relative:
        recording = resample_if_needed(recording, scan.rate)
    rate, sensors = scan.model_rate or recording.rate, sensors_of(recording, scan)
    features = dict.fromkeys(sensors, setting.features)
    stream = StreamPlan(sensors, features, setting.window, setting.used_tare, rate)
    fingers = {}
    for finger, rows in extract(stream, recording).items():
        module = recording.modules[finger]
        truth = slip_truth(recording, finger, module.times)
        if truth is None:
            continue
        states = np.full(module.n_samples, UNKNOWN, dtype=np.int8)
        slides = truth.codes == SLIDING if scan.relative else _is_early(truth, module.times)
        states[slides], states[truth.codes == STILL] = STABLE, UNSTABLE
        usable = usable_rows(rows.features, states)
        step = scan.recordings[place].step * plan.step
        is_still, is_quiet = states[usable] == UNSTABLE, truth.quiet[usable]
        quiet = usable[is_still & is_quiet][:: step * (1 if scan.relative else QUIET_STEP)]
        disturbed = usable[is_still & ~is_quiet][::step]
        kept = np.sort(np.concatenate([usable[~is_still], quiet, disturbed]))
        units = plan.data_split.units_of(place, module.n_samples)
        samples = FingerSamples(
            None if scan.relative else module.sensor,
            labelled_samples(rows.features, states, kept, int(plan.data_split.group_of[place])),
            units[kept],
            np.full(len(kept), place),
            module.times[kept] - recording.start,
            np.zeros((1, 3)),
            len(usable),
        )
        speed = speed_samples(recording, finger, rows.features, truth, units)
        fingers[finger] = samples, speed
    return fingers


def _is_early(truth: SlipTruth, times: Array) -> Flags:
    """Return where a slip has begun less than `EARLY_DURATION` ago, and slides."""
    early = np.zeros(len(times), dtype=bool)
    for slip in truth.slips:
        first, last = np.searchsorted(times, (slip.onset, slip.onset + EARLY_DURATION))
        early[first:last] = True
    return np.asarray(early & (truth.codes == SLIDING))


def missing_slip_rules(model: Model, samples: Mapping[str, SlipSamples]) -> list[str]:
    """Return a warning for each finger that slides, but too little to train a slip rule."""
    return [
        f"{'all fingers' if finger == ANY_FINGER else finger}: {own.n_sliding} samples that slide "
        f"and {own.n_still} that hold still given, at least {MIN_SLIDING_SAMPLES} and 1 expected; "
        "the model gets no slip rule there"
        for finger, own in samples.items()
        if model.finger(finger).slip is None
    ]


def sliding_samples(model: Model, samples: Mapping[str, SlipSamples]) -> dict[str, int]:
    """Return the number of sliding samples that each slip rule of a model was trained on."""
    return {
        finger: own.n_sliding
        for finger, own in samples.items()
        if model.finger(finger).slip is not None
    }


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
        if not _supports(self.counts, SLIP_FALSE_ALARMS):
            return (
                f"{minutes:.2g} min of held time given; a threshold of slips for "
                f"{SLIP_FALSE_ALARMS:g} false alarms a minute needs at least "
                f"{1 / SLIP_FALSE_ALARMS:.2g} min; the model gets no slip rule"
            )
        return (
            f"no threshold of slips has at most {SLIP_FALSE_ALARMS:g} false alarms a minute in "
            f"{minutes:.2g} min of held time; the model gets no slip rule"
        )


def choose_slip_threshold(
    curves: Sequence[Mapping[str, SlipCurve]], groups: Sequence[int], seed: int
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
    by_recording = [SlipCurve.total(list(fingers.values())) for fingers, _ in used]
    own = [group for _, group in used]
    pooled, highest = SlipCurve.total(by_recording), len(THRESHOLDS) - 1
    place = choose_threshold(pooled, SLIP_FALSE_ALARMS)
    places, intervals = [highest if place is None else place] * len(used), None
    if has_others := len(set(own)) > 1:
        choice = ThresholdChoice(SLIP_FALSE_ALARMS)
        places = held_out_places(by_recording, own, choice).tolist()
        intervals = slip_intervals(by_recording, choice, groups=own, seed=seed)
    counts = [
        {name: curve[place] for name, curve in fingers.items()}
        for (fingers, _), place in zip(used, places, strict=True)
    ]
    metrics = slip_summary(counts, intervals, threshold_chosen=has_others)
    if metrics is None:
        return None
    supported = _supports(pooled[0], SLIP_FALSE_ALARMS)
    shown = pooled[highest if place is None else place]
    return ChosenThreshold(place if supported else None, shown, metrics)


def _supports(counts: SlipCounts, false_alarms: float) -> bool:
    """Return whether the held time is long enough for one false alarm at the rate."""
    return counts.held_seconds / 60 * false_alarms >= 1


def with_slip_threshold(model: Model, chosen: ChosenThreshold | None) -> Model:
    """Return the model whose slip rules have a threshold; without slip rules if there is none."""
    if chosen is None or chosen.place is None:
        return _with_rules(model, lambda _: None)
    record, threshold = threshold_record(chosen.counts), float(THRESHOLDS[chosen.place])
    return _with_rules(model, lambda rule: _with_threshold(rule, threshold, record))


def _with_rules(model: Model, change: Callable[[SlipRule], SlipRule | None]) -> Model:
    """Return the model with changed slip rules, whose thresholds are for all sensors."""
    replace = msgspec.structs.replace
    fingers = {
        name: replace(
            part.without_thresholds("slip_threshold"), slip=part.slip and change(part.slip)
        )
        for name, part in model.fingers.items()
    }
    return replace(model, fingers=fingers)


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


@dataclass(frozen=True)
class TunedSlips:
    """Result of tuning the slip rules of a model.

    Attributes:
        model: with the chosen threshold.
        threshold: that was chosen.
        chosen: metrics at this threshold, on the recordings from which it was chosen.
        before: metrics of the model that was given.
        points: thresholds around it and their metrics, lowest first.
    """

    model: Model
    threshold: float
    chosen: SlipMetrics
    before: SlipMetrics
    points: tuple[tuple[float, SlipMetrics], ...]


def tune_slips(
    model: Model,
    recordings: Sequence[Recording],
    false_alarms: float,
    *,
    progress: Steps = lambda recordings: recordings,
) -> TunedSlips:
    """Choose the threshold of the slip rules for a rate of false alarms in held time.

    Args:
        model: with slip rules.
        recordings: with a truth, or labels of slips.
        false_alarms: maximum number per minute of held time, of one finger.
        progress: iterates over the recordings.

    Raises:
        ValueError: the rate is not above 0.
        ModelError: the model has no slip rule; or a recording has other fingers or sensors.
        TrainingError: no slips are known, the held time is too short for the rate, or no
            threshold gives so few false alarms.
    """
    if not (math.isfinite(false_alarms) and false_alarms > 0):
        raise ValueError(f"false alarms per minute above 0 expected, {false_alarms:g} given")
    if not model.has_slip_rule:
        raise ModelError(
            f"{model.name or 'the model'} has no slip rule; train one on recordings whose slips "
            "are known"
        )
    digests: dict[str, str] = {}
    results: list[RecordingResults] = []
    for recording in progress(recordings):
        digests[recording.name] = recording.readings_digest
        results.append(score_recording(compute_decisions(model, recording), slip_curves=True))
    curve = SlipCurve.total([curve for result in results for curve in result.slip_curves.values()])
    if not curve:
        raise TrainingError(f"{len(results)} recordings without slips that are known")
    place = _supported(curve, false_alarms)
    before = SlipCounts.total(counts for result in results for counts in result.slips.values())
    threshold = float(THRESHOLDS[place])
    record = threshold_record(curve[place], false_alarms, digests)
    tuned = _with_rules(model, lambda rule: _with_threshold(rule, threshold, record))
    around = range(max(place - N_SHOWN, 0), min(place + N_SHOWN + 1, len(curve)))
    return TunedSlips(
        msgspec.structs.replace(tuned, name=f"{model.name}, tuned" if model.name else ""),
        threshold,
        slip_metrics(curve[place]),
        slip_metrics(before),
        tuple((float(THRESHOLDS[k]), slip_metrics(curve[k])) for k in around),
    )


def _supported(curve: SlipCurve, false_alarms: float) -> int:
    """Return the place of the threshold.

    Raises:
        TrainingError: the data do not support the rate, or no threshold has it.
    """
    minutes = curve[0].held_seconds / 60
    if not _supports(curve[0], false_alarms):
        raise TrainingError(
            f"{minutes:.2g} min of held time given; {false_alarms:g} false alarms a minute need "
            f"at least {1 / false_alarms:.2g} min"
        )
    place = choose_threshold(curve, false_alarms)
    if place is None:
        least = float(curve.false_held.min()) / minutes
        raise TrainingError(
            f"no threshold gives at most {false_alarms:g} false alarms a minute of held time "
            f"with a slip reported in at most {MAX_RAISED_QUIET:g} % of quiet hold; the least is "
            f"{least:.2g}"
        )
    return place
