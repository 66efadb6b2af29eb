"""Fits of the heads beside stability to the samples of their targets."""

from collections.abc import Collection, Iterator, Mapping

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.contact import CAUSES, Cause
from holdfast.detection import ANY_FINGER, FeatureSpec, Head, Model
from holdfast.detection.heads import Linear
from holdfast.kernel._extension import MAX_DEVIATION
from holdfast.sensors.types import Array
from holdfast.training.classifiers.fitting import Samples, standardise
from holdfast.training.classifiers.logreg import LogisticRegression
from holdfast.training.classifiers.newton import fit_multinomial
from holdfast.training.targets import TargetSamples

SLIP_SMOOTHING, SLIP_HOLD_TIME = 0.02, 0.05
"""Smoothing and hold time of the slip rules that `holdfast train` writes [s]."""
MIN_SLIDING_SAMPLES = 50
"""Fewer sliding samples train no slip rule."""
MIN_SPEED_SAMPLES = 500
"""Fewer sliding samples train no speed rule."""
SPEED_PENALTY = 10.0
"""Weight of the squared coefficients, beside the sum of squared errors over the samples."""
STILL_WEIGHT = 0.3
"""Weight of all samples that hold still, as a share of the weight of all that slide.

Without them the speed follows the marker of the real recordings less, and a false alarm slides
further."""
MIN_CAUSE_SAMPLES = 50
"""A cause with fewer samples is left out."""
CAUSE_PENALTY = 1e-3
"""C of the fit: the weight of a sample against the penalty on the weights."""

Features = tuple[FeatureSpec, ...]


def fit_slip(
    samples: TargetSamples,
    left_out: Collection[int],
    features: Features,
    *,
    is_any: bool,
    squares: bool = False,
    n_min: int = MIN_SLIDING_SAMPLES,
    c: float | None = None,
) -> Head | None:
    """Fit the head `slip` to the samples that are in no unit that is left out.

    For a model of one hand all samples weigh alike: balanced classes fit the middle, and the
    threshold lies far in the tail. On real recordings that made a model of any hand worse.

    Args:
        samples: of the target.
        left_out: units whose samples are left out.
        features: of the samples.
        is_any: whether the model is for any hand.
        squares: whether the head has squares of the features.
        n_min: number of sliding samples from which a head is fitted.
        c: weight of a sample against the penalty on the weights; by default that of the recipe.

    Returns:
        The head, with a threshold of 0.5; None with too few samples that slide, or none that hold
        still.
    """
    kept = samples.kept(left_out)
    slides = np.asarray(samples.values[kept], dtype=bool)
    if slides.all() or slides.sum() < n_min:
        return None
    classes = Samples(samples.features[kept], slides, samples.units[kept])
    recipe = LogisticRegression()
    parameters = {**recipe.reference, "class_weight": "balanced" if is_any else None}
    if c is not None:
        parameters["C"] = c
    if squares:
        # The classifier of [u, min(|u|, 5)^2], with u = (phi - mean) / scale, in terms of phi.
        mean, scale, standard = standardise(classes.features)
        wide = np.hstack([standard, np.minimum(np.abs(standard), MAX_DEVIATION) ** 2])
        fitted = recipe.fit(classes._replace(features=wide), parameters, 0).rule
        weights, n = np.array(fitted.weights[0]) / np.array(fitted.scale), len(mean)
        intercept = fitted.intercepts[0] - float(weights @ np.array(fitted.mean))
        rule = Linear.of(mean, scale, weights[:n], intercept, weights[n:], offset=fitted.offset)
    else:
        rule = recipe.fit(classes, parameters, 0).rule
    # The odds of sliding fall by the still samples that were left out.
    n_still = samples.n_usable - samples.n_positive
    thinning = np.log(n_still / (len(samples.values) - samples.n_positive))
    rule = msgspec.structs.replace(rule, offset=rule.offset - float(thinning))
    return Head(
        name="slip", link="logit", features=features, rule=rule,
        smoothing=SLIP_SMOOTHING, hold=SLIP_HOLD_TIME,
    )  # fmt: skip


