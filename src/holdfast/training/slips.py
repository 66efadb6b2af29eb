"""Training of slip rules: samples that slide or hold still, and the threshold of the decision."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from holdfast.classifiers.fitting import Samples, standardise
from holdfast.classifiers.linear import MAX_DEVIATION, Linear
from holdfast.classifiers.logreg import LogisticRegression
from holdfast.errors import ModelError, TrainingError
from holdfast.features import FeatureSpec
from holdfast.metrics import RecordingResults, score_recording
from holdfast.metrics.slip_thresholds import (
    MAX_RAISED_QUIET,
    THRESHOLDS,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    slip_summary,
    summarise_choice,
)
from holdfast.metrics.slips import SlipCounts, SlipCurve, SlipMetrics, found_shares, slip_metrics
from holdfast.model import ANY_FINGER, Choice, Head, Model
from holdfast.recordings import Recording
from holdfast.training.evaluation import compute_decisions
from holdfast.training.slip_samples import SlipSamples
from holdfast.training.threshold import with_head_threshold

SLIP_SMOOTHING, SLIP_HOLD_TIME = 0.02, 0.05
"""Smoothing and hold time of the slip rules that `holdfast train` writes [s]."""
SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which the threshold is set."""
MIN_SLIDING_SAMPLES = 50
"""Fewer sliding samples train no slip rule."""
N_SHOWN = 3
"""Thresholds that are shown on either side of the chosen one."""

NO_SLIP_DECISIONS = (
    "no decision about a slip out of fold, from which a threshold could be chosen; the model gets "
    "no slip rule"
)

Steps = Callable[[Iterable[Recording]], Iterable[Recording]]


def fit_slips(
    slips: SlipSamples,
    held: Collection[int],
    features: tuple[FeatureSpec, ...],
    *,
    squares: bool = False,
) -> list[Head]:
    """Fit the heads of a slip to the samples that are not in held units.

    For a model of one hand all samples weigh alike: balanced classes fit the middle, and the
    threshold lies far in the tail. On real recordings that made a model of any hand worse.

    Args:
        slips: samples.
        held: units whose samples are left out.
        features: of the samples.
        squares: whether the head has squares of the features, and the speed is estimated
            where it is known.

    Returns:
        `slip`, with a threshold of 0.5, and `slip_speed` if it is estimated; none with too few
        sliding samples, or none that hold still.
    """
    samples = slips.own.without(held)
    if samples.one_class or samples.stable.sum() < MIN_SLIDING_SAMPLES:
        return []
    rule = _fitted_rule(samples, "balanced" if slips.own.sensor is None else None, squares)
    kept = np.count_nonzero(~slips.own.samples.stable)
    thinning = np.log(slips.n_still / kept)  # odds of sliding fall by the samples left out
    rule = msgspec.structs.replace(rule, offset=rule.offset - float(thinning))
    slip = Head(
        name="slip", link="logit", features=features, rule=rule,
        smoothing=SLIP_SMOOTHING, hold=SLIP_HOLD_TIME,
    )  # fmt: skip
    return [slip, *fit_speed(slips, held, features)] if squares else [slip]


def fit_speed(
    slips: SlipSamples, held: Collection[int], features: tuple[FeatureSpec, ...]
) -> list[Head]:
    """Fit the head of the speed of a slip; none if too few samples have one."""
    speed = None if slips.speeds is None else slips.speeds.fit(held)
    if speed is None:
        return []
    rule, highest = speed
    return [Head(name="slip_speed", link="square", features=features, rule=rule, highest=highest)]


def _fitted_rule(samples: Samples, class_weight: str | None, squares: bool) -> Linear:
    """Return a rule fitted to samples, which class 1 of slides."""
    recipe = LogisticRegression()
    parameters = {**recipe.reference, "class_weight": class_weight}
    if not squares:
        return recipe.fit(samples, parameters, 0).linear
    # The classifier of [u, min(|u|, 5)^2], with u = (phi - mean) / scale, in terms of phi.
    mean, scale, standard = standardise(samples.features)
    wide = np.hstack([standard, np.minimum(np.abs(standard), MAX_DEVIATION) ** 2])
    fitted = recipe.fit(samples._replace(features=wide), parameters, 0).linear
    weights, n = np.array(fitted.weights[0]) / np.array(fitted.scale), len(mean)
    intercept = fitted.intercepts[0] - float(weights @ np.array(fitted.mean))
    return Linear.of(mean, scale, weights[:n], intercept, weights[n:], offset=fitted.offset)


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
    used = [(fingers, unit) for fingers, unit in zip(curves, groups, strict=True) if fingers]
    if not used:
        return None
    known, units = [fingers for fingers, _ in used], [unit for _, unit in used]
    pooled = SlipCurve.total([SlipCurve.total(list(fingers.values())) for fingers in known])
    place = choose_threshold(pooled, SLIP_FALSE_ALARMS)
    shown = len(THRESHOLDS) - 1 if place is None else place
    if len(set(units)) > 1:
        choice = ThresholdChoice(SLIP_FALSE_ALARMS)
        metrics = summarise_choice(known, choice, groups=units, seed=seed)
    else:
        counts = [{name: curve[shown] for name, curve in fingers.items()} for fingers in known]
        metrics = slip_summary(counts)
    if metrics is None:
        return None
    supported = _supports(pooled[0], SLIP_FALSE_ALARMS)
    return ChosenThreshold(place if supported else None, pooled[shown], metrics)


def _supports(counts: SlipCounts, false_alarms: float) -> bool:
    """Return whether the held time is long enough for one false alarm at the rate."""
    return counts.held_seconds / 60 * false_alarms >= 1


def with_slip_threshold(model: Model, chosen: ChosenThreshold | None) -> Model:
    """Return the model whose slip rules have a threshold; without slip rules if there is none."""
    if chosen is None or chosen.place is None:
        return model.changed(
            lambda part: part.without_thresholds("slip").without_heads("slip", "slip_speed")
        )
    threshold = float(THRESHOLDS[chosen.place])
    return with_head_threshold(model, "slip", threshold, slip_choice(chosen.counts))


def slip_choice(
    counts: SlipCounts,
    requested: float = SLIP_FALSE_ALARMS,
    recordings: Mapping[str, str] | None = None,
) -> Choice:
    """Return how a threshold was chosen, for the model file."""
    minutes = counts.held_seconds / 60
    return Choice(
        requested=requested,
        false_alarms_per_minute=counts.false_held / minutes,
        found=found_shares(counts.delays)["0.1"],
        n=len(counts.delays),
        minutes=minutes,
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
    choice = slip_choice(curve[place], false_alarms, digests)
    tuned = with_head_threshold(model, "slip", threshold, choice)
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
