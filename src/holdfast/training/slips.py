"""Training of slip rules: samples that slide or hold still, and the threshold of the decision."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from holdfast.classifiers.fitting import Samples, standardise
from holdfast.classifiers.linear import MAX_DEVIATION, Linear
from holdfast.classifiers.logreg import LogisticRegression
from holdfast.features import FeatureSpec
from holdfast.metrics.slip_thresholds import (
    SLIP_THRESHOLDS,
    SlipSummary,
    ThresholdChoice,
    choose_threshold,
    held_out_places,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slips import SlipCounts, SlipCurve, slip_metrics
from holdfast.model import ANY_FINGER, Head, Model
from holdfast.training.slip_samples import SlipSamples
from holdfast.training.tune import CurvePoint

SLIP_SMOOTHING, SLIP_HOLD_TIME = 0.02, 0.05
"""Smoothing and hold time of the slip rules that `holdfast train` writes [s]."""
SLIP_FALSE_ALARMS = 1.0
"""False alarms per minute of all held time of a finger for which the threshold is set."""
MIN_SLIDING_SAMPLES = 50
"""Fewer sliding samples train no slip rule."""

NO_SLIP_DECISIONS = (
    "no decision about a slip out of fold, from which a threshold could be chosen; the model gets "
    "no slip rule"
)


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
        place: of the threshold in `SLIP_THRESHOLDS`; None if none has few enough false alarms.
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
    pooled, highest = SlipCurve.total(by_recording), len(SLIP_THRESHOLDS) - 1
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
        return model.changed(
            lambda part: part.without_thresholds("slip").without_heads("slip", "slip_speed")
        )
    threshold = float(SLIP_THRESHOLDS[chosen.place])
    point = CurvePoint(threshold, slips=slip_metrics(chosen.counts))
    return model.with_threshold("slip", threshold, point.choice(SLIP_FALSE_ALARMS))