def fit_speed(samples: TargetSamples, left_out: Collection[int], features: Features) -> Head | None:
    """Fit the head `slip_speed` to the samples that are in no unit that is left out.

    The root of the speed is fitted by least squares with a small penalty. So fast slides count
    more than with the logarithm, and less than with the speed itself.

    Args:
        samples: of the target.
        left_out: units whose samples are left out.
        features: of the samples.

    Returns:
        The head; None with too few samples that slide.
    """
    kept = samples.kept(left_out)
    values, speed = samples.features[kept], np.asarray(samples.values[kept], dtype=np.float64)
    slides = speed > 0
    n_sliding = int(np.count_nonzero(slides))
    if n_sliding < MIN_SPEED_SAMPLES:
        return None
    # Standardised by what slides, whose speed is wanted.
    mean, scale, _ = standardise(values[slides])
    standard, n = (values - mean) / scale, len(mean)
    squares = np.minimum(np.abs(standard), MAX_DEVIATION) ** 2
    columns = np.hstack([np.ones((len(standard), 1)), standard, squares])
    still_weight = STILL_WEIGHT * n_sliding / max(len(slides) - n_sliding, 1)
    # (A^T W A + penalty) c = A^T W y; the first column is the intercept, without a penalty.
    weighted = (columns * np.where(slides, 1.0, still_weight)[:, None]).T
    penalty = np.diag([0.0, *[SPEED_PENALTY] * (columns.shape[1] - 1)])
    weights = np.linalg.solve(weighted @ columns + penalty, weighted @ np.sqrt(speed))
    rule = Linear.of(mean, scale, weights[1 : n + 1], weights[0], weights[n + 1 :])
    highest = float(speed.max())  # beyond it nothing was seen, and squares rise fast
    return Head(name="slip_speed", link="square", features=features, rule=rule, highest=highest)


def fit_cause(samples: TargetSamples, left_out: Collection[int], features: Features) -> Head | None:
    """Fit the head `cause` to the samples that are in no unit that is left out.

    Args:
        samples: of the target.
        left_out: units whose samples are left out.
        features: of the samples.

    Returns:
        The head; None with fewer than two causes of at least `MIN_CAUSE_SAMPLES`.
    """
    kept, codes = samples.kept(left_out), np.asarray(samples.values, dtype=np.int64)
    counts = np.bincount(codes[kept], minlength=len(CAUSES) + 1)
    kept &= counts[codes] >= MIN_CAUSE_SAMPLES
    if np.count_nonzero(counts >= MIN_CAUSE_SAMPLES) < 2:
        return None
    names = np.array([str(cause) for cause in CAUSES])[codes[kept] - 1]
    rule, classes = fit_causes(samples.features[kept], names, CAUSE_PENALTY)
    return Head(name="cause", link="softmax", features=features, rule=rule, classes=classes)


def missing_heads(
    model: Model, slips: Mapping[str, TargetSamples], causes: Mapping[str, TargetSamples]
) -> Iterator[str]:
    """Yield a warning for each finger whose slips or causes are known, but too few to train.

    Args:
        model: that was trained.
        slips: samples of the target of `slip`, by finger.
        causes: of that of `cause`.
    """
    names = {finger: "all fingers" if finger == ANY_FINGER else finger for finger in model.fingers}
    for finger, samples in causes.items():
        if model.finger(finger).head("cause") is None:
            counts = np.bincount(np.asarray(samples.values), minlength=len(CAUSES) + 1)[1:]
            counted = [f"{n} of {cause}" for cause, n in zip(CAUSES, counts, strict=True) if n]
            yield (
                f"{names[finger]}: unstable samples {', '.join(counted)} given, at least "
                f"{MIN_CAUSE_SAMPLES} of each of two causes expected; the model names no cause "
                "there"
            )
    for finger, samples in slips.items():
        if model.finger(finger).slip is None:
            n = samples.n_positive
            yield (
                f"{names[finger]}: {n} samples that slide and {samples.n_usable - n} that hold "
                f"still given, at least {MIN_SLIDING_SAMPLES} and 1 expected; the model gets no "
                "slip rule there"
            )


def fit_causes(
    features: Array, causes: npt.NDArray[np.str_], c: float
) -> tuple[Linear, tuple[Cause, ...]]:
    """Fit the scores of causes to unstable samples; all causes weigh alike.

    Args:
        features: (n, n_features) finite.
        causes: (n,) name of the cause of each sample.
        c: inverse strength of the L2 penalty on the weights of standardised features.

    Returns:
        The rule, and the causes of its outputs.
    """
    names, classes, counts = np.unique(causes, return_inverse=True, return_counts=True)
    mean, scale, standardised = standardise(features)
    balanced = len(causes) / (len(names) * counts)
    solution = fit_multinomial(standardised, classes, balanced, c)
    rule = Linear.of(mean, scale, solution.weights, solution.intercepts)
    return rule, tuple(map(Cause, names.tolist()))
